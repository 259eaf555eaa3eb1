"""The problem of cells, gates and places: its nodes, links and unaries."""

import numpy as np
import pytest

from pgm_places.graph.edge_kind import EdgeKind
from pgm_places.graph.label_graph import LabelGraph
from pgm_places.graph.layout import GridLayout
from pgm_places.graph.node_kind import NodeKind
from pgm_places.inference.problem import LabelingProblem
from pgm_places.labelers.space_problem import space_problem
from pgm_places.models.space_field import SpaceField
from pgm_places.spaces.gates import gate_candidates
from pgm_places.spaces.segmentation import Segmentation
from pgm_places.unary.space_model import MapSpaces, with_gates
from tests.spaces.floors import corridor_with_rooms, grid_of, two_rooms

NAMES = ("corridor", "room", "doorway")
DOORWAY = 2


def parts(
    free: np.ndarray, seed: int = 0
) -> tuple[LabelingProblem, GridLayout, MapSpaces, np.ndarray]:
    """The problem of a floor's cells, and the scores that know nothing of gates."""
    rng = np.random.default_rng(seed)
    grid = grid_of(free)
    gates = gate_candidates(Segmentation.of(grid))
    spaces = MapSpaces.of(gates, rng.uniform(0.1, 0.9, len(gates)))
    graph = LabelGraph.from_grid(grid)
    layout = graph.layout
    assert isinstance(layout, GridLayout)
    plain = np.log(rng.dirichlet(np.ones(3), graph.n_nodes))
    log_z = with_gates(plain, spaces.at_gates(layout), DOORWAY)
    return LabelingProblem(graph, NAMES, log_z), layout, spaces, plain


def test_cells_come_first_then_gates_then_places() -> None:
    cells, layout, spaces, _ = parts(corridor_with_rooms())
    whole = space_problem(cells, layout, spaces, DOORWAY)
    n, places = cells.graph.n_nodes, spaces.gates.segmentation.scales[0]
    expected = [NodeKind.CELL] * n + [NodeKind.GATE] * len(spaces.gates)
    expected += [NodeKind.PLACE] * places.count
    assert len(spaces.gates) >= 3
    assert whole.graph.node_kind is not None
    assert whole.graph.node_kind.tolist() == expected


def test_links_are_those_of_the_map() -> None:
    """Each cell by its own: the segment it lies in, and the rectangles it lies in."""
    cells, layout, spaces, _ = parts(corridor_with_rooms())
    whole = space_problem(cells, layout, spaces, DOORWAY)
    n, g = cells.graph.n_nodes, len(spaces.gates)
    raster = spaces.gates.segmentation.scales[0].raster()
    grid = spaces.gates.segmentation.watershed.grid
    expected = {(i, j) for i, j in cells.graph.edges.tolist()}
    for i, (r, c) in enumerate(layout.cells_rc.tolist()):
        if raster[r, c] >= 0:
            expected.add((i, n + g + int(raster[r, c])))
        for k, gate in enumerate(spaces.gates):
            deeper = max(0.6 - gate.depth_m / 2, 0.0)
            if gate.contains(grid.cell_centres_m([[r, c]]), wider_m=0.1, deeper_m=deeper)[0]:
                expected.add((i, n + k))
    for k, (a, b) in enumerate(spaces.gates.segments.tolist()):
        expected |= {(n + k, n + g + a), (n + k, n + g + b)}
    assert {(i, j) for i, j in whole.graph.edges.tolist()} == expected


def test_gates_and_places_have_their_own_evidence() -> None:
    cells, layout, spaces, plain = parts(two_rooms())
    whole = space_problem(cells, layout, spaces, DOORWAY)
    n, (p,) = cells.graph.n_nodes, spaces.probability.tolist()
    assert whole.unary is not None
    np.testing.assert_allclose(np.exp(whole.unary[n]), [1 - p, 1 - p, p], rtol=1e-12)
    assert whole.unary[n + 1 :].tolist() == [[0.0, 0.0, -np.inf]] * 2
    odds = whole.unary[:n] - whole.unary[:n, :1]
    expected = plain - plain[:, :1] + np.array([0.0, 0.0, np.log(0.02)])
    np.testing.assert_allclose(odds, expected, rtol=0, atol=1e-6)  # gates' are float32


@pytest.mark.parametrize("connectivity", [4, 8])
def test_edges_of_cells_keep_their_kinds(connectivity: int) -> None:
    cells, layout, spaces, _ = parts(two_rooms())
    graph = LabelGraph.from_grid(two_rooms(), connectivity=connectivity)
    given = LabelingProblem(graph, NAMES, cells.unary)
    whole = space_problem(given, layout, spaces, DOORWAY)
    kinds = whole.graph.edge_kind
    assert kinds is not None and graph.edge_kind is not None
    among = (whole.graph.edges < graph.n_nodes).all(axis=1)
    assert np.array_equal(kinds[among], graph.edge_kind)
    assert set(np.unique(kinds[~among])) == {
        EdgeKind.CELL_GATE,
        EdgeKind.CELL_PLACE,
        EdgeKind.GATE_PLACE,
    }


def test_a_map_without_open_space_has_cells_alone() -> None:
    free = np.zeros((6, 6), np.bool_)
    free[2, 2:4] = True
    cells, layout, spaces, _ = parts(free)
    whole = space_problem(cells, layout, spaces, DOORWAY)
    assert whole.graph.n_nodes == cells.graph.n_nodes == 2
    assert SpaceField().infer(whole).labels.shape == (2,)
