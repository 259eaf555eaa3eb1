"""Unary model of scans: scores of completed scans by a boosted list."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pgm_places._checks import finite_array, set_frozen
from pgm_places.errors import ConfigError, InputError
from pgm_places.features.custom import Feature, MapFeature, feature_values, n_columns
from pgm_places.features.extraction import ScanExtractor
from pgm_places.maps.occupancy_grid import OccupancyGrid
from pgm_places.models.boosted_list import BoostedList
from pgm_places.options import AtLeastZero, AtLeastZeroOrInfinite, Positive, check_options
from pgm_places.sensing.local_map import LocalMap
from pgm_places.sensing.ray_casting import cast_poses
from pgm_places.sensing.scan_completion import MissingBeams, ScanCompletion, check_missing
from pgm_places.sensing.sensor import Sensor
from pgm_places.trajectories.scan import ScanGeometry
from pgm_places.trajectories.trajectory import Trajectory
from pgm_places.unary.cell_scorers import aligned_log_proba
from pgm_places.unary.floor_model import FloorModel
from pgm_places.unary.local_features import N_LOCAL_SPACE_FEATURES, LocalFloor, LocalSpaceFeatures

__all__ = [
    "BeamOptions",
    "Observations",
    "ScanModel",
    "ScanObserver",
    "ScanScorer",
    "observed_along",
]


class Observations(NamedTuple):
    """The inputs of the unary model at one step, or at the T steps of a trajectory."""

    circles_m: NDArray[np.float32]  # (n_beams,) ranges all around
    spaces: NDArray[np.float32]  # (F,) features of the segments around, or no columns
    # (K,) log-probabilities of the floor networks, if used
    floor: NDArray[np.float64] | None = None


class ScanObserver:
    """Completes the scans of one robot, and computes features of the spaces around it if enabled.

    ``completion``: fresh, for one robot. ``spaces_m``: half the side of the square that is divided
    into segments, of the known map or of the rolling one; 0 for none. ``floor``: networks that are
    evaluated on this map.
    """

    def __init__(
        self, completion: ScanCompletion, spaces_m: float = 0.0, floor: FloorModel | None = None
    ) -> None:
        self._completion = completion
        self._spaces: LocalSpaceFeatures | None = None
        self._floor: LocalFloor | None = None
        if spaces_m > 0 or floor is not None:
            source = completion.local_map or completion.known_map
            assert source is not None  # BeamOptions has checked
            self._spaces = LocalSpaceFeatures(source, spaces_m) if spaces_m > 0 else None
            self._floor = None if floor is None else LocalFloor(source, floor)

    @property
    def geometry(self) -> ScanGeometry:
        """The laser's beams."""
        return self._completion.geometry

    def add(self, pose: NDArray[np.float64], ranges_m: ArrayLike) -> Observations:
        """The observations after one more scan (M,) at a pose (3,)."""
        circle = self._completion.add(pose, ranges_m)
        return Observations(
            circle,
            np.empty(0, np.float32) if self._spaces is None else self._spaces.at(pose[:2]),
            None if self._floor is None else self._floor.at(pose[:2]),
        )

    def along(self, poses: NDArray[np.float64], ranges_m: NDArray[np.float32]) -> Observations:
        """The observations at each of the poses (T, 3) with its scan (T, M), in order."""
        no_spaces = np.empty((len(poses), 0), np.float32)
        if self._spaces is None and self._floor is None:
            return Observations(self._completion.complete(poses, ranges_m), no_spaces)
        steps = [self.add(pose, row) for pose, row in zip(poses, ranges_m, strict=True)]
        circles = np.array([step.circles_m for step in steps], np.float32)
        scores = [step.floor for step in steps if step.floor is not None]
        return Observations(
            circles.reshape(len(steps), self._completion.n_beams),
            no_spaces if self._spaces is None else self._spaces.rows([s.spaces for s in steps]),
            None if self._floor is None else self._floor.rows(scores),
        )


