"""Doorways: the accepted gates of a map, and the raster of the places between them."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from pgm_places._checks import freeze, set_frozen
from pgm_places.errors import InputError
from pgm_places.graph.bands import bands_of_rows
from pgm_places.maps._blocks import factor_between, holders
from pgm_places.maps.components import number_type
from pgm_places.maps.occupancy_grid import OccupancyGrid
from pgm_places.spaces.gate import Gate
from pgm_places.spaces.places import Places


@dataclass(frozen=True, eq=False)
class RasterRuns:
    """A run-length encoded raster.

    Parameters
    ----------
    shape : (int, int)
    dtype : dtype
    bands : tuple of pairs of (M,) arrays
        Values and lengths of the runs in each band of rows.

    Examples
    --------
    >>> runs = RasterRuns.of(np.array([[1, 1, 1], [1, 2, 2]], np.int16))
    >>> [values.tolist() for values, _ in runs.bands], runs.raster().tolist()
    ([[1, 2]], [[1, 1, 1], [1, 2, 2]])
    """

    shape: tuple[int, int]
    dtype: np.dtype[Any]
    bands: tuple[tuple[NDArray[Any], NDArray[np.int32]], ...]

    @classmethod
    def of(cls, raster: NDArray[Any]) -> Self:
        """The runs of a raster (H, W)."""
        shape = (raster.shape[0], raster.shape[1])
        return cls(
            shape, raster.dtype, tuple(_runs(raster[rows].ravel()) for rows in bands_of_rows(shape))
        )

    def raster(self) -> NDArray[Any]:
        """(H, W) the decoded raster, not cached."""
        raster_of_runs = np.empty(self.shape, self.dtype)
        for rows, (values, lengths) in zip(bands_of_rows(self.shape), self.bands, strict=True):
            raster_of_runs[rows] = np.repeat(values, lengths).reshape(-1, self.shape[1])
        return raster_of_runs


def _runs(flat: NDArray[Any]) -> tuple[NDArray[Any], NDArray[np.int32]]:
    starts = np.flatnonzero(flat[1:] != flat[:-1]) + 1
    starts = np.concatenate([[0], starts])
    return flat[starts], np.diff(starts, append=len(flat)).astype(np.int32)


@dataclass(frozen=True, eq=False)
class Doorways:
    """The gates of a map that are accepted as doorways, and the places between them.

    Parameters
    ----------
    grid : OccupancyGrid
        The map.
    gates : tuple of Gate
        The doorways, as rectangles in the map frame.
    probability : (G,) float64
        Probability that each is a doorway.
    place : (H, W) int16 or int32
        Number of each cell's place, -1 for none, in the smaller type if possible. It is stored
        run-length encoded: each access decodes a new raster.
    """

    grid: OccupancyGrid
    gates: tuple[Gate, ...]
    probability: NDArray[np.float64]
    place: NDArray[np.int16] | NDArray[np.int32]

    def __post_init__(self) -> None:
        if self.probability.shape != (len(self.gates),):
            raise InputError(
                f"probability must hold one number per gate ({len(self.gates)}), got shape "
                f"{self.probability.shape}"
            )
        if self.place.shape != self.grid.shape:
            raise InputError(
                f"place must have the map's shape {self.grid.shape}, got {self.place.shape}"
            )
        set_frozen(self, _runs=RasterRuns.of(self.place))
        object.__delattr__(self, "place")

    def __getattr__(self, name: str) -> NDArray[Any]:
        """``place``, decoded from its runs."""
        if name != "place" or "_runs" not in self.__dict__:
            raise AttributeError(f"{type(self).__name__!r} object has no attribute {name!r}")
        raster: NDArray[Any] = self.__dict__["_runs"].raster()
        return raster

    def __len__(self) -> int:
        return len(self.gates)

    @classmethod
    def of(cls, places: Places, probability: NDArray[np.float64]) -> Self:
        """The accepted gates between places.

        Parameters
        ----------
        places : Places
        probability : (G,) float64
            Probability of each candidate, accepted or not.

        Examples
        --------
        >>> from pgm_places.spaces.gates import gate_candidates
        >>> from pgm_places.spaces.places import places_between
        >>> from pgm_places.spaces.segmentation import Segmentation
        >>> cells = np.zeros((20, 42), np.int8)
        >>> cells[:, 20:22], cells[8:12, 20:22] = 100, 0  # two rooms, a wall, a door of 0.8 m
        >>> gates = gate_candidates(Segmentation.of(OccupancyGrid(cells, resolution_m=0.2)))
        >>> sure = np.array([0.9])
        >>> found = Doorways.of(places_between(gates, sure), sure)
        >>> len(found), np.unique(found.place).tolist()
        (1, [-1, 0, 1])
        """
        taken = np.flatnonzero(places.accepted)
        place = places.segments.raster(number_type(places.segments.count))
        return cls(
            places.gates.segmentation.watershed.grid,
            tuple(places.gates[int(g)] for g in taken),
            freeze(np.asarray(probability, np.float64)[taken]),
            place,
        )

    def with_known(self, gates: Sequence[Gate]) -> Self:
        """The doorways with further ones of probability 1."""
        probability = np.append(self.probability, np.ones(len(gates)))
        return replace(self, gates=(*self.gates, *gates), probability=freeze(probability))

    def place_on(self, grid: OccupancyGrid) -> NDArray[np.int16] | NDArray[np.int32]:
        """(H, W) the place at each cell centre of the same map at another resolution, -1 for none.

        Raises
        ------
        InputError
            The map is in another frame, or of another size.
        """
        if grid.origin_xy_m != self.grid.origin_xy_m or grid.yaw_rad != self.grid.yaw_rad:
            raise InputError(
                f"doorways were found in a map with its origin at {self.grid.origin_xy_m} and yaw "
                f"{self.grid.yaw_rad:g}, but the map has {grid.origin_xy_m} and {grid.yaw_rad:g}"
            )
        if grid.shape == self.grid.shape and grid.resolution_m == self.grid.resolution_m:
            return self.place
        sizes_m = np.multiply(
            [self.grid.shape, grid.shape], [[self.grid.resolution_m], [grid.resolution_m]]
        )
        coarser_m = max(self.grid.resolution_m, grid.resolution_m)
        if (np.abs(sizes_m[0] - sizes_m[1]) > 1.5 * coarser_m).any():
            raise InputError(
                f"doorways were found in a map of {sizes_m[0, 0]:g} x {sizes_m[0, 1]:g} m, but the "
                f"map has {sizes_m[1, 0]:g} x {sizes_m[1, 1]:g} m"
            )
        factor = factor_between(grid.resolution_m, self.grid.resolution_m)
        # Only cells of the last blocks lie outside: they use the nearest row and column.
        rows, columns = (
            np.minimum(holders(np.arange(n), factor), last - 1)
            for n, last in zip(grid.shape, self.grid.shape, strict=True)
        )
        return np.asarray(self.place[np.ix_(rows, columns)])
