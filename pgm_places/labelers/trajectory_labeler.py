"""Label the places along a robot's trajectory, whole or step by step."""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pgm_places.errors import InputError, NotFittedError
from pgm_places.features.own import as_features
from pgm_places.inference.labeling import Labeling
from pgm_places.inference.problem import LabelingProblem
from pgm_places.labelers.online import BeliefFilter, OnlineLabeler
from pgm_places.labelers.place_labeler import PlaceLabeler
from pgm_places.maps.labelled_map import LabelledMap
from pgm_places.maps.occupancy_grid import OccupancyGrid
from pgm_places.models.hmm import HiddenMarkovModel
from pgm_places.progress import Progress
from pgm_places.sensing.sensor import Sensor
from pgm_places.trajectories.scan import ScanGeometry
from pgm_places.trajectories.segments import Segments
from pgm_places.trajectories.trajectory import Trajectory
from pgm_places.unary.scan_model import BeamOptions, ScanModel, circles_along

if TYPE_CHECKING:  # scikit-learn takes a second to import, and labelling does without it
    from pgm_places.models.decision_list import DecisionListClassifier

__all__ = ["EVERY_M", "TrajectoryLabeler"]

EVERY_M = 0.1
"""Way between two updates. The paper has 0.2 to 0.5 m; shorter ones find doorways more often."""

REACH_M = 12.0
"""Longest range of completed scans: farther away, walls seen by a laser and walls of a map differ
too much (glass, clutter, beams that are farther apart than things are wide)."""


