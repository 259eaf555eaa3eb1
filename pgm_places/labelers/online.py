"""Online tracking: the belief over the robot's place, updated scan by scan."""

from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pgm_places.errors import InputError
from pgm_places.inference.labeling import Labeling, Status
from pgm_places.labelers.map_prior import MapPrior, PositionPrior
from pgm_places.models.hmm import HiddenMarkovModel
from pgm_places.trajectories.scan import Scan
from pgm_places.trajectories.segments import DistanceTrigger
from pgm_places.unary.floor_model import FloorModel, with_local_floor
from pgm_places.unary.scan_model import ScanModel, ScanObserver, ScanScorer


class BeliefFilter:
    """A hidden Markov filter whose observations are segments of length ``every_m``.

    The observation of a segment is the mean of the list's probabilities so far. It updates the
    belief at the end of the previous segment. So a robot that stands still does not count the same
    evidence repeatedly, and the belief is up to date after every scan.

    Parameters
    ----------
    model : HiddenMarkovModel
        Fitted.
    every_m : float
        Length of a segment (m).
    map_prior : MapPrior, optional
        Label probabilities at positions, from a labelled map; averaged over a segment.
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
            f"{type(labeler.method_).__name__} labels whole trajectories; online labelling needs "
            "the method 'hmm'"
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
        """(K,) probability of each label after a further scan.

        Parameters
        ----------
        scan : Scan
            From the laser that this labeler was made for.
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
