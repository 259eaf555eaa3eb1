"""Label the places of a map: the object that most users need."""

import inspect
import math
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pgm_places._checks import nearest_name, sealed
from pgm_places.errors import ConfigError, InputError, NotFittedError
from pgm_places.features.own import as_features
from pgm_places.graph.label_graph import LabelGraph
from pgm_places.inference.backends import Backend, Learnable, build, uses_node_features
from pgm_places.inference.labeling import Labeling
from pgm_places.inference.problem import LabelingProblem
from pgm_places.labelers.movement import learn_movement
from pgm_places.maps.labelled_map import LabelledMap, require_examples
from pgm_places.maps.occupancy_grid import OccupancyGrid
from pgm_places.progress import Progress, Silent, Stage
from pgm_places.sensing.sensor import Sensor
from pgm_places.unary.learning import PRIOR_WEIGHT, RAREST_FIRST, fit_unary
from pgm_places.unary.map_model import CellScores, UnaryModel

if TYPE_CHECKING:  # scikit-learn takes a second to import, and labelling does without it
    from pgm_places.models.decision_list import DecisionListClassifier
    from pgm_places.models.hmm import HiddenMarkovModel

__all__ = ["PlaceLabeler", "PlaceMethod"]


@dataclass(frozen=True)
class PlaceMethod:
    """A backend and which unary it is given.

    Parameters
    ----------
    backend : Backend or str
        Any method of :mod:`pgm_places.inference.backends`, or its name.
    unary : {"laser", "context"}
        The list on laser features alone (the paper's), or the one that also sees its neighbourhood.
    seconds : float
        How long learning took.
    """

    backend: Any
    unary: str = "laser"
    seconds: float = 0.0

    def __post_init__(self) -> None:
        if isinstance(self.backend, str):
            object.__setattr__(self, "backend", build(self.backend))
        if self.unary not in ("laser", "context"):
            raise ConfigError(f"unary must be 'laser' or 'context', got {self.unary!r}")


