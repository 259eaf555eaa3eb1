"""Tracking: the belief over a robot's place scan by scan, and tracked trajectories."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pgm_places.errors import InputError
from pgm_places.inference.labeling import Labeling, Status
from pgm_places.labelers.map_prior import MapPrior, PositionPrior
from pgm_places.maps.occupancy_grid import UNKNOWN, OccupancyGrid
from pgm_places.models.hmm import HiddenMarkovModel
from pgm_places.sensing.local_map import LocalMap
from pgm_places.trajectories.path import DistanceTrigger
from pgm_places.trajectories.scan import Scan, ScanGeometry
from pgm_places.trajectories.trajectory import Trajectory
from pgm_places.unary.floor_model import FloorModel
from pgm_places.unary.local_features import with_local_floor
from pgm_places.unary.scan_model import ScanModel, ScanObserver, ScanScorer


class BeliefFilter:
    """A hidden Markov filter whose observations are segments of length ``every_m`` (m).

    The observation of a segment is the mean of the list's probabilities so far. It updates the
    belief at the end of the previous segment. So a robot that stands still does not count the same
    evidence repeatedly, and the belief is up to date after every scan. Probabilities of
    ``map_prior`` are averaged over a segment.
    """

    def __init__(
        self, model: HiddenMarkovModel, every_m: float, map_prior: PositionPrior | None = None
    ) -> None:
        self._model, self._map_prior = model, map_prior
        self._gate = DistanceTrigger(every_m)
        self._before: Any = None  # the model's state at the end of the previous segment
        self._state: Any = None
        self._sum: NDArray[np.float64] | None = None
        self._map_sum: NDArray[np.float64] | None = None
        self._count, self._map_count = 0, 0
        self._moved_m = float("inf")

    def use_map(self, map_prior: PositionPrior | None) -> None:
        """Use another labelled map from the next step on, for instance after an update of the map.

        Probabilities of the previous map are discarded for the current segment, not for earlier
        ones.
        """
        self._map_prior, self._map_count = map_prior, 0
        if self._map_sum is not None:
            self._map_sum = np.zeros_like(self._map_sum)

    def step(self, x: float, y: float, log_z: NDArray[np.float64]) -> NDArray[np.float64]:
        """(K,) belief after a scan at (x, y) (m) with log-probabilities ``log_z`` (K,).

        NaN means no observation.
        """
        return self._step(x, y, log_z)[0]

    def _step(
        self, x: float, y: float, log_z: NDArray[np.float64]
    ) -> tuple[NDArray[np.float64], bool]:
        moved = self._gate.opens(x, y)
        if moved is not None:
            self._before, self._moved_m = self._state, moved
            self._sum, self._count = np.zeros(len(log_z)), 0
            self._map_sum, self._map_count = np.zeros(len(log_z)), 0
        assert self._sum is not None  # the first step opens a segment
        if not np.isnan(log_z).all():
            self._sum = self._sum + np.exp(log_z)
            self._count += 1
        with np.errstate(divide="ignore", invalid="ignore"):
            mean = np.log(self._sum / self._count)
        further = None
        if self._map_prior is not None:
            self._map_sum = self._map_sum + self._map_prior.at([[x, y]])[0]
            self._map_count += 1
            further = self._map_prior.log_likelihood(self._map_sum / self._map_count)
        belief, self._state, possible = self._model.advance(
            mean, self._before, moved_m=self._moved_m, further=further
        )
        return belief, possible

    def choose(self, belief: NDArray[np.float64]) -> int:
        """The index of the label chosen for a belief (K,)."""
        return int(self._model.choose(belief[None])[0])

    def run(self, poses: NDArray[np.float64], scores: NDArray[np.float64]) -> Labeling:
        """Labels and beliefs along a trajectory: poses (T, 3) and log z (T, K)."""
        beliefs, possible = np.empty(scores.shape), np.empty(len(scores), np.bool_)
        for t, ((x, y), row) in enumerate(zip(poses[:, :2].tolist(), scores, strict=True)):
            beliefs[t], possible[t] = self._step(x, y, row)
        info = {"impossible": np.flatnonzero(~possible).tolist()}
        labels = self._model.choose(beliefs)
        return Labeling(labels, Status.CONVERGED, beliefs=beliefs, info=info)


def filter_of(labeler: Any, map_prior: MapPrior | None = None) -> BeliefFilter:
    """The filter of a fitted TrajectoryLabeler with a hidden Markov model as method."""
    if not isinstance(labeler.method_, HiddenMarkovModel):
        raise InputError(
            f"{type(labeler.method_).__name__} labels complete trajectories; online labelling "
            "needs the method 'hmm'"
        )
    if map_prior is not None:
        map_prior.check_labels(labeler.label_names_)
    return BeliefFilter(labeler.method_, labeler.update_m, map_prior)


class OnlineLabeler:
    """Labels the scans of one robot online; made by :meth:`TrajectoryLabeler.online`.

    Attributes
    ----------
    label_names : tuple of K str
        The columns of beliefs.
    n_steps : int
        Number of scans so far.
    """

    def __init__(
        self,
        model: ScanModel,
        observer: ScanObserver,
        belief_filter: BeliefFilter,
        label_names: tuple[str, ...],
        floor: FloorModel | None = None,
    ) -> None:
        self._scorer, self._observer, self._filter = ScanScorer(model), observer, belief_filter
        self.label_names, self._floor = label_names, floor
        self.n_steps = 0

    def choose(self, belief: NDArray[np.float64]) -> int:
        """The index of the label chosen for a belief (K,)."""
        return self._filter.choose(belief)

    def use_map(self, map_prior: PositionPrior | None) -> None:
        """Use another labelled map, in the frame of the poses, from the next scan on."""
        self._filter.use_map(map_prior)

    def step(
        self, scan: Scan, pose: ArrayLike | None = None, *, extra: ArrayLike | None = None
    ) -> NDArray[np.float64]:
        """(K,) probability of each label after a further scan of the labeler's laser.

        Parameters
        ----------
        scan : Scan
        pose : (3,) float, optional
            x, y in metres and heading in radians, instead of the scan's pose.
        extra : (D,) float, optional
            Additional feature columns, if the model was trained with any.

        Raises
        ------
        InputError
            The scan has other beams.
        """
        if scan.geometry is not self._observer.geometry and not scan.geometry.same_as(
            self._observer.geometry
        ):
            raise InputError(
                f"this labeler was made for {self._observer.geometry}, but the scan has "
                f"{scan.geometry}; make another with online(scan.geometry)"
            )
        where = scan.pose if pose is None else np.asarray(pose, np.float64)
        view = self._observer.add(where, scan.ranges_m)
        log_z = self._scorer.log_proba(view.circles_m, extra, view.spaces)
        if self._floor is not None and view.floor is not None:
            log_z = with_local_floor(log_z, view.floor, self._floor)
        self.n_steps += 1
        return self._filter.step(float(where[0]), float(where[1]), log_z)


# Longer readings are not drawn in a map of scans, to limit its size.
DRAWN_M = 15.0

# Most cells along a side of a map of scans; a longer path is drawn with larger cells.
DRAWN_CELLS = 3000


@dataclass(frozen=True)
class Visit:
    """Consecutive steps with one label; the length is the distance to the step after the last."""

    label: int
    first: int
    last: int
    length_m: float

    @property
    def n_steps(self) -> int:
        """Number of steps."""
        return self.last - self.first + 1


@dataclass(frozen=True, eq=False)
class Track:
    """A trajectory, which may have true labels of the same names, and its labelling."""

    trajectory: Trajectory
    labeling: Labeling
    label_names: tuple[str, ...]
    warnings: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        if len(self.labeling.labels) != len(self.trajectory):
            raise InputError(
                f"{self.trajectory.name} has {len(self.trajectory)} steps, but there are "
                f"{len(self.labeling.labels)} labels"
            )

    @property
    def truth(self) -> NDArray[np.int64] | None:
        """(T,) the true labels, if the trajectory has labels of the same names."""
        if self.trajectory.label_names != self.label_names:
            return None
        return self.trajectory.labels

    @property
    def accuracy(self) -> float | None:
        """Share of correct labels among steps with a true label; None without such steps."""
        truth = self.truth
        if truth is None or not (known := truth >= 0).any():
            return None
        return float((self.labeling.labels[known] == truth[known]).mean())

    def visits(self) -> Iterator[Visit]:
        """The visits, in order."""
        labels = self.labeling.labels
        if not len(labels):
            return
        distance = np.concatenate([[0.0], np.cumsum(self.trajectory.step_lengths_m)])
        starts = np.concatenate([[0], np.flatnonzero(np.diff(labels)) + 1])
        ends = np.append(starts[1:], len(labels))
        for first, end in zip(starts.tolist(), ends.tolist(), strict=True):
            length = distance[min(end, len(labels) - 1)] - distance[first]
            yield Visit(int(labels[first]), first, end - 1, float(length))

    def totals(self) -> list[tuple[str, int, int, float]]:
        """The name, visits, steps and metres of each label."""
        of_label: list[list[Visit]] = [[] for _ in self.label_names]
        for visit in self.visits():
            of_label[visit.label].append(visit)
        return [
            (name, len(visits), sum(v.n_steps for v in visits), sum(v.length_m for v in visits))
            for name, visits in zip(self.label_names, of_label, strict=True)
        ]


def map_of_scans(trajectory: Trajectory, *, resolution_m: float = 0.05) -> OccupancyGrid:
    """A map of the scans, in the frame of the poses; without scans, all cells are unknown."""
    if not len(trajectory):
        return OccupancyGrid(np.full((8, 8), UNKNOWN, np.int8), resolution_m)
    path_map = PathMap(trajectory.poses[:, :2], resolution_m=resolution_m)
    if trajectory.ranges_m is not None and trajectory.geometry is not None:
        for pose, row in zip(trajectory.poses, trajectory.ranges_m, strict=True):
            path_map.add(pose, row, trajectory.geometry)
    return path_map.grid()


class PathMap:
    """A map drawn scan by scan for a path (T, 2); a long path has larger cells."""

    def __init__(self, path_xy_m: NDArray[np.float64], *, resolution_m: float = 0.05) -> None:
        low, high = path_xy_m.min(axis=0), path_xy_m.max(axis=0)
        side = float((high - low).max()) + 2 * DRAWN_M
        cell = max(resolution_m, side / DRAWN_CELLS)
        self._map = LocalMap(side, cell, robot_radius_m=0.0)
        middle: Sequence[float] = [*(0.5 * (low + high)), 0.0]
        # Centre the window on the path once; scans do not move it.
        self._map.update(middle, [np.nan], [0.0], max_range_m=1.0)

    def add(
        self, pose: NDArray[np.float64], ranges_m: NDArray[np.float32], geometry: ScanGeometry
    ) -> None:
        """Draw a scan (M,) taken at a pose (3,)."""
        ranges = np.where(geometry.returned(ranges_m), ranges_m, np.nan)
        self._map.write(pose, ranges, geometry.angles_rad, max_range_m=DRAWN_M)

    def grid(self) -> OccupancyGrid:
        """The map drawn so far."""
        return self._map.to_grid()
