"""What a robot sees of its surroundings, scan by scan: beams all around, and spaces."""

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pgm_places.sensing.scan_completion import ScanCompletion
from pgm_places.trajectories.scan import ScanGeometry
from pgm_places.unary.floor_model import FloorModel, LocalFloor
from pgm_places.unary.surroundings import N_SURROUNDINGS, Surroundings


class Observation(NamedTuple):
    """What is seen at one step.

    Parameters
    ----------
    circle_m : (n_beams,) float32
        Ranges all around.
    spaces : (F,) float32
        Features of the segments around, or none.
    floor : (K,) float64 or None
        Log-probabilities of the floor networks, if they look.
    """

    circle_m: NDArray[np.float32]
    spaces: NDArray[np.float32]
    floor: NDArray[np.float64] | None = None


class Observations(NamedTuple):
    """What is seen at the steps of a trajectory.

    Parameters
    ----------
    circles_m : (T, n_beams) float32
        Ranges all around.
    spaces : (T, F) float32
        Features of the segments around, or no columns.
    floor : (T, K) float64 or None
        Log-probabilities of the floor networks, if they look.
    """

    circles_m: NDArray[np.float32]
    spaces: NDArray[np.float32]
    floor: NDArray[np.float64] | None = None


class ScanObserver:
    """Completes the scans of one robot, and describes the spaces around it if asked to.

    Parameters
    ----------
    completion : ScanCompletion
        Fresh, for one robot.
    spaces_m : float
        Half the side of the square that is divided into segments, of the known map or of the
        rolling one; 0 for none.
    floor : FloorModel, optional
        Networks that look at the same map.
    """

    def __init__(
        self, completion: ScanCompletion, spaces_m: float = 0.0, floor: FloorModel | None = None
    ) -> None:
        self._completion = completion
        self._surroundings: Surroundings | None = None
        self._floor: LocalFloor | None = None
        source = completion.local_map or completion.known_map
        if spaces_m > 0:
            assert source is not None  # BeamOptions has checked
            self._surroundings = Surroundings(source, spaces_m)
        if floor is not None:
            assert source is not None  # BeamOptions has checked
            self._floor = LocalFloor(source, floor)

    @property
    def geometry(self) -> ScanGeometry:
        """The laser's beams."""
        return self._completion.geometry

    def add(self, pose: NDArray[np.float64], ranges_m: ArrayLike) -> Observation:
        """What is seen after one more scan (M,) taken at a pose (3,)."""
        circle = self._completion.add(pose, ranges_m)
        around, floor = self._surroundings, self._floor
        return Observation(
            circle,
            np.empty(0, np.float32) if around is None else around.at(pose[:2]),
            None if floor is None else floor.at(pose[:2]),
        )

    def along(self, poses: NDArray[np.float64], ranges_m: NDArray[np.float32]) -> Observations:
        """What is seen at each of the poses (T, 3) with its scan (T, M), one after the other."""
        if self._surroundings is None and self._floor is None:
            circles = self._completion.complete(poses, ranges_m)
            return Observations(circles, np.empty((len(circles), 0), np.float32))
        seen = [self.add(pose, row) for pose, row in zip(poses, ranges_m, strict=True)]
        circles = np.array([item.circle_m for item in seen], np.float32)
        spaces = np.array([item.spaces for item in seen], np.float32)
        floor = [item.floor for item in seen if item.floor is not None]
        return Observations(
            circles.reshape(len(seen), self._completion.n_beams),
            spaces.reshape(len(seen), N_SURROUNDINGS if self._surroundings else 0),
            None if self._floor is None else self._floor.rows(floor),
        )


def surroundings_along(
    source: Surroundings | None, poses: NDArray[np.float64]
) -> NDArray[np.float32]:
    """(T, F) features at the poses (T, 3) of a way; without surroundings, no columns."""
    if source is None:
        return np.empty((len(poses), 0), np.float32)
    found = np.array([source.at(pose[:2]) for pose in poses], np.float32)
    return found.reshape(len(poses), N_SURROUNDINGS)
