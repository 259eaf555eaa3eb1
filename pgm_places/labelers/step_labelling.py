"""The labelling of trajectories by what a TrajectoryLabeler has learned, whole or step by step."""

from dataclasses import replace
from typing import Any, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pgm_places.errors import InputError
from pgm_places.inference.labeling import Labeling
from pgm_places.inference.problem import LabelingProblem
from pgm_places.kernels.threads import threads
from pgm_places.labelers.labeler import Labeler
from pgm_places.labelers.map_prior import MapPrior
from pgm_places.labelers.method import infer, infer_further
from pgm_places.labelers.online import BeliefFilter, OnlineLabeler
from pgm_places.labelers.trajectory_learning import loops_for, segment_problem
from pgm_places.maps.occupancy_grid import OccupancyGrid
from pgm_places.models.hmm import HiddenMarkovModel
from pgm_places.progress import Progress, reported, staged
from pgm_places.trajectories.scan import ScanGeometry
from pgm_places.trajectories.segments import Segments
from pgm_places.trajectories.trajectory import Trajectory
from pgm_places.unary.floor_model import FloorModel, with_local_floor
from pgm_places.unary.scan_model import BeamOptions, ScanModel, observed_along


class StepLabelling(Labeler):
    """What :class:`~pgm_places.labelers.trajectory_labeler.TrajectoryLabeler` does once fitted."""

    every_m: float
    loop_m: float
    beams: BeamOptions
    floor: FloorModel | None
    scan_model_: ScanModel
    method_: Any

    def online(
        self,
        geometry: ScanGeometry,
        *,
        known_map: OccupancyGrid | None = None,
        map_prior: MapPrior | None = None,
    ) -> OnlineLabeler:
        """A fresh labeler for one robot with that laser: ``step(scan) -> belief``.

        Raises
        ------
        InputError
            The method is no hidden Markov model, which alone works step by step.
        NotFittedError
            Before :meth:`fit`.
        """
        self.check_fitted()
        observer = self.beams.observer(geometry, self.scan_model_.sensor, known_map, self.floor)
        belief_filter = self._filter(map_prior)
        return OnlineLabeler(
            self.scan_model_, observer, belief_filter, self.label_names_, self.floor
        )

    def scores(
        self,
        trajectory: Trajectory,
        *,
        known_map: OccupancyGrid | None = None,
        extra: ArrayLike | None = None,
        n_threads: int | None = None,
        progress: Progress | None = None,
    ) -> NDArray[np.float64]:
        """(T, K) log z of each step by itself: what the list, and the networks, say of it."""
        self.check_fitted()
        model, beams, floor = self.scan_model_, self.beams, self.floor
        with threads(n_threads), reported(progress), staged("scans, features and list"):
            seen = observed_along(trajectory, model.sensor, beams, known_map=known_map, floor=floor)
            log_z = model.log_proba(seen.circles_m, extra, spaces=seen.spaces)
        if floor is None or seen.floor is None:
            return log_z
        return with_local_floor(log_z, seen.floor, floor)

    def label(
        self,
        trajectory: Trajectory,
        *,
        known_map: OccupancyGrid | None = None,
        map_prior: MapPrior | None = None,
        extra: ArrayLike | None = None,
        truth: ArrayLike | None = None,
        n_threads: int | None = None,
        progress: Progress | None = None,
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
        map_prior : MapPrior, optional
            A labelled map in the frame of the poses, whose labels count as further observations.
        extra : (T, D) float, optional
            The columns in addition to the laser's that the model was trained with.
        truth, n_threads, progress
            As for every labeler: see :mod:`pgm_places.labelers.labeler`.
        """
        scores = self.scores(
            trajectory, known_map=known_map, extra=extra, n_threads=n_threads, progress=progress
        )
        return self.infer(trajectory, scores, map_prior=map_prior, truth=truth)

    def infer(
        self,
        trajectory: Trajectory,
        scores: NDArray[np.float64],
        *,
        map_prior: MapPrior | None = None,
        truth: ArrayLike | None = None,
    ) -> Labeling:
        """The method's labelling of given scores (T, K)."""
        self.check_fitted()
        if isinstance(self.method_, HiddenMarkovModel) and self.method_.mode == "filter":
            return self._filter(map_prior).run(trajectory.poses, scores)
        segments = Segments(trajectory.poses, self.every_m)
        if truth is not None:
            truth = segments.majority(truth, len(self.label_names_))
        problem = self.problem(segments, scores)
        if map_prior is None:
            labeling = infer(self.method_, problem, truth)
        else:
            map_prior.check_labels(self.label_names_)
            means = segments.means(map_prior.at(trajectory.poses[:, :2]))
            labeling = infer_further(self.method_, problem, map_prior.log_likelihood(means), truth)
        beliefs = None if labeling.beliefs is None else labeling.beliefs[segments.of_step]
        return replace(labeling, labels=labeling.labels[segments.of_step], beliefs=beliefs)

    def problem(self, segments: Segments, scores: NDArray[np.float64]) -> LabelingProblem:
        """The graph of a trajectory's segments with the mean scores of their steps."""
        self.check_fitted()
        return segment_problem(
            segments, scores, self.label_names_, loop_m=loops_for(self.method_, self.loop_m)
        )

    def updated_every(self, every_m: float) -> tuple[Self, float]:
        """A fitted copy for another distance between updates, its transitions rescaled.

        The second result is how far a probability had to be changed for that: see
        :meth:`HiddenMarkovModel.rescaled <pgm_places.models.hmm.HiddenMarkovModel.rescaled>`. Other
        methods stay as they are.

        Raises
        ------
        InputError
            The transitions cannot be had for such a distance, or the distance is not a number above
            0.
        """
        self.check_fitted()
        other, changed = self.with_options(every_m=every_m), 0.0
        if isinstance(self.method_, HiddenMarkovModel) and every_m != self.every_m:
            if not (every_m > 0 and self.every_m > 0):
                raise InputError(
                    f"transitions for updates every {self.every_m:g} m cannot be rescaled to every "
                    f"{every_m:g} m; train the model at this distance"
                )
            other.method_, changed = self.method_.rescaled(self.every_m, every_m)
        return other, changed

    def _filter(self, map_prior: MapPrior | None = None) -> BeliefFilter:
        if not isinstance(self.method_, HiddenMarkovModel):
            raise InputError(
                f"{type(self.method_).__name__} labels whole trajectories; online labelling needs "
                "the method 'hmm'"
            )
        if map_prior is not None:
            map_prior.check_labels(self.label_names_)
        return BeliefFilter(self.method_, self.every_m, map_prior)
