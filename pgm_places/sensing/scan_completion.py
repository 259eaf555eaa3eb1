"""Scan completion: extending scans of any laser to the full circle for the features."""

from dataclasses import dataclass, field
from math import pi
from typing import Literal, get_args

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pgm_places._checks import finite_array
from pgm_places.errors import ConfigError, InputError, nearest_name
from pgm_places.maps.occupancy_grid import OccupancyGrid
from pgm_places.sensing.local_map import LocalMap
from pgm_places.sensing.ray_casting import PoseCaster
from pgm_places.trajectories.scan import ScanGeometry

__all__ = ["MissingBeams", "ScanCompletion"]

MissingBeams = Literal["local-map", "known-map", "mirror", "max-range"]

SPACINGS_AWAY = 0.75
"""A beam covers a direction if it is within this number of beam spacings."""


@dataclass(eq=False)
class ScanCompletion:
    """Completes the scans of a laser, in order of time, to full-circle scans.

    The 321 features are defined on beams at ``2 pi i / n_beams`` against the heading. A direction
    in the laser's field of view gets the nearest beam; other directions, and beams without a
    return, are filled in.

    Parameters
    ----------
    geometry : ScanGeometry
        The laser's beams.
    max_range_m : float
        Longest output range, as of the sensor of the classifier's training.
    missing : {"local-map", "known-map", "mirror", "max-range"}
        The source of missing beams: a rolling map of recent scans (paper, section 4, Fig. 4); ray
        casting in a known map from the robot's pose; the front's mirror image; or the maximum
        range.
    all_from_map : bool
        Take every beam from the map, also beams that the laser has: the combined evidence of many
        scans, without passing people and glass that a single scan sees through.
    known_map : OccupancyGrid, optional
        For ``"known-map"``; in the frame of the poses.
    local_map : LocalMap, optional
        For ``"local-map"``; a default one if None.
    n_beams : int
        Number of output beams.

    Raises
    ------
    ConfigError
        An option is unknown, or a map is missing or not used.

    Examples
    --------
    >>> geometry = ScanGeometry.half_circle(181, range_max_m=30.0)
    >>> completion = ScanCompletion(geometry, max_range_m=12.0, missing="mirror", n_beams=4)
    >>> completion.add([0.0, 0.0, 0.0], np.linspace(1.0, 3.0, 181)).tolist()
    [2.0, 3.0, 2.0, 1.0]
    """

    geometry: ScanGeometry
    max_range_m: float
    missing: MissingBeams = "local-map"
    all_from_map: bool = False
    known_map: OccupancyGrid | None = None
    local_map: LocalMap | None = None
    n_beams: int = 360
    _beam_of: NDArray[np.int64] = field(init=False, repr=False)
    _seen: NDArray[np.bool_] = field(init=False, repr=False)
    _mirror_of: NDArray[np.int64] = field(init=False, repr=False)
    _angles: NDArray[np.float64] = field(init=False, repr=False)
    _caster: PoseCaster | None = field(init=False, repr=False, default=None)

    def __post_init__(self) -> None:
        check_missing(self.missing, all_from_map=self.all_from_map)
        if (self.known_map is not None) != (self.missing == "known-map"):
            wanted = "needs a map" if self.known_map is None else "does not use the map given"
            raise ConfigError(
                f"missing = {self.missing!r} {wanted}; a known map goes with 'known-map'"
            )
        if self.missing == "local-map":
            self.local_map = self.local_map or LocalMap()
        elif self.local_map is not None:
            raise ConfigError(f"missing = {self.missing!r} does not use the local map given")
        if self.known_map is not None:
            self._caster = PoseCaster(self.known_map)
        self._angles = self.angles_rad
        self._beam_of = _nearest_beams(self.geometry.angles_rad, self._angles)
        self._observed = self._beam_of >= 0
        if not self._observed.any():
            raise InputError(f"{self.geometry} has no beam near any of {self.n_beams} directions")
        self._mirror_of = _mirrored(self._angles, self._observed)

    @property
    def angles_rad(self) -> NDArray[np.float64]:
        """(n_beams,) directions of the output beams."""
        return np.arange(self.n_beams, dtype=np.float64) * (2 * pi / self.n_beams)

    def add(self, pose: ArrayLike, ranges_m: ArrayLike) -> NDArray[np.float32]:
        """(n_beams,) full-circle ranges after the next scan (M,) at a pose (3,)."""
        where = finite_array("pose", pose, (3,))
        ranges = self.geometry.cleaned(ranges_m)
        if self.local_map is not None:
            returned = np.where(self.geometry.returned(ranges), ranges, np.nan)
            reach = self.geometry.range_max_m
            self.local_map.update(where, returned, self.geometry.angles_rad, max_range_m=reach)
        return self._completed(where[None], ranges[None])[0]

    def complete(self, poses: ArrayLike, ranges_m: ArrayLike) -> NDArray[np.float32]:
        """(T, n_beams) full-circle ranges of consecutive scans (T, M) at poses (T, 3)."""
        where = finite_array("poses", poses, ("T", 3))
        ranges = self.geometry.cleaned(ranges_m)
        if len(ranges) != len(where):
            raise InputError(f"there are {len(where)} poses but {len(ranges)} scans")
        if self.missing != "local-map":  # scans are independent
            return self._completed(where, ranges)
        rows = [self.add(pose, row) for pose, row in zip(where, ranges, strict=True)]
        return np.array(rows, np.float32).reshape(len(where), self.n_beams)

    def _completed(
        self, poses: NDArray[np.float64], ranges: NDArray[np.float32]
    ) -> NDArray[np.float32]:
        if self.missing in ("local-map", "known-map"):
            return self._filled_from_map(poses, ranges)
        reach = np.float32(self.max_range_m)
        observed = self._observed
        bridged = _bridged(np.where(self.geometry.returned(ranges), ranges, np.nan), reach)
        completed = np.full((len(poses), self.n_beams), reach, np.float32)
        completed[:, observed] = bridged[:, self._beam_of[observed]]
        if self.missing == "mirror":
            completed[:, ~observed] = completed[:, self._mirror_of[~observed]]
        return np.minimum(completed, reach)

    def _filled_from_map(
        self, poses: NDArray[np.float64], ranges: NDArray[np.float32]
    ) -> NDArray[np.float32]:
        reach = np.float32(self.max_range_m)
        observed = self._observed
        filled = np.where(observed, ranges[:, self._beam_of], reach)
        returned = observed & self.geometry.returned(ranges)[:, self._beam_of]
        wanted = np.ones_like(returned) if self.all_from_map else ~returned
        for row, pose in enumerate(poses):
            beams = np.flatnonzero(wanted[row])
            simulated, met = self._cast(pose, self._angles[beams])
            # A laser beam without a return means no obstacle, unless the map has one: glass and
            # black surfaces give no return either.
            open_space = observed[beams] & ~met & (not self.all_from_map)
            filled[row, beams] = np.where(open_space, reach, simulated)
        return np.minimum(filled, reach)

    def _cast(
        self, pose: NDArray[np.float64], angles: NDArray[np.float64]
    ) -> tuple[NDArray[np.generic], NDArray[np.bool_]]:
        """Ranges in the map along the angles, and whether they end at obstacles."""
        if self.local_map is not None:
            return self.local_map.cast(pose, angles, max_range_m=self.max_range_m)
        assert self._caster is not None  # checked by the constructor
        ranges = self._caster.cast(pose[None], angles, max_range_m=self.max_range_m)[0]
        return ranges, ranges < np.float32(self.max_range_m)