@dataclass(frozen=True)
class BeamOptions:
    """Options of the conversion of a robot's scans into the beams of the features.

    Parameters
    ----------
    missing : {"local-map", "known-map", "mirror", "max-range"}
        Source of the beams that the laser lacks: see
        :class:`pgm_places.sensing.scan_completion.ScanCompletion`.
    all_from_map : bool
        Take every beam from the map.
    local_size_m, local_resolution_m : float
        Side of the local map and of its cells in metres.
    through_unknown_m : float
        See :class:`pgm_places.sensing.local_map.LocalMap`.
    spaces_m : float
        Half the side in metres of the square around the robot, in the local map or the known one,
        whose segments are features of the scan, too; 0 for none. The list's columns are fixed when
        it is trained. See :mod:`pgm_places.unary.local_features`.
    """

    missing: MissingBeams = "local-map"
    all_from_map: bool = False
    local_size_m: Positive = 40.0
    local_resolution_m: Positive = 0.05
    through_unknown_m: AtLeastZeroOrInfinite = 0.3
    spaces_m: AtLeastZero = 0.0

    def __post_init__(self) -> None:
        check_options(self)
        check_missing(self.missing, all_from_map=self.all_from_map)
        if self.spaces_m > 0:
            self.check_builds_map("spaces_m needs the spaces around the robot")

    def observer(
        self,
        geometry: ScanGeometry,
        sensor: Sensor,
        known_map: OccupancyGrid | None = None,
        floor: FloorModel | None = None,
    ) -> ScanObserver:
        """A new observer of one robot, with a new :meth:`circle`.

        Raises
        ------
        InputError
            As :meth:`circle`.
        ConfigError
            Networks are used, but no map is built.
        """
        if floor is not None:
            self.check_builds_map("the floor networks look at one")
        return ScanObserver(self.circle(geometry, sensor, known_map), self.spaces_m, floor)

    def check_builds_map(self, why: str) -> None:
        """Raise an error if no map around the robot is built for these beams."""
        if self.missing not in ("local-map", "known-map"):
            raise ConfigError(
                f"missing = {self.missing!r} builds no map, but {why}; use 'local-map' or "
                "'known-map'"
            )

    def circle(
        self, geometry: ScanGeometry, sensor: Sensor, known_map: OccupancyGrid | None = None
    ) -> ScanCompletion:
        """A new completion for one robot; a known map is used only if ``missing`` requires it.

        Raises
        ------
        InputError
            ``missing`` requires a known map and there is none.
        """
        if self.missing == "known-map" and known_map is None:
            raise InputError(
                "the missing beams are to be cast in the known map, but no map is given; give "
                "one, or use missing='local-map'"
            )
        local = None
        if self.missing == "local-map":
            local = LocalMap(
                self.local_size_m, self.local_resolution_m, through_unknown_m=self.through_unknown_m
            )
        return ScanCompletion(
            geometry,
            sensor.max_range_m,
            self.missing,
            self.all_from_map,
            known_map if self.missing == "known-map" else None,
            local,
            sensor.n_beams,
        )


@dataclass(frozen=True, eq=False)
class ScanModel:
    """A boosted list on the features of a scan, followed by additional columns."""

    # on the 321 laser features, own features and D columns; its classes are label indices
    classifier: BoostedList
    n_labels: int  # K
    sensor: Sensor  # beams and range of the training scans
    # columns after all others, such as counts of objects seen by a camera
    extra_names: tuple[str, ...] = ()
    # custom features of scans: see :mod:`pgm_places.features.custom`
    features: tuple[Feature, ...] = ()
    # whether features of the spaces around the robot follow the features of its scan
    sees_spaces: bool = False
    # The columns that the list uses, ascending.
    needed: NDArray[np.int64] = field(init=False, repr=False)
    # The list for matrices of those columns alone.
    short_list: BoostedList = field(init=False, repr=False)

    def __post_init__(self) -> None:
        check_scan_features(self.features)
        n_own = n_columns(self.features)
        if self.classifier.n_features != n_own + self.n_spaces + len(self.extra_names):
            raise InputError(
                f"the list needs {self.classifier.n_features} columns, but there are {n_own} "
                f"features of scans, {self.n_spaces} of spaces and {len(self.extra_names)} extra "
                "columns"
            )
        needed = self.classifier.used_features
        set_frozen(self, needed=needed, short_list=self.classifier.restricted(needed))

    @property
    def n_spaces(self) -> int:
        """Columns of spaces."""
        return N_LOCAL_SPACE_FEATURES if self.sees_spaces else 0

    def log_proba(
        self,
        circles_m: ArrayLike,
        extra: ArrayLike | None = None,
        *,
        spaces: ArrayLike | None = None,
    ) -> NDArray[np.float64]:
        """(T, K) log z of scans (T, n_beams) all around, with their spaces and extra columns."""
        n_own = n_columns(self.features)
        own = self.needed[self.needed < n_own]
        values = feature_values(
            np.asarray(circles_m), self.features, own, max_range_m=self.sensor.max_range_m
        )
        columns = self.other_columns(spaces, extra, len(values))
        if len(own) < len(self.needed):
            chosen = columns[:, self.needed[len(own) :] - n_own]
            values = np.concatenate([values, chosen], axis=1)
        return aligned_log_proba(self.short_list, values, self.n_labels)

    def other_columns(
        self, spaces: ArrayLike | None, extra: ArrayLike | None, n_steps: int
    ) -> NDArray[np.float32]:
        """(T, S + D) the columns of spaces (T, S) and the extra ones (T, D), checked."""
        of_spaces = np.empty((n_steps, 0), np.float32) if spaces is None else np.asarray(spaces)
        if of_spaces.shape != (n_steps, self.n_spaces):
            wants = "looks" if self.sees_spaces else "does not look"
            raise InputError(
                f"this model {wants} at the spaces around the robot ({self.n_spaces} columns), but "
                f"{of_spaces.shape[-1]} columns came; keep spaces_m of the beams as in training"
            )
        columns = check_extra(extra, n_steps, self.extra_names)
        return np.concatenate([of_spaces, columns], axis=1, dtype=np.float32)


