"""MapView: what a labelled map says at a position, ready to be asked scan by scan."""

import json
from collections.abc import Mapping
from dataclasses import dataclass
from math import cos, floor, isfinite, sin
from pathlib import Path
from typing import NamedTuple, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pgm_places.labelers.map_prior import MapPrior
from pgm_places.live.live_map import LiveLabels
from pgm_places.maps.occupancy_grid import OccupancyGrid

_ARRAYS = ("number", "rows", "shares", "region")


class MapFrame(NamedTuple):
    """Where the cells of a map lie: as of :class:`~pgm_places.maps.occupancy_grid.OccupancyGrid`.

    Parameters
    ----------
    resolution_m, x_m, y_m, yaw_rad : float
    n_rows, n_columns : int
    """

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
        if not (isfinite(dx) and isfinite(dy)):
            return None
        c, s = cos(self.yaw_rad), sin(self.yaw_rad)
        row = floor((c * dy - s * dx) / self.resolution_m)
        column = floor((c * dx + s * dy) / self.resolution_m)
        inside = 0 <= row < self.n_rows and 0 <= column < self.n_columns
        return (row, column) if inside else None


class PlaceOfMap(NamedTuple):
    """A place of a labelled map: its id, name and class."""

    id: int
    name: str
    label: str


@dataclass(frozen=True, eq=False)
class MapView:
    """A labelled map as a robot asks it: which place is here, and how probable each label is.

    It is a :class:`~pgm_places.labelers.map_prior.PositionPrior` for the filter, with the
    probabilities of :class:`~pgm_places.labelers.map_prior.MapPrior`. Written to a folder and
    opened again, its arrays stay in the file until they are looked at, so that a process that
    must answer within milliseconds can change to the next map at once.

    Parameters
    ----------
    map_seq : int
        Number of the map, from 1.
    frame : MapFrame
    number : (H, W) int32
        Row of each cell in ``rows``, -1 where nothing is known.
    rows : (N, K) float32
        Probabilities of the labels.
    shares : (K,) float64
        How frequent each label is.
    region : (H, W) int32
        Id of the place at each cell, 0 for none.
    places : mapping of int to PlaceOfMap
        By id.
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
        """The view of a map that has been labelled."""
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
        """Whether the position lies on the map, known or not."""
        return self.frame.cell_at(x_m, y_m) is not None

    def at(self, positions_m: ArrayLike) -> NDArray[np.float64]:
        """(T, K) probabilities at positions (T, 2); the labels' shares where nothing is known."""
        found = np.tile(self.shares, (len(np.asarray(positions_m)), 1))
        for t, (x, y) in enumerate(np.asarray(positions_m, np.float64).tolist()):
            cell = self.frame.cell_at(x, y)
            if cell is not None and self.number[cell] >= 0:
                found[t] = self.rows[self.number[cell]]
        return found

    def log_likelihood(self, probabilities: NDArray[np.float64]) -> NDArray[np.float64]:
        """What probabilities (..., K) from :meth:`at`, or means of them, add to each label."""
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
        """The view in a folder that :meth:`write` wrote; its arrays are read when asked."""
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
