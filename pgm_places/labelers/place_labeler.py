"""PlaceLabeler: labels the places of a map; the class that most users need."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, ClassVar, Literal, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pgm_places._arguments import public_options
from pgm_places._checks import label_raster
from pgm_places.errors import ConfigError, InputError, nearest_name
from pgm_places.features.custom import as_features
from pgm_places.graph.label_graph import LabelGraph
from pgm_places.inference.backends import traits_of
from pgm_places.inference.labeling import Labeling
from pgm_places.inference.problem import LabelingProblem
from pgm_places.kernels.threads import thread_limit
from pgm_places.labelers.labeler import Labeler
from pgm_places.labelers.method import (
    PlaceMethod,
    Unary,
    check_labels_maps,
    infer,
    place_methods,
)
from pgm_places.labelers.place_problem import apply_space_evidence, cells_problem, shown_names
from pgm_places.maps.labelled_map import LabelledMap
from pgm_places.maps.occupancy_grid import OccupancyGrid
from pgm_places.options import Positive
from pgm_places.progress import Progress, reporting_to
from pgm_places.sensing.sensor import Sensor
from pgm_places.unary import options
from pgm_places.unary.choice import UnaryChoice
from pgm_places.unary.feature_table import CachedFeatures, FeatureTables
from pgm_places.unary.floor_model import FloorModel, columns_of
from pgm_places.unary.halls import HallNames
from pgm_places.unary.map_model import CellScores, UnaryModel

if TYPE_CHECKING:  # scikit-learn takes a second to import, and labelling does without it
    from pgm_places.models.decision_list import DecisionListClassifier
    from pgm_places.models.hmm import HiddenMarkovModel
    from pgm_places.unary.learning import LearnedUnary

__all__ = ["Connectivity", "PlaceLabeler", "PlaceMethod"]

Connectivity = Literal[4, 8]
SENSOR = Sensor()
SPACE = options.SpaceOptions()


@public_options
@dataclass(eq=False, repr=False)
class PlaceLabeler(Labeler):
    """Learns places from labelled maps and labels others.

    Parameters
    ----------
    label_names : sequence of K str
        The places to distinguish, for example ``("corridor", "room", "doorway")``.
    methods : mapping of str to PlaceMethod, backend, or name; or sequence of names
        The methods to learn, by the name they are asked for later.
    unary : {"auto", "laser", "context", "laser+space", "space", "floor"}
        What methods are given that do not say it: see :class:`PlaceMethod`. ``auto`` chooses by
        balanced accuracy on held-out training cells (:mod:`pgm_places.unary.choice`).
    sensor : Sensor
        The simulated range sensor.
    classifier : DecisionListClassifier, optional
        The unfitted list with its options; its order may also be ``"rarest-first"``, which is
        what the default one does.
    connectivity : {8, 4}
        Neighbours of a cell.
    context_m : tuple of float
        Half-widths in metres of the windows of the second list; () to do without.
    space : SpaceOptions, optional
        The list that also sees segments, gates and places; None to do without.
    learn_on : {"out-of-fold", "in-sample"}
        Which scores the methods are trained on.
    n_folds, n_node_features, max_examples_per_map : int
        See :class:`pgm_places.unary.learning.UnaryLearner`.
    features : sequence of features or names
        Custom columns that the lists use in addition to the laser's: see
        :mod:`pgm_places.features.custom`.
    halls : {"corridor", "room", "hall"}
        What halls are labelled, where ``hall`` is one of the labels beside ``corridor`` and
        ``room``. A fitted labeler changes its mind by ``with_options(halls="hall")``.
    whole_spaces : bool
        Whether borders between ``corridor`` and ``room`` run along openings of segments where
        little speaks for two spaces, for methods that see segments: see
        :mod:`pgm_places.labelers.space_consistency`.
    doorway_depth_m : float, optional
        How deep doorways with gates are labelled along the passage, for methods that see gates; by
        default as in the maps that were learned from: see
        :mod:`pgm_places.labelers.place_problem`.
    floor : FloorModel, optional
        Networks that see the whole floor, for methods with ``unary = "floor"``:
        :func:`pgm_places.trained.trained_floor` are those that ship with the package. They should
        not have seen the maps that methods learn from.

    Attributes
    ----------
    label_names_ : tuple of K str
        The labels of its results: those that were learned, halls as ``halls`` has them.
    unary_model_ : UnaryModel
        The lists: what is known of a cell before its neighbours are asked.
    methods_ : dict of str to PlaceMethod
        The fitted methods, each with the unary that it learned on.
    learn_seconds_ : dict of str to float
        How long each method took to learn; empty in a stored model.
    resolution_m_ : float
        Side of the training maps' cells; learned weights belong to it.
    movement_ : HiddenMarkovModel or None
        Which place follows which along a robot's way, and how the list errs, for
        :class:`pgm_places.labelers.trajectory_labeler.TrajectoryLabeler`; None where the labels
        are too sparse to drive from one to the next.
    unary_choice_ : UnaryChoice or None
        The unary that ``auto`` chose, and the held-out balanced accuracy of each; None where all
        methods said theirs, and in models of earlier versions.

    Examples
    --------
    >>> from pgm_places.simulation import generate_building
    >>> building = generate_building(size="small")
    >>> known = LabelledMap(building.grid, building.labels)
    >>> labeler = PlaceLabeler(building.label_names, ["relaxation"]).fit([known])
    >>> labeling = labeler.label(building.grid)
    >>> truth = known.truth(known.graph())
    >>> bool((labeling.labels == truth)[truth >= 0].mean() > 0.9)
    True
    """

    label_names: Sequence[str]
    methods: Mapping[str, Any] | Sequence[str] = ("independent",)
    sensor: Sensor = SENSOR
    classifier: "DecisionListClassifier | None" = None
    connectivity: Connectivity = 8
    context_m: options.WindowsM = options.ContextOptions().half_widths_m
    space: options.SpaceOptions | None = SPACE
    learn_on: options.LearnOn = "out-of-fold"
    n_folds: options.NumberOfFolds = 5
    n_node_features: options.NumberOfNodeFeatures = 30
    max_examples_per_map: options.NumberOfExamples | None = None
    features: Sequence[Any] = ()
    halls: options.HallsAs = "corridor"
    whole_spaces: bool = True
    doorway_depth_m: Positive | None = None
    floor: FloorModel | None = None
    unary: Unary = "auto"

    unary_model_: UnaryModel = field(init=False)
    methods_: dict[str, PlaceMethod] = field(init=False)
    learn_seconds_: dict[str, float] = field(init=False)
    resolution_m_: float = field(init=False)
    movement_: "HiddenMarkovModel | None" = field(init=False)
    unary_choice_: UnaryChoice | None = field(init=False)

    stored_as: ClassVar[str] = "place-labeler"
    _call_first: ClassVar[str] = "fit(maps)"

    def check_options(self) -> None:
        """Refuse options that are not understood; :meth:`fit` does so before anything else.

        Raises
        ------
        ConfigError
            An option is not understood, or a method cannot label maps.
        """
        super().check_options()
        as_features(self.features)
        for name, method in self.resolved_methods().items():
            check_labels_maps(f"method {name!r}", method.backend)
            # Classes that were taught later have scores of the list alone.
            if method.unary == "floor" and self.floor is not None and -1 not in self.floor.columns:
                names = tuple(self.label_names)
                halls = HallNames.among(names)
                columns_of(names if halls is None else halls.folded)

    def fit(
        self,
        maps: Sequence[LabelledMap],
        *,
        feature_cache: FeatureTables | None = None,
        n_threads: int | None = None,
        progress: Progress | None = None,
    ) -> Self:
        """The labeler itself, fitted: the lists, then every method that learns, on the same maps.

        A ``feature_cache`` (:class:`~pgm_places.experiment.feature_cache.FeatureCache`) keeps the
        laser features of the maps on disk.

        Raises
        ------
        ConfigError
            An option is not understood, or a method cannot label maps.
        LabelError
            A label has no example in any map.
        InputError
            The maps have different resolutions; structured weights do not carry over.
        """
        with thread_limit(n_threads), reporting_to(progress):
            self.learn(maps, feature_cache=feature_cache)
        return self

    def learn(
        self,
        maps: Sequence[LabelledMap],
        *,
        with_scores: bool = False,
        feature_cache: FeatureTables | None = None,
    ) -> "LearnedUnary":
        """What :meth:`fit` learns of cells on their own, for what learns from it in turn.

        ``with_scores``, that holds what lists that have not seen them say of each map's labelled
        cells, in the order of ``map.graph(labelled_only=True)``.
        """
        from pgm_places.labelers.place_learning import learn_places  # labelling does without it

        self.check_options()
        unary, learned = learn_places(self, list(maps), with_scores, feature_cache)
        self.set_learned(**learned)
        return unary

    def with_options(self, **params: Any) -> Self:
        """A copy that has learned the same and labels with other options; see the base class."""
        other = super().with_options(**params)
        if "halls" in params and hasattr(self, "label_names_"):
            other.label_names_ = shown_names(self.learned_names, self.unary_model_, other.halls)
        return other

    @property
    def learned_names(self) -> tuple[str, ...]:
        """The labels that the methods know: halls are corridors to them."""
        self.check_fitted()
        return self.label_names_[: self.unary_model_.n_labels]

    def scores(
        self,
        grid: OccupancyGrid,
        *,
        mask: ArrayLike | None = None,
        methods: Sequence[str] | None = None,
        lean: bool = False,
        with_spaces: bool | None = None,
        known: NDArray[np.int16] | None = None,
        own: CachedFeatures | None = None,
        n_threads: int | None = None,
        progress: Progress | None = None,
    ) -> tuple[LabelGraph, CellScores]:
        """The graph of the map's free cells (inside ``mask``) and what the lists say of each.

        Only what the methods want is computed. ``lean`` scores take less memory: in single
        precision where the methods take that, with the doorways of the map in place of segments,
        gates and places, unless ``with_spaces`` asks for these. ``known`` (H, W), labels or -1,
        tells which gates are doorways where it covers them; ``own`` is a table
        of the nodes' features if they are known.
        """
        self.check_fitted()
        if known is not None:
            known = label_raster("known", known, grid.shape, n_labels=len(self.label_names_))
        chosen = [self.method(name) for name in (methods or self.methods_)]
        traits = [traits_of(method.backend) for method in chosen]
        graph = LabelGraph.from_grid(grid, connectivity=self.connectivity, mask=mask)
        with thread_limit(n_threads), reporting_to(progress):
            scores = self.unary_model_.scores(
                grid,
                graph,
                unaries={method.unary for method in chosen},
                with_node_features=any(item.uses_node_features for item in traits),
                with_halls=self.halls != "corridor",
                single=lean and all(item.takes_single_precision for item in traits),
                with_spaces=not lean if with_spaces is None else with_spaces,
                known=known,
                own=own,
            )
        return graph, scores

    def problem(
        self,
        grid: OccupancyGrid,
        *,
        method: str | None = None,
        mask: ArrayLike | None = None,
        n_threads: int | None = None,
        progress: Progress | None = None,
    ) -> LabelingProblem:
        """The labelling problem that a method is given for a map."""
        name = method or self.default_method
        with thread_limit(n_threads), reporting_to(progress):
            graph, scores = self.scores(grid, mask=mask, methods=[name])
        return self.problem_of(graph, scores, self.method(name))

    def label(
        self,
        grid: OccupancyGrid,
        *,
        method: str | None = None,
        mask: ArrayLike | None = None,
        truth: ArrayLike | None = None,
        n_threads: int | None = None,
        progress: Progress | None = None,
    ) -> Labeling:
        """The labels of the map's free cells, in the node order of ``LabelGraph.from_grid``."""
        name = method or self.default_method
        with thread_limit(n_threads), reporting_to(progress):
            graph, scores = self.scores(grid, mask=mask, methods=[name])
            return self.infer(graph, scores, method=name, truth=truth)

    def infer(
        self,
        graph: LabelGraph,
        scores: CellScores,
        *,
        method: str | None = None,
        truth: ArrayLike | None = None,
    ) -> Labeling:
        """A method's labelling of given scores; ``truth`` (N,) only adds to its history."""
        chosen = self.method(method)
        problem = self.problem_of(graph, scores, chosen)
        return self.with_halls(infer(chosen.backend, problem, truth), scores.hall)

    def with_halls(self, labeling: Labeling, hall: NDArray[np.float32] | None) -> Labeling:
        """A method's labelling with halls labelled as ``halls`` says.

        ``hall`` (N,) is the probability that a node's circulation is a hall, where it is known.
        """
        if hall is None:
            return labeling
        return HallNames((*self.learned_names, "hall")).split(labeling, hall, self.halls)

    def hall_probability(
        self, labeling: Labeling, hall: NDArray[np.float32] | None
    ) -> NDArray[np.float32] | None:
        """(N,) the probability that each node lies in a hall, where halls are shown as corridors.

        None where they are not, where the model knows no halls, and without beliefs.
        """
        if hall is None or labeling.beliefs is None or self.halls != "corridor":
            return None
        circulation = labeling.beliefs[:, self.learned_names.index("corridor")]
        return np.asarray(circulation * hall, np.float32)

    def problem_of(
        self,
        graph: LabelGraph,
        scores: CellScores,
        method: PlaceMethod,
        *,
        known: NDArray[np.int64] | None = None,
    ) -> LabelingProblem:
        """The labelling problem of given scores; ``known`` (N,) holds known labels, or -1."""
        problem = cells_problem(graph, self.learned_names, scores, method.unary, known)
        if method.unary in ("laser", "context"):
            return problem
        doorway, depth_m = self.doorway_at_gates(method), self.doorway_depth_m
        return apply_space_evidence(
            problem, scores, method.unary, doorway, depth_m, whole_spaces=self.whole_spaces
        )

    def doorway_at_gates(self, method: PlaceMethod) -> int | None:
        """The label that a method keeps to accepted gates, None for none."""
        space = self.unary_model_.space
        if not method.sees_spaces or space is None or space.gates is None:
            return None
        # A list with spaces weighs its doorways by gates itself; networks may see more of them.
        at_gates = method.unary == "floor" or self.doorway_depth_m is not None
        return space.doorway if at_gates else None

    def score(self, maps: Sequence[LabelledMap], *, method: str | None = None) -> float:
        """The accuracy over the labelled cells of all maps together, for searches of options."""
        labelings, truths = [], []
        if not maps:
            raise InputError("maps must hold at least one LabelledMap, got none")
        for item in maps:
            graph, scores = self.scores(
                item.grid, mask=item.cells, methods=None if method is None else [method]
            )
            labelings.append(self.infer(graph, scores, method=method).labels)
            truths.append(item.truth(graph))
        labels, truth = np.concatenate(labelings), np.concatenate(truths)
        return float(np.mean((labels == truth)[truth >= 0]))

    def method(self, name: str | None = None) -> PlaceMethod:
        """The fitted method of that name, the default one for None; ConfigError if none is."""
        name = name or self.default_method
        if name not in self.methods_:
            hint = nearest_name(name, list(self.methods_))
            raise ConfigError(f"this model has no method {name!r}. {hint}")
        return self.methods_[name]

    @property
    def default_method(self) -> str:
        """The last method, which is what :meth:`label` uses when none is named."""
        self.check_fitted()
        return list(self.methods_)[-1]

    @property
    def choices(self) -> dict[str, str]:
        """What was chosen on training data, in words, by option."""
        choice: UnaryChoice | None = getattr(self, "unary_choice_", None)
        return {} if choice is None else {"unary": choice.words}

    def resolved_methods(self) -> dict[str, PlaceMethod]:
        """The methods by name, built, each with its unary, or ``auto`` where learning chooses."""
        return place_methods(
            self.methods,
            bool(self.context_m),
            self.space is not None,
            self.floor is not None,
            self.unary,
        )

    def _part(self, name: str) -> Any:
        return self.resolved_methods() if name == "methods" else super()._part(name)