class ScanScorer:
    """Scores scans one by one, bitwise equal to :meth:`ScanModel.log_proba`.

    Reuses buffers; not thread-safe.
    """

    def __init__(self, model: ScanModel) -> None:
        self._model = model
        n_own = n_columns(model.features)
        self._own = model.needed[model.needed < n_own]
        self._extra = model.needed[len(self._own) :] - n_own
        self._laser: ScanExtractor | None = None
        if not model.features:
            self._laser = ScanExtractor(self._own, max_range_m=model.sensor.max_range_m)

    def log_proba(
        self,
        circle_m: NDArray[np.float32],
        extra: ArrayLike | None = None,
        spaces: NDArray[np.float32] | None = None,
    ) -> NDArray[np.float64]:
        """(K,) log z of a scan (n_beams,) all around, its extra columns (D,) and its spaces."""
        model = self._model
        row = None if extra is None else np.asarray(extra, np.float32)[None]
        around = None if spaces is None else spaces[None]
        if self._laser is None:
            return model.log_proba(circle_m[None], row, spaces=around)[0]
        values = self._laser.features(circle_m)[None]
        columns = model.other_columns(around, row, 1)
        if len(self._extra):
            values = np.concatenate([values, columns[:, self._extra]], axis=1)
        return aligned_log_proba(model.short_list, values, model.n_labels, 1)[0]


def observed_along(
    trajectory: Trajectory,
    sensor: Sensor,
    beams: BeamOptions,
    *,
    known_map: OccupancyGrid | None = None,
    floor: FloorModel | None = None,
) -> Observations:
    """The observations at each step of a trajectory.

    For a trajectory without scans, all beams are cast in the known map.

    InputError: there are neither scans nor a known map.
    """
    if trajectory.ranges_m is None or trajectory.geometry is None:
        if known_map is None:
            raise InputError(
                f"{trajectory.name} has no scans; give the map in which they are to be cast"
            )
        circles = cast_poses(
            known_map, trajectory.poses, sensor.angles_rad, max_range_m=sensor.max_range_m
        )
        poses, spaces = trajectory.poses, np.empty((len(circles), 0), np.float32)
        if beams.spaces_m > 0:
            spaces = LocalSpaceFeatures(known_map, beams.spaces_m).along(poses)
        scores = None if floor is None else LocalFloor(known_map, floor).along(poses)
        return Observations(circles, spaces, scores)
    observer = beams.observer(trajectory.geometry, sensor, known_map, floor)
    return observer.along(trajectory.poses, trajectory.ranges_m)


def check_scan_features(features: Sequence[object]) -> None:
    """Raise an error for features that only cells of maps have."""
    for item in features:
        if isinstance(item, MapFeature):
            raise InputError(
                f"the feature {type(item).__name__} looks at a map's cells, which a "
                "trajectory's scans do not have; use features of scans to label both"
            )


def check_extra(
    extra: ArrayLike | None, n_steps: int, names: tuple[str, ...]
) -> NDArray[np.float32]:
    """``extra`` as (T, D) columns with these names, or one clear error."""
    if extra is None:
        if names:
            raise InputError(
                f"this model also looks at {', '.join(names)}: give these columns as extra"
            )
        return np.zeros((n_steps, 0), np.float32)
    if not names:
        raise InputError("extra columns are given, but this model looks at the laser only")
    columns: NDArray[np.float32] = finite_array(
        "extra", extra, (n_steps, len(names)), dtype=np.float32
    )
    return columns
