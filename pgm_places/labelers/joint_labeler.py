"""JointLabeler: labels a map together with a drive through it, as one graph."""

from __future__ import annotations

import copy
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, ClassVar, Literal, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pgm_places._arguments import public_options
from pgm_places.errors import ConfigError, InputError
from pgm_places.evaluation.evaluation import evaluate
from pgm_places.graph.label_graph import LabelGraph
from pgm_places.inference.backends import METHODS, Learnable
from pgm_places.kernels.threads import thread_limit
from pgm_places.labelers import method as method_use
from pgm_places.labelers.joint_graph import JointGraph, JointLabeling, JointScores
from pgm_places.labelers.labeler import Labeler
from pgm_places.labelers.place_labeler import PlaceLabeler
from pgm_places.labelers.place_problem import accepted_doorways
from pgm_places.labelers.trajectory_labeler import TrajectoryLabeler
from pgm_places.labelers.trajectory_learning import learn_labelers
from pgm_places.maps.labelled_map import LabelledMap
from pgm_places.maps.occupancy_grid import OccupancyGrid
from pgm_places.options import Positive
from pgm_places.progress import Progress, reporting_to
from pgm_places.trajectories.trajectory import MappedDrive, Trajectory

LINK_WEIGHTS = (0.5, 1.0, 2.0, 4.0, 8.0, 16.0)
"""Candidate weights of links, relative to all other edges."""