@dataclass(frozen=True)
class PlaceLabeler:
    """Learns places from labelled maps and labels others.

    Parameters
    ----------
    label_names : sequence of str
        The places to tell apart, for example ``("corridor", "room", "doorway")``.
    methods : mapping of str to PlaceMethod, backend, or name
        The methods to learn, by the name they are asked for later.
    sensor : Sensor
        The simulated range sensor.
    classifier : DecisionListClassifier, optional
        The unfitted list with its options; its order may also be ``"rarest-first"``, which is
        what the default one does.
    connectivity : {8, 4}
        Neighbours of a cell.
    context_m : tuple of float
        Half-widths of the windows of the second list; () to do without.
    learn_on : {"in-sample", "out-of-fold"}
        Which scores the methods learn from.
    n_folds, n_node_features, max_examples_per_map : int
        See :func:`pgm_places.unary.learning.fit_unary`.
    features : sequence of features or names
        Columns of your own that the lists see beside the laser's: see
        :mod:`pgm_places.features.own`.
    unary_model : UnaryModel or None
        Filled by :meth:`fit`.
    movement : HiddenMarkovModel or None
        Filled by :meth:`fit`: which place follows which along a robot's way, and how the list
        errs, for :class:`pgm_places.labelers.trajectory_labeler.TrajectoryLabeler`.

    Examples
    --------
    >>> from pgm_places.datasets import generate_building
    >>> building = generate_building(size="small")
    >>> known = LabelledMap(building.grid, building.labels)
    >>> labeler = PlaceLabeler(building.label_names, {"relaxation": "relaxation"}).fit([known])
    >>> labeling = labeler.label(building.grid)
    >>> truth = known.truth(known.graph())
    >>> bool((labeling.labels == truth)[truth >= 0].mean() > 0.9)
    True
    """

    label_names: Sequence[str]
    methods: Mapping[str, Any] = field(default_factory=lambda: {"independent": "independent"})
    sensor: Sensor = field(default_factory=Sensor)
    classifier: "DecisionListClassifier | None" = None
    connectivity: int = 8
    context_m: tuple[float, ...] = ()
    learn_on: str = "out-of-fold"
    n_folds: int = 5
    n_node_features: int = 30
    max_examples_per_map: int | None = None
    features: Sequence[Any] = ()
    unary_model: UnaryModel | None = field(default=None, repr=False)
    resolution_m: float | None = None
    movement: "HiddenMarkovModel | None" = field(default=None, repr=False)

    def __post_init__(self) -> None:
        object.__setattr__(self, "label_names", tuple(self.label_names))
        checked = {name: _as_method(method) for name, method in self.methods.items()}
        if not checked:
            raise ConfigError("a labeler needs at least one method")
        wants_context = [name for name, item in checked.items() if item.unary == "context"]
        if wants_context and not self.context_m:
            raise ConfigError(
                f"method {wants_context[0]!r} wants unary='context' but context_m is empty; give "
                "the half-widths of its windows, for example context_m=(0.3, 0.75, 1.5, 3.0)"
            )
        object.__setattr__(self, "methods", checked)
        object.__setattr__(self, "features", as_features(self.features))

    def fit(
        self,
        maps: Sequence[LabelledMap],
        *,
        n_threads: int | None = None,
        progress: Progress | None = None,
    ) -> Self:
        """A fitted labeler: the list first, then every method that learns, on the same maps.

        Raises
        ------
        LabelError
            A label has no example in any map.
        InputError
            The maps have different resolutions; structured weights do not carry over.
        """
        from dataclasses import replace

        progress = progress or Silent()
        maps = list(maps)
        require_examples(maps, tuple(self.label_names))
        resolution_m = _common_resolution(maps)
        unary_model, scores = fit_unary(
            maps,
            len(self.label_names),
            sensor=self.sensor,
            classifier=self.classifier or _default_classifier(),
            n_node_features=self.n_node_features,
            max_examples_per_map=self.max_examples_per_map,
            context_m=self.context_m,
            learn_on=self.learn_on,
            n_folds=self.n_folds,
            features=tuple(self.features),
            n_threads=n_threads,
            progress=progress,
        )
        graphs = [item.graph(connectivity=self.connectivity, labelled_only=True) for item in maps]
        truths = [item.truth(graph) for item, graph in zip(maps, graphs, strict=True)]
        fitted = {}
        for name, method in self.methods.items():
            if isinstance(method.backend, Learnable):
                problems = [
                    self._problem(graph, part, method.unary)
                    for graph, part in zip(graphs, scores, strict=True)
                ]
                with progress.stage(f"learning {name}") as stage:
                    start = time.perf_counter()
                    backend = _fitted(method.backend, problems, truths, stage)
                    seconds = time.perf_counter() - start
                method = PlaceMethod(backend, method.unary, seconds)
            fitted[name] = method
        movement = None
        try:
            laser = [part.laser for part in scores]
            movement = learn_movement(maps, truths, laser, len(self.label_names))
        except InputError as error:  # labels too sparse to drive from one to the next
            progress.warn(f"this model will label maps, but no trajectories: {error}")
        return replace(
            self,
            methods=fitted,
            unary_model=unary_model,
            resolution_m=resolution_m,
            movement=movement,
        )

    def scores(
        self,
        grid: OccupancyGrid,
        *,
        mask: ArrayLike | None = None,
        methods: Sequence[str] | None = None,
        n_threads: int | None = None,
        progress: Progress | None = None,
    ) -> tuple[LabelGraph, CellScores]:
        """The graph of the map's free cells (inside ``mask``) and what the lists say of each.

        Only what the methods want is computed.
        """
        if self.unary_model is None:
            raise NotFittedError("this PlaceLabeler has not learned yet; call fit(maps) first")
        chosen = [self.method(name) for name in (methods or self.methods)]
        graph = LabelGraph.from_grid(grid, connectivity=self.connectivity, mask=mask)
        scores = self.unary_model.scores(
            grid,
            graph,
            with_context=any(method.unary == "context" for method in chosen),
            with_node_features=any(uses_node_features(method.backend) for method in chosen),
            n_threads=n_threads,
            progress=progress,
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
        graph, scores = self.scores(
            grid, mask=mask, methods=[name], n_threads=n_threads, progress=progress
        )
        return self._problem(graph, scores, self.method(name).unary)

    def label(
        self,
        grid: OccupancyGrid,
        *,
        method: str | None = None,
        mask: ArrayLike | None = None,
        n_threads: int | None = None,
        progress: Progress | None = None,
    ) -> Labeling:
        """The labels of the map's free cells, in the node order of ``LabelGraph.from_grid``."""
        problem = self.problem(
            grid, method=method, mask=mask, n_threads=n_threads, progress=progress
        )
        found: Labeling = self.method(method).backend.infer(problem)
        return found

    def infer(
        self,
        graph: LabelGraph,
        scores: CellScores,
        method: str,
        *,
        truth: ArrayLike | None = None,
    ) -> Labeling:
        """What a method makes of scores that are already there.

        With ``truth`` (N,), true labels or -1, methods that follow their accuracy add it to their
        history; the labels are the same.
        """
        chosen = self.method(method)
        problem = self._problem(graph, scores, chosen.unary)
        options = {}
        if truth is not None and self.follows_truth(method):
            options["truth"] = truth
        found: Labeling = chosen.backend.infer(problem, **options)
        return found

    def follows_truth(self, method: str) -> bool:
        """Whether a method can tell its accuracy after each iteration."""
        return "truth" in inspect.signature(self.method(method).backend.infer).parameters

    def method(self, name: str | None) -> PlaceMethod:
        """The method of that name, the default one for None."""
        name = name or self.default_method
        if name not in self.methods:
            raise ConfigError(
                f"this model has no method {name!r}. {nearest_name(name, list(self.methods))}"
            )
        found: PlaceMethod = self.methods[name]
        return found

    @property
    def default_method(self) -> str:
        """The last method, which is what :meth:`label` uses when none is named."""
        return list(self.methods)[-1]

    def _problem(self, graph: LabelGraph, scores: CellScores, unary: str) -> LabelingProblem:
        values = scores.laser if unary == "laser" else scores.context
        if values is None:
            raise InputError("the scores hold no context; compute them with with_context=True")
        return LabelingProblem(
            graph,
            self.label_names,
            unary=values,
            node_features=(
                None
                if scores.node_features is None
                else sealed(np.asarray(scores.node_features, np.float64))
            ),
        )


def _default_classifier() -> "DecisionListClassifier":
    from pgm_places.models.decision_list import DecisionListClassifier

    return DecisionListClassifier(order=RAREST_FIRST, prior_weight=PRIOR_WEIGHT)


def _fitted(
    backend: Any,
    problems: Sequence[LabelingProblem],
    truths: Sequence[NDArray[np.int64]],
    stage: Stage,
) -> Any:
    """The fitted backend; one that reports its iterations is shown to do so."""
    if "on_iteration" not in inspect.signature(backend.fit).parameters:
        return backend.fit(problems, truths)

    def show(step: Any) -> None:
        gap = max(float(step.gap), 1e-6)
        # Learners close the gap about geometrically: show its logarithm, down to 0.1 %.
        fraction = min(max(-math.log10(gap) / 3, 0.0), 1.0)
        stage.update(fraction, f"gap {100 * gap:.2g} %, {step.n_cuts} cuts")

    return backend.fit(problems, truths, on_iteration=show)


def _as_method(method: Any) -> PlaceMethod:
    if isinstance(method, PlaceMethod):
        return method
    if isinstance(method, str):
        return PlaceMethod(build(method))
    if isinstance(method, Backend):
        return PlaceMethod(method)
    raise ConfigError(
        f"a method must be a PlaceMethod, a backend or a method's name, got {method!r}"
    )


def _common_resolution(maps: Sequence[LabelledMap]) -> float:
    sizes: NDArray[np.float64] = np.array([item.grid.resolution_m for item in maps])
    if not np.allclose(sizes, sizes[0], rtol=1e-3, atol=0.0):
        listed = ", ".join(f"{item.name} {item.grid.resolution_m:g} m" for item in maps)
        raise InputError(
            f"training maps must have one resolution, got {listed}; "
            "set resolution_m to coarsen them"
        )
    return float(sizes[0])
