"""The unary model of scans: from completed scans to the boosted list's scores of each."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pgm_places._checks import finite_array
from pgm_places.errors import InputError
from pgm_places.features.extraction import ScanExtractor
from pgm_places.features.own import MapFeature, feature_values, n_columns
from pgm_places.maps.occupancy_grid import OccupancyGrid
from pgm_places.models.boosted_list import BoostedList
from pgm_places.options import AtLeastZeroOrInfinite, Positive, check_options
from pgm_places.sensing.local_map import LocalMap
from pgm_places.sensing.ray_casting import cast_poses
from pgm_places.sensing.scan_completion import MissingBeams, ScanCompletion, check_missing
from pgm_places.sensing.sensor import Sensor
from pgm_places.trajectories.scan import ScanGeometry
from pgm_places.trajectories.trajectory import Trajectory
from pgm_places.unary.cell_lists import aligned_log_proba

__all__ = ["BeamOptions", "ScanModel", "ScanScorer", "circles_along"]


@dataclass(frozen=True)
class BeamOptions:
    """How the scans of a robot become the beams that the features expect.

    Parameters
    ----------
    missing : {"local-map", "known-map", "mirror", "max-range"}
        Where beams come from that the laser does not have: see
        :class:`pgm_places.sensing.scan_completion.ScanCompletion`.
    all_from_map : bool
        Take every beam from the map.
    local_size_m, local_resolution_m : float
        Side of the local map and of its cells in metres.
    through_unknown_m : float
        See :class:`pgm_places.sensing.local_map.LocalMap`.
    """

    missing: MissingBeams = "local-map"
    all_from_map: bool = False
    local_size_m: Positive = 40.0
    local_resolution_m: Positive = 0.05
    through_unknown_m: AtLeastZeroOrInfinite = 0.3

    def __post_init__(self) -> None:
        check_options(self)
        check_missing(self.missing, all_from_map=self.all_from_map)

    def circle(
        self, geometry: ScanGeometry, sensor: Sensor, known_map: OccupancyGrid | None = None
    ) -> ScanCompletion:
        """A fresh completion for one robot; a known map is used only if ``missing`` asks for it.

        Raises
        ------
        InputError
            ``missing`` asks for a known map and there is none.
        """
        if self.missing == "known-map" and known_map is None:
            raise InputError(
                "the missing beams are to be cast in the known map, but no map is given; give "
                "one, or use missing='local-map'"
            )
        local = None
        if self.missing == "local-map":
            local = LocalMap(
                self.local_size_m,
                self.local_resolution_m,
                through_unknown_m=self.through_unknown_m,
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
    """A boosted list on the features of a scan, and on columns from elsewhere after them.

    Parameters
    ----------
    classifier : BoostedList
        On the 321 laser features, own features and D columns; its classes are label indices.
    n_labels : int
        K.
    sensor : Sensor
        Beams and reach that the list learned with.
    extra_names : tuple of D str
        Columns after the features, such as counts of objects seen by a camera.
    features : tuple
        Custom features of scans: see :mod:`pgm_places.features.own`.
    """

    classifier: BoostedList
    n_labels: int
    sensor: Sensor
    extra_names: tuple[str, ...] = ()
    features: tuple[Any, ...] = ()
    needed: NDArray[np.int64] = field(init=False, repr=False)
    """The columns that the list looks at, ascending."""
    short_list: BoostedList = field(init=False, repr=False)
    """The list for matrices of those columns alone."""

    def __post_init__(self) -> None:
        check_scan_features(self.features)
        n_own = n_columns(self.features)
        if self.classifier.n_features != n_own + len(self.extra_names):
            raise InputError(
                f"the list wants {self.classifier.n_features} columns, but there are {n_own} "
                f"features of scans and {len(self.extra_names)} extra columns"
            )
        needed = self.classifier.used_features
        object.__setattr__(self, "needed", needed)
        object.__setattr__(self, "short_list", self.classifier.restricted(needed))

    def log_proba(
        self,
        circles_m: ArrayLike,
        extra: ArrayLike | None = None,
        *,
        n_threads: int | None = None,
    ) -> NDArray[np.float64]:
        """(T, K) log z of scans (T, n_beams) all around and their extra columns (T, D)."""
        n_own = n_columns(self.features)
        own = self.needed[self.needed < n_own]
        values = feature_values(
            np.asarray(circles_m),
            self.features,
            own,
            max_range_m=self.sensor.max_range_m,
            n_threads=n_threads,
        )
        columns = check_extra(extra, len(values), self.extra_names)
        if len(own) < len(self.needed):
            chosen = columns[:, self.needed[len(own) :] - n_own]
            values = np.concatenate([values, chosen], axis=1)
        return aligned_log_proba(self.short_list, values, self.n_labels, n_threads)


class ScanScorer:
    """What a model says of one scan after the other: the bits of :meth:`ScanModel.log_proba`.

    It works in room of its own, which saves time: two threads must not share one.
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
        self, circle_m: NDArray[np.float32], extra: ArrayLike | None = None
    ) -> NDArray[np.float64]:
        """(K,) log z of a scan (n_beams,) all around and its extra columns (D,)."""
        model = self._model
        row = None if extra is None else np.asarray(extra, np.float32)[None]
        if self._laser is None:
            return model.log_proba(circle_m[None], row, n_threads=1)[0]
        values = self._laser.features(circle_m)[None]
        columns = check_extra(row, 1, model.extra_names)
        if len(self._extra):
            values = np.concatenate([values, columns[:, self._extra]], axis=1)
        return aligned_log_proba(model.short_list, values, model.n_labels, 1)[0]


def circles_along(
    trajectory: Trajectory,
    sensor: Sensor,
    beams: BeamOptions,
    *,
    known_map: OccupancyGrid | None = None,
    n_threads: int | None = None,
) -> NDArray[np.float32]:
    """(T, n_beams) ranges all around at each step of a trajectory.

    A trajectory without scans takes them all from the known map.

    Raises
    ------
    InputError
        There are neither scans nor a known map.
    """
    if trajectory.ranges_m is None or trajectory.geometry is None:
        if known_map is None:
            raise InputError(
                f"{trajectory.name} has no scans; give the map in which they are to be cast"
            )
        return cast_poses(
            known_map,
            trajectory.poses,
            sensor.angles_rad,
            max_range_m=sensor.max_range_m,
            n_threads=n_threads,
        )
    circle = beams.circle(trajectory.geometry, sensor, known_map)
    return circle.complete(trajectory.poses, trajectory.ranges_m)


def check_scan_features(features: Sequence[Any]) -> None:
    """Refuse features that only a map's cells have."""
    for item in features:
        if isinstance(item, MapFeature):
            raise InputError(
                f"the feature {type(item).__name__} looks at a map's cells, which a trajectory's "
                "scans have not; use features of scans to label both"
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