@public_options
@dataclass(eq=False, repr=False)
class JointLabeler(Labeler):
    """Learns places from labelled maps and drives, and labels both together.

    The cells of the map and the steps of the drive are nodes of one graph. Edges join neighbouring
    cells, successive steps, steps at the same spot, and each step with the cell under it. Steps
    thus use the scores of the map, and cells the scans of the robot.

    Parameters
    ----------
    label_names : sequence of K str
        The places to distinguish.
    method : Backend or str
        A method of :mod:`pgm_places.inference.backends` for graphs with cycles, or its name. An
        associative Markov network learns a weight for each kind of edge.
    link_weight : float or "fitted"
        For methods with fixed edge weights (``potts``): weight of a link between a step and its
        cell, relative to all other edges. ``"fitted"`` selects the best one on held-out scores of
        the training drives.
    places : PlaceLabeler, optional
        Unfitted labeler whose lists score cells; its methods are not used.
    steps : TrajectoryLabeler, optional
        Unfitted labeler whose list scores scans, with the options of segments and beams; its method
        is not used.

    Attributes
    ----------
    label_names_ : tuple of K str
        The labels that were learned.
    places_, steps_ : PlaceLabeler, TrajectoryLabeler
        The fitted labelers of cells and steps.
    method_ : Backend
        The fitted method.
    link_weight_ : float or None
        The weight of links; None for methods that learn their own or have none.
    learn_seconds_ : float
        Training time of the method (s); absent from a stored model.

    Examples
    --------
    >>> from pgm_places.simulation import generate_building
    >>> from pgm_places.simulation.simulated_robot import SimulatedRobot
    >>> building = generate_building(size="small")
    >>> known = LabelledMap(building.grid, building.labels)
    >>> drive = SimulatedRobot().explore(building.grid, max_length_m=15.0)
    >>> drive = drive.labelled_by(known, building.label_names)
    >>> labeler = JointLabeler(building.label_names).fit([MappedDrive(known, drive)])
    >>> labeling = labeler.label(building.grid, drive)
    >>> len(labeling.steps.labels) == len(drive)
    True
    """

    label_names: Sequence[str]
    method: Any = "potts"
    link_weight: Positive | Literal["fitted"] = "fitted"
    places: PlaceLabeler | None = None
    steps: TrajectoryLabeler | None = None

    places_: PlaceLabeler = field(init=False)
    steps_: TrajectoryLabeler = field(init=False)
    method_: Any = field(init=False)
    link_weight_: float | None = field(init=False)
    learn_seconds_: float = field(init=False)

    stored_as: ClassVar[str] = "joint-labeler"
    _call_first: ClassVar[str] = "fit(drives)"

    def check_options(self) -> None:
        """Check the options, as :meth:`fit` does first.

        ConfigError for an invalid option, a method for chains, or ``places`` or ``steps`` with
        other labels.
        """
        super().check_options()
        method_use.check_labels_maps("the method", method_use.as_backend(self.method))
        for name in ("places", "steps"):
            inner = getattr(self, name)
            if inner is not None and tuple(inner.label_names) != tuple(self.label_names):
                raise ConfigError(
                    f"{name} must have the labels {', '.join(self.label_names)}, got "
                    f"{', '.join(inner.label_names)}"
                )

    # ------------------------------------------------------------------ learning

    def fit(
        self,
        drives: Sequence[MappedDrive],
        maps: Sequence[LabelledMap] = (),
        *,
        n_threads: int | None = None,
        progress: Progress | None = None,
    ) -> Self:
        """Fit both lists, then the method on their held-out scores; returns the labeler itself.

        Parameters
        ----------
        drives : sequence of MappedDrive
            Labelled drives with their labelled maps; one map may serve several drives.
        maps : sequence of LabelledMap
            Further labelled maps without a drive.
        n_threads, progress
            See :mod:`pgm_places.labelers.labeler`.

        Raises
        ------
        ConfigError
            An option is invalid.
        InputError
            There is no drive, or maps have different resolutions.
        LabelError
            A label has no example.
        """
        self.fit_methods({"": self.method}, drives, maps, n_threads=n_threads, progress=progress)
        return self

    def fit_methods(
        self,
        methods: Mapping[str, Any],
        drives: Sequence[MappedDrive],
        maps: Sequence[LabelledMap] = (),
        *,
        n_threads: int | None = None,
        progress: Progress | None = None,
    ) -> dict[str, Self]:
        """Fit several methods by name on the scores of shared lists, as :meth:`fit`.

        Returns a labeler per method; the labeler itself gets the last of the methods.
        """
        self.check_options()
        methods = {name: method_use.as_backend(method) for name, method in methods.items()}
        for name, method in methods.items():
            method_use.check_labels_maps(f"method {name!r}" if name else "the method", method)
        if not drives:
            raise InputError("learning cells and steps together needs at least one labelled drive")
        all_maps = list({id(item): item for item in (*(d.map for d in drives), *maps)}.values())
        places, steps = self._parts()
        paths = [replace(item.drive, building=item.building) for item in drives]
        grids = [item.map.grid for item in drives]
        with thread_limit(n_threads), reporting_to(progress):
            unary = places.learn(all_maps, with_scores=True)
            _, of_steps = learn_labelers(steps, {"": steps.method}, all_maps, paths, None, grids)
            assert unary.scores is not None  # because of with_scores
            of_cells = [scores.of(places.method().unary) for scores in unary.scores]
            examples = _examples(places, steps, drives, all_maps, of_cells, of_steps)
            return self.set_learned_with(
                methods,
                lambda method: {
                    **self._learned(method, *zip(*examples, strict=True)),
                    "places_": places,
                    "steps_": steps,
                    "label_names_": tuple(self.label_names),
                },
            )

    def _learned(
        self, method: Any, scores: Sequence[JointScores], truths: Sequence[NDArray[np.int64]]
    ) -> dict[str, Any]:
        """The fitted method, and the weight of links for methods with fixed edge weights."""
        names, weight = tuple(self.label_names), None
        if isinstance(method, Learnable):
            problems = [example.problem(names, None) for example in scores]
            method = method_use.with_edge_kinds(method).fit(problems, truths)
        elif hasattr(method, "edge_weights"):
            method = replace(method, edge_weights="given")
            weight = self._link_weight(method, scores, np.concatenate(truths))
        return {"method_": method, "link_weight_": weight}

    def _parts(self) -> tuple[PlaceLabeler, TrajectoryLabeler]:
        """The unfitted labelers of cells and of steps, each with the simplest method."""
        from sklearn.base import clone

        names = tuple(self.label_names)
        places = clone(self.places or PlaceLabeler(names))
        steps = clone(self.steps or TrajectoryLabeler(names))
        if len(places.resolved_methods()) != 1:
            places.set_params(methods=("independent",))
        return places, steps.set_params(method="independent")

    def _link_weight(
        self, method: Any, scores: Sequence[JointScores], truth: NDArray[np.int64]
    ) -> float:
        """The fixed weight, or the one with the best balanced accuracy on held-out scores."""
        if self.link_weight != "fitted":
            return float(self.link_weight)
        names = tuple(self.label_names)

        def accuracy(weight: float) -> float:
            labels = [method.infer(example.problem(names, weight)).labels for example in scores]
            return evaluate(truth, np.concatenate(labels), names).balanced_accuracy

        return max(LINK_WEIGHTS, key=accuracy)

    # ------------------------------------------------------------------ labelling

    def scores(
        self,
        grid: OccupancyGrid | None = None,
        drive: Trajectory | None = None,
        *,
        mask: ArrayLike | None = None,
        n_threads: int | None = None,
        progress: Progress | None = None,
    ) -> JointScores:
        """The joint graph, and the scores of its nodes before inference.

        Scores of cells are the unary of the place labeler: with doorways at gates and consistent
        labels within spaces, if its lists use space features.
        """
        self.check_fitted()
        cells = cell_scores = step_scores = doorways = None
        with thread_limit(n_threads), reporting_to(progress):
            if grid is not None:
                places = self.places_
                cells, unary = places.scores(grid, mask=mask)
                cell_scores = places.problem_of(cells, unary, places.method()).unary
                doorways = accepted_doorways(places.unary_model_, grid, unary)
            if drive is not None:
                step_scores = self.steps_.scores(drive, known_map=grid)
        graph = _joint_graph(self.steps_, cells, grid, drive)
        return JointScores(graph, cell_scores, step_scores, doorways)

    def infer(self, scores: JointScores, *, truth: ArrayLike | None = None) -> JointLabeling:
        """The method's labelling of given scores; ``truth`` has a label for each node."""
        self.check_fitted()
        problem = scores.problem(self.label_names_, self.link_weight_)
        return scores.graph.split(method_use.infer(self.method_, problem, truth))

    def label(
        self,
        grid: OccupancyGrid | None = None,
        drive: Trajectory | None = None,
        *,
        mask: ArrayLike | None = None,
        n_threads: int | None = None,
        progress: Progress | None = None,
    ) -> JointLabeling:
        """Labels for the cells of a map, the steps of a drive, or both together.

        Parameters
        ----------
        grid : OccupancyGrid, optional
            The map, in the frame of the drive's poses.
        drive : Trajectory, optional
            With scans, or without them if there is a map to cast them in.
        mask, n_threads, progress
            See :mod:`pgm_places.labelers.labeler`.

        Raises
        ------
        InputError
            There is neither a map nor a drive, or no step is on a free cell of the map.
        NotFittedError
            Before :meth:`fit`.
        """
        with thread_limit(n_threads), reporting_to(progress):
            return self.infer(self.scores(grid, drive, mask=mask))

    @property
    def choices(self) -> dict[str, str]:
        """The options chosen on training data, with a text each."""
        return self.places_.choices if hasattr(self, "places_") else {}

    def with_steps(self, **options: Any) -> Self:
        """A fitted copy with other options of ``steps``, such as ``every_m``."""
        self.check_fitted()
        other = copy.copy(self)
        other.steps_ = self.steps_.with_options(**options)
        return other

    def of_maps(self) -> PlaceLabeler:
        """A fitted PlaceLabeler with the same list and method, for maps without a drive."""
        self.check_fitted()
        backend = self.method_
        if self.link_weight_ is not None:  # without links, all edges have the same weight
            backend = replace(backend, edge_weights="equal")
        name, unary = METHODS.name_of(type(backend)), self.places_.method().unary
        places = copy.copy(self.places_)
        places.methods = {name: method_use.PlaceMethod(method_use.unfitted(backend), unary)}
        places.methods_ = {name: method_use.PlaceMethod(backend, unary)}
        return places


