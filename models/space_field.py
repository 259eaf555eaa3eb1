"""Field over cells, gates and places: one labelling of a map and of the spaces it consists of."""

from dataclasses import dataclass
from typing import Annotated, ClassVar

import numpy as np
from numpy.typing import NDArray

from pgm_places._option_marks import Ge, Gt, Lt
from pgm_places.errors import InputError
from pgm_places.graph.edge_kind import EdgeKind
from pgm_places.graph.node_kind import NodeKind
from pgm_places.inference.labeling import Labeling
from pgm_places.inference.potentials import Potentials
from pgm_places.inference.problem import LabelingProblem, evident_unary
from pgm_places.models.decoding import Decoder, decode_as
from pgm_places.options import Whole, check_options

__all__ = ["SpaceField"]

Weight = Annotated[float, Ge(0)]


@dataclass(frozen=True)
class SpaceField:
    """Labels the cells of a map together with its gates and places.

    All nodes have the same labels. A gate is a doorway, or it has the label of the space it lies
    in; a place is anything but a doorway. A labelling y scores, up to a constant, the unaries of
    the cells, and

    - ``weight`` for each pair of neighbouring cells that agree,
    - ``place_weight`` for each cell with the label of its place, or labelled doorway,
    - ``doorway_weight`` for each cell labelled doorway at a gate that is one,
    - ``gate_weight * n`` times the log odds of being a doorway for each gate that is one, counted
      from ``gate_threshold`` on, where n is the number of cells at it,
    - ``passage_weight * m`` for each of the two places beside a gate that has its label, and twice
      that for a doorway, where m is the number of cells of the smaller place: a doorway parts two
      places of any labels, any other gate wants them to agree.

    Every reward is for agreement, so that expansion moves label the graph. Links between cells and
    places are the robust potentials of Kohli, Ladicky and Torr (IJCV 2009): a whole place is
    consulted for each of its cells, but may be overruled by any of them. On a graph of cells alone
    the method is the Potts field.

    There is no ``fit``. On buildings left out, weights learned by max margin with all three kinds
    of nodes gained 1.0 points of balanced accuracy and lost 1.2 of doorway F1, and weights chosen
    on other buildings changed no mean by more than 0.1 (docs/results.md);
    ``python -m experiments.space_field`` shows both.

    Parameters
    ----------
    weight, place_weight, doorway_weight, gate_weight, passage_weight : float
        In units of the unary log-probabilities; chosen on buildings held out (docs/results.md).
        0 takes a link out.
    gate_threshold : float
        The probability from which on a gate by itself is a doorway.
    inference : str
        A decoder of :mod:`pgm_places.models.decoding`: ``graph-cut``, ``mean-field``, ...
    certify : bool
        Whether to add an upper bound of the best score where the decoder has none.
    max_iterations : int, optional
        Limit of the decoder's iterations instead of its own.

    Examples
    --------
    >>> from pgm_places.graph.label_graph import LabelGraph
    >>> unary = np.log([[0.9, 0.1], [0.4, 0.6], [0.9, 0.1]])
    >>> chain = LabelGraph.from_edges(3, [(0, 1), (1, 2)])
    >>> problem = LabelingProblem(chain, ["room", "corridor"], unary)
    >>> SpaceField().infer(problem).labels.tolist()
    [0, 0, 0]
    """

    uses_node_features: ClassVar[bool] = False
    labels_spaces: ClassVar[bool] = True

    weight: Weight = 0.25
    place_weight: Weight = 0.25
    doorway_weight: Weight = 4.0
    gate_weight: Weight = 1.0
    passage_weight: Weight = 0.1
    gate_threshold: Annotated[float, Gt(0), Lt(1)] = 0.7
    inference: Decoder = "graph-cut"
    certify: bool = False
    max_iterations: Whole | None = None

    def __post_init__(self) -> None:
        check_options(self)

    def infer(self, problem: LabelingProblem) -> Labeling:
        """The labelling that the decoder finds, with its score and status.

        Raises
        ------
        InputError
            The problem has no unary, forbids every label at some node, or has nodes of several
            kinds without edges of known kinds.
        """
        return decode_as(self, problem, self.potentials(problem), self.inference)

    def potentials(self, problem: LabelingProblem) -> Potentials:
        """The log-potentials of a problem's nodes and edges.

        Unary rows of gates hold log p of the doorway and log (1 - p) of every other label; labels
        that no place may have are those of doorways.
        """
        unary = evident_unary(problem, "space_field")
        graph = problem.graph
        if graph.node_kind is None:
            return Potentials.potts(unary, self.weight)
        if graph.edge_kind is None:
            raise InputError(
                "'space_field' needs to know which edges join cells, gates and places; the graph "
                "has node_kind but no edge_kind"
            )
        links = _Links(graph.edges, graph.edge_kind, graph.node_kind)
        is_doorway = np.isneginf(unary[graph.node_kind == NodeKind.PLACE]).all(axis=0)
        is_gate = graph.node_kind == NodeKind.GATE
        smaller = self.passage_weight * links.smaller_place
        theta = np.where(np.isneginf(unary), 0.0, unary)  # 0 times -inf is no number
        asked = np.log(self.gate_threshold) - np.log1p(-self.gate_threshold)
        theta[np.ix_(is_gate, is_doorway)] -= asked
        theta[is_gate] *= (self.gate_weight * links.n_cells[is_gate])[:, None]
        theta[np.ix_(is_gate, is_doorway)] += 2 * smaller[is_gate, None]
        in_place = links.of(EdgeKind.CELL_PLACE)[:, 0]
        theta[np.ix_(in_place, is_doorway)] += self.place_weight
        earned = np.full((graph.n_edges, problem.n_labels), self.weight)
        of_gates = smaller[links.of(EdgeKind.GATE_PLACE)[:, 0], None]
        for kind, reward in (
            (EdgeKind.CELL_GATE, np.where(is_doorway, self.doorway_weight, 0.0)),
            (EdgeKind.CELL_PLACE, np.where(is_doorway, 0.0, self.place_weight)),
            (EdgeKind.GATE_PLACE, np.where(is_doorway, 0.0, of_gates)),
        ):
            earned[graph.edge_kind == kind] = reward
        return Potentials(problem.with_evidence(theta), agreement=earned)


@dataclass(frozen=True, eq=False)
class _Links:
    """The edges of a graph of cells, gates and places, which are numbered in this order."""

    edges: NDArray[np.int32]
    edge_kind: NDArray[np.int8]
    node_kind: NDArray[np.int8]

    def of(self, kind: EdgeKind) -> NDArray[np.int32]:
        """(n, 2) the edges of a kind."""
        return self.edges[self.edge_kind == kind]

    @property
    def n_cells(self) -> NDArray[np.int64]:
        """(N,) the number of cells at each gate and in each place, 0 for cells."""
        of_cells = np.isin(self.edge_kind, (EdgeKind.CELL_GATE, EdgeKind.CELL_PLACE))
        return np.bincount(self.edges[of_cells, 1], minlength=len(self.node_kind))

    @property
    def smaller_place(self) -> NDArray[np.float64]:
        """(N,) the number of cells of the smaller place beside each gate, 0 for other nodes."""
        gate, place = self.of(EdgeKind.GATE_PLACE).T
        found = np.full(len(self.node_kind), np.inf)
        np.minimum.at(found, gate, self.n_cells[place])
        return np.where(np.isinf(found), 0.0, found)
