"""PlaceFinder: a robot's place at each scan, from the laser and a labelled map."""

import json
import math
from collections.abc import Mapping
from dataclasses import dataclass
from math import cos, floor, hypot, sin
from pathlib import Path
from typing import Any, NamedTuple, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pgm_places.labelers.map_prior import MapPrior
from pgm_places.labelers.tracking import OnlineLabeler
from pgm_places.labelers.trajectory_labeler import TrajectoryLabeler
from pgm_places.live.live_map import LiveLabels
from pgm_places.live.live_options import LiveOptions
from pgm_places.maps.occupancy_grid import OccupancyGrid
from pgm_places.trajectories.scan import Scan, ScanGeometry

_ARRAYS = ("number", "rows", "shares", "region")


class MapFrame(NamedTuple):
    """The frame of a map's cells, as in :class:`~pgm_places.maps.occupancy_grid.OccupancyGrid`."""

    resolution_m: float
    x_m: float
    y_m: float
    yaw_rad: float
    n_rows: int
    n_columns: int

    @classmethod
    def of(cls, grid: OccupancyGrid) -> Self:
        """The frame of a map."""
        return cls(grid.resolution_m, *grid.origin_xy_m, grid.yaw_rad, *grid.shape)

    def cell_at(self, x_m: float, y_m: float) -> tuple[int, int] | None:
        """Row and column of the cell at a position, or None outside the map."""
        dx, dy = x_m - self.x_m, y_m - self.y_m
        c, s = cos(self.yaw_rad), sin(self.yaw_rad)
        row = (c * dy - s * dx) / self.resolution_m
        column = (c * dx + s * dy) / self.resolution_m
        inside = 0 <= row < self.n_rows and 0 <= column < self.n_columns  # false for NaN
        return (floor(row), floor(column)) if inside else None

    def distance_m(self, other: "MapFrame") -> float:
        """Distance between the circles around both rasters; negative if they overlap."""
        (x, y, radius), (x2, y2, radius2) = self._circle(), other._circle()
        return hypot(x2 - x, y2 - y) - radius - radius2

    def _circle(self) -> tuple[float, float, float]:
        """Centre and radius of the circle through the corners."""
        width, height = self.n_columns * self.resolution_m, self.n_rows * self.resolution_m
        c, s = cos(self.yaw_rad), sin(self.yaw_rad)
        x, y = (c * width - s * height) / 2, (s * width + c * height) / 2
        return self.x_m + x, self.y_m + y, hypot(width, height) / 2


class PlaceOfMap(NamedTuple):
    """A place of a labelled map: its id, name and class."""

    id: int
    name: str
    label: str


@dataclass(frozen=True, eq=False)
class MapView:
    """A labelled map for look-ups: the place and the label probabilities at a position.

    It is a :class:`~pgm_places.labelers.map_prior.PositionPrior` for the filter, with the
    probabilities of :class:`~pgm_places.labelers.map_prior.MapPrior`. Written to a folder and
    opened again, its arrays are read from the file on access, so that a process with limits of
    milliseconds can switch to the next map at once.

    ``number`` (H, W) is the row of each cell in ``rows`` (N, K), the probabilities of the labels;
    -1 for cells without. ``shares`` (K,) are the labels' frequencies; ``region`` (H, W) are ids in
    ``places``, 0 for none.
    """

    map_seq: int
    frame: MapFrame
    number: NDArray[np.int32]
    rows: NDArray[np.float32]
    shares: NDArray[np.float64]
    region: NDArray[np.int32]
    places: Mapping[int, PlaceOfMap]

    @classmethod
    def of(cls, found: LiveLabels) -> Self:
        """The view of a labelled map."""
        prior, topology = MapPrior.of_places(found.labels), found.topology
        return cls(
            found.map_seq,
            MapFrame.of(topology.grid),
            prior.number,
            prior.rows,
            prior.shares,
            topology.region,
            {item.id: PlaceOfMap(item.id, item.name, item.label) for item in topology.regions},
        )

    def place_at(self, x_m: float, y_m: float) -> PlaceOfMap | None:
        """The place at a position in the map frame, or None."""
        cell = self.frame.cell_at(x_m, y_m)
        return None if cell is None else self.places.get(int(self.region[cell]))

    def contains(self, x_m: float, y_m: float) -> bool:
        """Whether the position lies on the map's raster."""
        return self.frame.cell_at(x_m, y_m) is not None

    def is_labelled(self, x_m: float, y_m: float) -> bool:
        """Whether the position lies on a labelled free cell."""
        cell = self.frame.cell_at(x_m, y_m)
        return cell is not None and bool(self.number[cell] >= 0)

    def at(self, positions_m: ArrayLike) -> NDArray[np.float64]:
        """(T, K) probabilities at positions (T, 2); ``shares`` for cells without probabilities."""
        probabilities = np.tile(self.shares, (len(np.asarray(positions_m)), 1))
        for t, (x, y) in enumerate(np.asarray(positions_m, np.float64).tolist()):
            cell = self.frame.cell_at(x, y)
            if cell is not None and self.number[cell] >= 0:
                probabilities[t] = self.rows[self.number[cell]]
        return probabilities

    def log_likelihood(self, probabilities: NDArray[np.float64]) -> NDArray[np.float64]:
        """Log-likelihood of labels, from probabilities (..., K) of :meth:`at` or their means."""
        return np.asarray(np.log(probabilities) - np.log(self.shares))

    def write(self, folder: Path) -> None:
        """Write it into a folder: an ``.npy`` file for each array, and ``view.json``."""
        for name in _ARRAYS:
            np.save(folder / f"{name}.npy", getattr(self, name), allow_pickle=False)
        head = {
            "map_seq": self.map_seq,
            "frame": list(self.frame),
            "places": [list(place) for place in self.places.values()],
        }
        (folder / "view.json").write_text(json.dumps(head), encoding="utf-8")

    @classmethod
    def open(cls, folder: Path) -> Self:
        """Open the files of :meth:`write`; arrays are read on access."""
        head = json.loads((folder / "view.json").read_text(encoding="utf-8"))
        arrays = {
            name: np.load(folder / f"{name}.npy", mmap_mode="r", allow_pickle=False)
            for name in _ARRAYS
        }
        places = [PlaceOfMap(*place) for place in head["places"]]
        return cls(
            head["map_seq"],
            MapFrame(*head["frame"]),
            places={place.id: place for place in places},
            **arrays,
        )