def _joint_graph(
    steps: TrajectoryLabeler,
    cells: LabelGraph | None,
    grid: OccupancyGrid | None,
    drive: Trajectory | None,
) -> JointGraph:
    return JointGraph.of(cells, grid, drive, every_m=steps.update_m, loop_m=steps.loop_m)


def _examples(
    places: PlaceLabeler,
    steps: TrajectoryLabeler,
    drives: Sequence[MappedDrive],
    maps: Sequence[LabelledMap],
    of_cells: Sequence[NDArray[np.float64]],
    of_steps: Sequence[NDArray[np.float64]],
) -> list[tuple[JointScores, NDArray[np.int64]]]:
    """Scores and true labels of the labelled nodes per drive with its map, then of other maps."""
    scores_of = {id(map_): scores for map_, scores in zip(maps, of_cells, strict=True)}
    driven = {id(item.map) for item in drives}
    items: list[tuple[LabelledMap, Trajectory | None, NDArray[np.float64] | None]] = []
    for item, scores in zip(drives, of_steps, strict=True):
        assert item.drive.labels is not None  # checked when the list was trained
        items.append((item.map, item.drive.subset(item.drive.labels >= 0), scores))
    items += [(map_, None, None) for map_ in maps if id(map_) not in driven]
    examples = []
    for map_, drive, step_scores in items:
        cells = map_.graph(connectivity=places.connectivity, labelled_only=True)
        graph = _joint_graph(steps, cells, map_.grid, drive)
        labels = None if drive is None else drive.labels
        truth = graph.truth(map_.truth(cells), labels, len(steps.label_names_))
        examples.append((JointScores(graph, scores_of[id(map_)], step_scores), truth))
    return examples