@dataclass(frozen=True)
class TrajectoryLabeler:
    """Learns places from labelled maps and trajectories, and labels trajectories.

    Each scan is completed to the full circle, its features go through the boosted list, and the
    method, a hidden Markov model by default, takes account of the places before. The steps within
    ``every_m`` count as one observation: the mean of what the list says of them.

    Parameters
    ----------
    label_names : sequence of K str
        The places to tell apart.
    method : backend
        What labels the chain of observations: any method of :mod:`pgm_places.inference.backends`.
    every_m : float
        Distance in metres after which the robot counts as moved; 0 for every scan.
    beams : BeamOptions
        How scans are completed.
    scan_model : ScanModel or None
        Filled by :meth:`fit` and :meth:`from_places`.

    Examples
    --------
    A model that was learned on maps labels trajectories too:

    >>> from pgm_places.datasets import generate_building
    >>> building = generate_building(size="small")
    >>> known = LabelledMap(building.grid, building.labels)
    >>> places = PlaceLabeler(building.label_names).fit([known])
    >>> labeler = TrajectoryLabeler.from_places(places)
    >>> centre = building.grid.cell_centres_m(np.argwhere(building.grid.free))[:1]
    >>> path = Trajectory([0.0], np.column_stack([centre, [0.0]]))
    >>> labeler.label(path, known_map=building.grid).beliefs.shape
    (1, 3)
    """

    label_names: Sequence[str]
    method: Any = field(
        default_factory=lambda: HiddenMarkovModel(observation="soft", evidence_weight="fitted")
    )
    every_m: float = EVERY_M
    beams: BeamOptions = field(default_factory=BeamOptions)
    scan_model: ScanModel | None = field(default=None, repr=False)

    def __post_init__(self) -> None:
        object.__setattr__(self, "label_names", tuple(self.label_names))
        if not self.every_m >= 0:
            raise InputError(f"every_m must be at least 0 metres, got {self.every_m}")

    # ------------------------------------------------------------------ learning

    @classmethod
    def from_places(
        cls,
        places: PlaceLabeler,
        *,
        method: Any | None = None,
        every_m: float = EVERY_M,
        beams: BeamOptions | None = None,
    ) -> Self:
        """One that uses the list of a fitted PlaceLabeler, and what it learned of moving robots.

        Parameters
        ----------
        places : PlaceLabeler
            Fitted on labelled maps.
        method : backend, optional
            A fitted method, in place of ``places.movement``.
        every_m, beams
            As of the class.

        Raises
        ------
        NotFittedError
            ``places`` is not fitted, or was stored by a version that learned nothing of movement.
        InputError
            It has a feature of the map's cells.
        """
        unary = places.unary_model
        if unary is None:
            raise NotFittedError("this PlaceLabeler has not learned yet; call fit(maps) first")
        chosen = places.movement if method is None else method
        if chosen is None:
            raise NotFittedError(
                "this model was stored without the statistics of moving robots; train it again, or "
                "give a fitted method"
            )
        model = ScanModel(unary.classifier, unary.n_labels, unary.sensor, features=unary.features)
        return cls(places.label_names, chosen, every_m, beams or BeamOptions(), model)

    def fit(
        self,
        maps: Sequence[LabelledMap] = (),
        trajectories: Sequence[Trajectory] = (),
        *,
        extra: Sequence[ArrayLike] | None = None,
        extra_names: Sequence[str] = (),
        features: Sequence[Any] = (),
        known_map: OccupancyGrid | None = None,
        sensor: Sensor | None = None,
        classifier: "DecisionListClassifier | None" = None,
        n_folds: int = 5,
        n_runs: int = 1000,
        seed: int = 0,
        n_threads: int | None = None,
        progress: Progress | None = None,
    ) -> Self:
        """A fitted labeler: the list on cells and steps, then the method on held-out scores.

        Parameters
        ----------
        maps : sequence of LabelledMap
            Their labelled cells are examples, and simulated runs in them give the transitions.
        trajectories : sequence of Trajectory
            Their labelled steps are examples; without maps they give the transitions as well.
            Labels are indices into ``label_names``, -1 where not known.
        extra : sequence of (T, D) float, optional
            Columns beside the laser's for each trajectory; then there can be no maps.
        extra_names : sequence of D str
            Their names.
        features : sequence of features or names, optional
            Columns of your own that are computed from scans: see
            :mod:`pgm_places.features.own`.
        known_map : OccupancyGrid, optional
            The map in which missing beams are cast, where ``beams`` asks for it.
        sensor : Sensor, optional
            Beams and reach of the completed scans; 360 beams of 12 m by default.
        classifier : DecisionListClassifier, optional
            The unfitted list with its options.
        n_folds : int
            Folds that are held out once: whole buildings where maps are of several, contiguous
            parts of a single one, and of each trajectory.
        n_runs, seed : int
            Simulated runs (paper, section 5).

        Raises
        ------
        LabelError
            A label has no example.
        InputError
            There is nothing to learn from, or columns do not fit.
        """
        from pgm_places.labelers.trajectory_learning import (
            learn_trajectory_labeler,
            trajectory_examples,
        )

        sensor = sensor or Sensor(max_range_m=REACH_M)
        names, own = tuple(extra_names), as_features(features)
        examples = trajectory_examples(
            maps,
            trajectories,
            tuple(self.label_names),
            sensor=sensor,
            beams=self.beams,
            known_map=known_map,
            extra=extra,
            extra_names=names,
            features=own,
            n_folds=n_folds,
            n_threads=n_threads,
            progress=progress,
        )
        fitted = learn_trajectory_labeler(
            self,
            maps,
            trajectories,
            examples,
            sensor=sensor,
            extra_names=names,
            own_features=own,
            classifier=classifier,
            n_runs=n_runs,
            seed=seed,
            progress=progress,
        )
        return replace(self, method=fitted.method, scan_model=fitted.scan_model)

    # ------------------------------------------------------------------ labelling

    def online(
        self, geometry: ScanGeometry, *, known_map: OccupancyGrid | None = None
    ) -> OnlineLabeler:
        """A fresh labeler for one robot with that laser: ``step(scan) -> belief``.

        Raises
        ------
        InputError
            The method is no hidden Markov model, which alone works step by step.
        NotFittedError
            Before :meth:`fit`.
        """
        model = self._fitted_model()
        circle = self.beams.circle(geometry, model.sensor, known_map)
        return OnlineLabeler(model, circle, self._filter(), tuple(self.label_names))

    def scores(
        self,
        trajectory: Trajectory,
        *,
        known_map: OccupancyGrid | None = None,
        extra: ArrayLike | None = None,
        n_threads: int | None = None,
    ) -> NDArray[np.float64]:
        """(T, K) log z of each step by itself: what the list says of its scan."""
        model = self._fitted_model()
        circles = circles_along(
            trajectory, model.sensor, self.beams, known_map=known_map, n_threads=n_threads
        )
        return model.log_proba(circles, extra, n_threads=n_threads)

    def label(
        self,
        trajectory: Trajectory,
        *,
        known_map: OccupancyGrid | None = None,
        extra: ArrayLike | None = None,
        n_threads: int | None = None,
    ) -> Labeling:
        """A label for each step.

        A hidden Markov model in mode ``filter`` gives the same beliefs as :meth:`online` step by
        step; other modes and methods label whole segments, also by what comes after.

        Parameters
        ----------
        trajectory : Trajectory
            With scans, or without them if there is a known map to cast them in.
        known_map : OccupancyGrid, optional
            A map in the frame of the poses.
        extra : (T, D) float, optional
            The columns beside the laser's that the model learned with.
        """
        scores = self.scores(trajectory, known_map=known_map, extra=extra, n_threads=n_threads)
        return self.infer(trajectory, scores)

    def infer(self, trajectory: Trajectory, scores: NDArray[np.float64]) -> Labeling:
        """What the method makes of scores (T, K) that are already there."""
        if isinstance(self.method, HiddenMarkovModel) and self.method.mode == "filter":
            return self._filter().run(trajectory.poses, scores)
        segments = Segments(trajectory.poses, self.every_m)
        found: Labeling = self.method.infer(self.problem(segments, scores))
        beliefs = None if found.beliefs is None else found.beliefs[segments.of_step]
        return replace(found, labels=found.labels[segments.of_step], beliefs=beliefs)

    def problem(self, segments: Segments, scores: NDArray[np.float64]) -> LabelingProblem:
        """The chain of a trajectory's segments with the mean scores of their steps."""
        means = segments.means(np.exp(scores))
        return LabelingProblem(segments.graph(), self.label_names, unary=np.log(means))

    def _fitted_model(self) -> ScanModel:
        if self.scan_model is None:
            raise NotFittedError(
                "this TrajectoryLabeler has not learned yet; call fit, or from_places"
            )
        return self.scan_model

    def _filter(self) -> BeliefFilter:
        if not isinstance(self.method, HiddenMarkovModel):
            raise InputError(
                f"{type(self.method).__name__} labels whole trajectories; online labelling needs "
                "the method 'hmm'"
            )
        return BeliefFilter(self.method, self.every_m)