DIGITS = 6


@dataclass(frozen=True)
class FoundPlace:
    """The place of a scan: label and probabilities from the laser and the map, and the map's place.

    ``pose`` is x, y (m) and heading (rad) of the robot in the frame of the map. ``map_seq`` is 0
    before the first map. ``changed``: the place or label has differed from the last reported one
    for long enough.
    """

    time_s: float
    pose: tuple[float, float, float]
    label: str
    beliefs: Mapping[str, float]
    region: PlaceOfMap | None = None
    map_seq: int = 0
    changed: bool = True

    @property
    def probability(self) -> float:
        """The probability of the label."""
        return self.beliefs[self.label]

    def record(self) -> dict[str, Any]:
        """As an object of JSON, with the keys of ``track --jsonl`` and ``map_seq``."""
        x, y, heading = (round(value, DIGITS) for value in self.pose)
        region = self.region
        return {
            "time_s": self.time_s,
            "x_m": x,
            "y_m": y,
            "heading_rad": heading,
            "label": self.label,
            "beliefs": {name: round(value, DIGITS) for name, value in self.beliefs.items()},
            "region": None if region is None else {"id": region.id, "name": region.name},
            "map_seq": self.map_seq,
        }


class PlaceFinder:
    """Finds the label and the place of each scan of one robot, online.

    The labeler is fitted and has a hidden Markov model. If its labels are those of the labelled
    map, the map's probabilities are used, too.
    """

    def __init__(self, labeler: TrajectoryLabeler, options: LiveOptions | None = None) -> None:
        self._labeler, self._options = labeler, options or LiveOptions()
        self.view: MapView | None = None
        self._geometry: ScanGeometry | None = None
        self._online: OnlineLabeler | None = None
        self.forget()

    def forget(self) -> None:
        """Reset the filter, as after a clock jump; the labelled map stays."""
        self._online = None
        self._label: int | None = None
        self._reported: tuple[str, int] | None = None
        self._since_s = math.inf

    def warm_up(self) -> None:
        """Import modules and allocate buffers, so that the first scan is not late."""
        geometry = ScanGeometry.half_circle(180)
        readings = np.full(180, 2.0, np.float32)
        self._labeler.online(geometry).step(Scan(0.0, np.zeros(3), readings, geometry))

    def use(self, view: MapView | None) -> None:
        """Use another labelled map from the next scan on."""
        self.view = view
        if self._online is not None:
            self._ask_map(self._online)

    def step(
        self, scan: Scan, robot: NDArray[np.float64] | None = None, *, now_s: float | None = None
    ) -> FoundPlace:
        """The place of the next scan, whose pose is that of the laser in the frame of the map.

        A scan with other beams than the previous one resets the filter. ``robot`` (3,) is the
        robot's pose if it differs. ``now_s`` measures durations of places, by default the scan's
        stamp.
        """
        known = self._geometry
        if self._online is None or known is None or not scan.geometry.same_as(known):
            self._geometry = scan.geometry
            self._online = self._labeler.online(scan.geometry)
            self._ask_map(self._online)
        belief = self._online.step(scan)
        names = self._labeler.label_names_
        best = self._online.choose(belief)
        if self._label is None or belief[best] >= self._options.min_probability:
            self._label = best
        x, y, heading = (scan.pose if robot is None else robot).tolist()
        region = None if self.view is None else self.view.place_at(x, y)
        label = names[self._label]
        return FoundPlace(
            scan.time_s,
            (x, y, heading),
            label,
            dict(zip(names, belief.tolist(), strict=True)),
            region,
            0 if self.view is None else self.view.map_seq,
            self._has_changed(scan.time_s if now_s is None else now_s, label, region),
        )

    def _has_changed(self, time_s: float, label: str, region: PlaceOfMap | None) -> bool:
        """Whether a change has lasted long enough to be reported."""
        # On the map, only the place counts, as the label may change within it.
        now = (label, 0) if region is None else ("", region.id)
        if now == self._reported:
            self._since_s = math.inf
            return False
        self._since_s = min(self._since_s, time_s)
        if self._reported is not None and time_s - self._since_s < self._options.hysteresis_s:
            return False
        self._reported, self._since_s = now, math.inf
        return True

    def _ask_map(self, online: OnlineLabeler) -> None:
        same = self.view is not None and len(self.view.shares) == len(online.label_names)
        online.use_map(self.view if same else None)