def check_missing(missing: str, *, all_from_map: bool) -> None:
    """Refuse an unknown source of missing beams, or ``all_from_map`` without a map."""
    if missing not in get_args(MissingBeams):
        known = list(get_args(MissingBeams))
        raise ConfigError(f"missing must not be {missing!r}. {nearest_name(missing, known)}")
    if all_from_map and missing not in ("local-map", "known-map"):
        raise ConfigError(f"all_from_map needs a map, but missing is {missing!r}")


def _turn_between(first: NDArray[np.float64], second: NDArray[np.float64]) -> NDArray[np.float64]:
    """The smaller angle between two directions."""
    return np.abs(np.mod(first - second + pi, 2 * pi) - pi)


def _mirrored(angles: NDArray[np.float64], observed: NDArray[np.bool_]) -> NDArray[np.int64]:
    """The observed beam nearest to each beam's left-right mirror image."""
    beams = np.flatnonzero(observed)
    apart = _turn_between(np.pi - angles[:, None], angles[None, beams])
    return beams[apart.argmin(axis=1)]


def _nearest_beams(angles: NDArray[np.float64], wanted: NDArray[np.float64]) -> NDArray[np.int64]:
    """Index of the beam nearest to each direction, -1 if none is near enough."""
    around = np.sort(np.mod(angles, 2 * pi))
    gaps = np.diff(around, append=around[0] + 2 * pi)
    spacing = max(float(np.median(gaps)), 2 * pi / len(wanted))
    apart = _turn_between(wanted[:, None], angles[None, :])
    nearest = apart.argmin(axis=1)
    near = apart[np.arange(len(wanted)), nearest] <= SPACINGS_AWAY * spacing
    return np.where(near, nearest, -1).astype(np.int64)


def _bridged(ranges: NDArray[np.float32], reach: np.float32) -> NDArray[np.float32]:
    """Interpolate NaN readings between their neighbours; scans without readings get ``reach``."""
    beams = np.arange(ranges.shape[1])
    bridged = ranges.copy()
    for scan in np.flatnonzero(np.isnan(ranges).any(axis=1)):
        known = ~np.isnan(ranges[scan])
        bridged[scan] = (
            np.interp(beams, beams[known], ranges[scan, known]) if known.any() else reach
        )
    return bridged
