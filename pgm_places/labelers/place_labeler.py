"""PlaceLabeler: learns from labelled maps and labels other maps."""

from __future__ import annotations

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
from pgm_places.labelers.method import PlaceMethod as PlaceMethod
from pgm_places.labelers.method import Unary, check_labels_maps, infer, place_methods
from pgm_places.labelers.place_problem import apply_space_evidence, cells_problem, shown_names
from pgm_places.maps.labelled_map import LabelledMap
from pgm_places.maps.occupancy_grid import OccupancyGrid
from pgm_places.options import Positive
from pgm_places.progress import Progress, reporting_to
from pgm_places.sensing.sensor import Sensor
from pgm_places.unary import options
from pgm_places.unary.feature_table import CachedFeatures, FeatureTables
from pgm_places.unary.floor_model import FloorModel, columns_of
from pgm_places.unary.halls import HallNames
from pgm_places.unary.map_model import CellScores, UnaryModel
from pgm_places.unary.options import UnaryChoice

if TYPE_CHECKING:  # scikit-learn takes a second to import, and labelling does not need it
    from pgm_places.models.decision_list import DecisionListClassifier
    from pgm_places.models.hmm import HiddenMarkovModel
    from pgm_places.unary.learning import LearnedUnary

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
        The methods by name.
    unary : {"auto", "laser", "context", "laser+space", "space", "floor"}
        Unary of methods with ``unary="auto"``: see :class:`PlaceMethod`. ``auto`` chooses by
        balanced accuracy on held-out training cells (:mod:`pgm_places.unary.options`).
    sensor : Sensor
        The simulated range sensor.
    classifier : DecisionListClassifier, optional
        The unfitted list; its order may also be ``"rarest-first"``, the default.
    connectivity : {8, 4}
        Neighbours of a cell.
    context_m : tuple of float
        Half-widths of the windows of the list with context features (m); () for no such list.
    space : SpaceOptions, optional
        Options of the list with space features; None for no such list.
    learn_on : {"out-of-fold", "in-sample"}
        Scores that the methods are trained on.
    n_folds, n_node_features, max_examples_per_map : int
        See :class:`pgm_places.unary.learning.UnaryLearner`.
    features : sequence of features or names
        Custom feature columns of the lists besides the laser features: see
        :mod:`pgm_places.features.custom`.
    halls : {"corridor", "room", "hall"}
        Label of halls, if the labels are ``corridor``, ``room`` and ``hall``. It can be changed
        after fitting: ``with_options(halls="hall")``.
    whole_spaces : bool
        Whether borders between ``corridor`` and ``room`` are moved to openings of segments, unless
        there is strong evidence for both, for methods with space features: see
        :mod:`pgm_places.labelers.place_problem`.
    doorway_depth_m : float, optional
        Depth of doorways at gates along the passage (m), for methods with space features; by
        default as in the training maps: see :mod:`pgm_places.labelers.place_problem`.
    floor : FloorModel, optional
        Floor networks, for methods with ``unary = "floor"``;
        :func:`pgm_places.trained.trained_floor` returns the shipped ones. They should not have been
        trained on the maps that the methods are fitted on.

    Attributes
    ----------
    label_names_ : tuple of K str
        The labels of results: the learned labels, with halls according to ``halls``.
    unary_model_ : UnaryModel
        The lists and networks that score cells before inference.
    methods_ : dict of str to PlaceMethod
        The fitted methods, each with its unary.
    learn_seconds_ : dict of str to float
        Training time of each method (s); empty in a stored model.
    resolution_m_ : float
        Resolution of the training maps, at which the learned weights are valid.
    movement_ : HiddenMarkovModel or None
        Transitions of a simulated robot and confusions of the list, for
        :class:`pgm_places.labelers.trajectory_labeler.TrajectoryLabeler`; None if the labelled
        cells are too sparse for a drive.
    unary_choice_ : UnaryChoice or None
        The unary that ``auto`` chose, and the held-out balanced accuracy of each candidate; None
        if all methods set their unary, and in models of earlier versions.

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
    classifier: DecisionListClassifier | None = None
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
    movement_: HiddenMarkovModel | None = field(init=False)
    unary_choice_: UnaryChoice | None = field(init=False)

    stored_as: ClassVar[str] = "place-labeler"
    _call_first: ClassVar[str] = "fit(maps)"

    def check_options(self) -> None:
        """Check the options, as :meth:`fit` does first; ConfigError for an invalid one."""
        super().check_options()
        as_features(self.features)
        for name, method in self.resolved_methods().items():
            check_labels_maps(f"method {name!r}", method.backend)
            # Classes added by teaching have only scores of the list.
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
        """Fit the lists, then the methods, on the same maps; returns the labeler itself.

        A ``feature_cache`` (:class:`~pgm_places.experiment.experiment.FeatureCache`) stores the
        laser features of the maps on disk.

        Raises
        ------
        ConfigError
            An option is invalid, or a method cannot label maps.
        LabelError
            A label has no example in any map.
        InputError
            The maps have different resolutions, at which weights would differ.
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
    ) -> LearnedUnary:
        """:meth:`fit` the labeler, and return the unary model for further training.

        ``with_scores`` includes held-out scores of the labelled cells, in the order of
        ``map.graph(labelled_only=True)``.
        """
        from pgm_places.labelers.place_learning import learn_places  # not needed for labelling

        self.check_options()
        unary, learned = learn_places(self, list(maps), with_scores, feature_cache)
        self.set_learned(**learned)
        return unary

    def with_options(self, **params: Any) -> Self:
        """A fitted copy with other options; see :meth:`Labeler.with_options`."""
        other = super().with_options(**params)
        if "halls" in params and hasattr(self, "label_names_"):
            other.label_names_ = shown_names(self.learned_names, self.unary_model_, other.halls)
        return other

    @property
    def learned_names(self) -> tuple[str, ...]:
        """The labels of the methods, which label halls as corridors."""
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
        """The graph of the map's free cells (inside ``mask``), and their scores before inference.

        Only the scores needed by ``methods`` are computed. ``lean`` scores take less memory: they
        have single precision if the methods support it, and doorways instead of segments, gates and
        places, unless ``with_spaces`` is set. ``known`` (H, W) are observed labels or -1, which
        accept or reject gates. ``own`` is a table of cached features of the nodes.
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
                with_node_features=any(trait.uses_node_features for trait in traits),
                with_halls=self.halls != "corridor",
                single=lean and all(trait.takes_single_precision for trait in traits),
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
        """The labelling problem of a method and a map."""
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
        """A method's labelling with halls labelled according to ``halls``.

        ``hall`` (N,) is the probability that a node in circulation space is in a hall, or None.
        """
        if hall is None:
            return labeling
        return HallNames((*self.learned_names, "hall")).split(labeling, hall, self.halls)

    def hall_probability(
        self, labeling: Labeling, hall: NDArray[np.float32] | None
    ) -> NDArray[np.float32] | None:
        """(N,) the probability of halls, if they are shown as corridors; None without beliefs."""
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
        """The labelling problem of given scores; ``known`` (N,) are observed labels or -1."""
        problem = cells_problem(graph, self.learned_names, scores, method.unary, known)
        if method.unary in ("laser", "context"):
            return problem
        doorway, depth_m = self.doorway_at_gates(method), self.doorway_depth_m
        return apply_space_evidence(
            problem, scores, method.unary, doorway, depth_m, whole_spaces=self.whole_spaces
        )

    def doorway_at_gates(self, method: PlaceMethod) -> int | None:
        """The label that a method restricts to accepted gates, or None."""
        space = self.unary_model_.space
        if not method.sees_spaces or space is None or space.gates is None:
            return None
        # A list with space features weights doorways by gates; networks can find other doorways.
        at_gates = method.unary == "floor" or self.doorway_depth_m is not None
        return space.doorway if at_gates else None

    def score(self, maps: Sequence[LabelledMap], *, method: str | None = None) -> float:
        """The accuracy over the labelled cells of all maps, for option searches."""
        labelings, truths = [], []
        if not maps:
            raise InputError("maps must have at least one LabelledMap, got none")
        for map_ in maps:
            graph, scores = self.scores(
                map_.grid, mask=map_.cells, methods=None if method is None else [method]
            )
            labelings.append(self.infer(graph, scores, method=method).labels)
            truths.append(map_.truth(graph))
        labels, truth = np.concatenate(labelings), np.concatenate(truths)
        return float(np.mean((labels == truth)[truth >= 0]))

    def method(self, name: str | None = None) -> PlaceMethod:
        """The fitted method of a name, by default the last one; ConfigError for other names."""
        name = name or self.default_method
        if name not in self.methods_:
            hint = nearest_name(name, list(self.methods_))
            raise ConfigError(f"this model has no method {name!r}. {hint}")
        return self.methods_[name]

    @property
    def default_method(self) -> str:
        """The name of the last method, the default of :meth:`label`."""
        self.check_fitted()
        return list(self.methods_)[-1]

    @property
    def choices(self) -> dict[str, str]:
        """The options chosen on training data, with a text each."""
        choice: UnaryChoice | None = getattr(self, "unary_choice_", None)
        return {} if choice is None else {"unary": choice.words}

    def resolved_methods(self) -> dict[str, PlaceMethod]:
        """The methods by name, built, with their unary; ``auto`` is resolved in training."""
        return place_methods(
            self.methods,
            bool(self.context_m),
            self.space is not None,
            self.floor is not None,
            self.unary,
        )

    def _part(self, name: str) -> Any:
        return self.resolved_methods() if name == "methods" else super()._part(name)
