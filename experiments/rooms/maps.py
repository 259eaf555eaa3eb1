"""The maps of Bormann et al.'s benchmark of room segmentation, in the layout of their repository.

``NAME.png`` is an empty map, ``NAME_furnitures.png`` the same with furniture, and
``NAME_gt_segmentation.png`` its rooms: free space in which lines have been drawn between them.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from pgm_places.errors import MapError
from pgm_places.io.maps.raster_image import open_image
from pgm_places.maps.components import connected_components
from pgm_places.maps.occupancy_grid import FREE, OCCUPIED, UNKNOWN, OccupancyGrid

EMPTY, FURNISHED = "empty", "furnished"
LEAST_PIXELS = 101
"""Smaller rooms are left out, as the published evaluation does: true ones and found ones."""

_TRUTH, _FURNITURE = "_gt_segmentation.png", "_furnitures"
_FREE_FROM, _OCCUPIED_TO = 251, 127
_RESOLUTION_M = 0.05


@dataclass(frozen=True, eq=False)
class RoomMap:
    """A map of the benchmark.

    Parameters
    ----------
    name : str
    kind : str
        ``EMPTY`` or ``FURNISHED``.
    grid : OccupancyGrid
    rooms : (H, W) int32
        Number of the true room that each cell is in, in the grid's order, -1 for none.
    """

    name: str
    kind: str
    grid: OccupancyGrid
    rooms: NDArray[np.int32]


def read_room_maps(folder: Path, resolution_m: float = _RESOLUTION_M) -> Iterator[RoomMap]:
    """The maps of a folder that have a ground truth, by name, empty before furnished.

    Raises
    ------
    MapError
        The folder has none, or an image is damaged or not of the size of its ground truth.
    """
    pairs = list(_pairs(folder))
    if not pairs:
        raise MapError(
            f"{folder} has no map with its rooms: wanted NAME.png or NAME{_FURNITURE}.png next to "
            f"NAME{_TRUTH}, as in common/files/test_maps of the package ipa_room_segmentation"
        )
    for name, kind, path, truth_path in pairs:
        grey, truth = _greys(path), _greys(truth_path)
        if grey.shape != truth.shape:
            raise MapError(
                f"{truth_path} has {truth.shape[1]} x {truth.shape[0]} pixels, but {path.name} "
                f"{grey.shape[1]} x {grey.shape[0]}; they must be of one size"
            )
        cells = np.full(grey.shape, UNKNOWN, np.int8)
        cells[grey >= _FREE_FROM], cells[grey <= _OCCUPIED_TO] = FREE, OCCUPIED
        found = connected_components(truth >= _FREE_FROM)
        large = found.size >= LEAST_PIXELS
        number = np.where(large, np.cumsum(large) - 1, -1).astype(np.int32)
        yield RoomMap(
            name, kind, OccupancyGrid(cells, resolution_m), found.on_cells(number, np.int32(-1))
        )


def _pairs(folder: Path) -> Iterator[tuple[str, str, Path, Path]]:
    """Name, kind, image and ground truth of each map."""
    if not folder.is_dir():
        raise MapError(f"{folder} is no folder; name the one that holds the maps")
    for truth in sorted(folder.glob(f"*{_TRUTH}")):
        name = truth.name.removesuffix(_TRUTH)
        for kind, ending in ((EMPTY, ""), (FURNISHED, _FURNITURE)):
            path = folder / f"{name}{ending}.png"
            if path.exists():
                yield name, kind, path, truth


def _greys(path: Path) -> NDArray[np.uint8]:
    """(H, W) greys from 0 to 255, row 0 at the bottom."""
    with open_image(path, MapError) as image:
        strips = [strip.channels.mean(axis=2).round() for strip in image.strips()]
    return np.concatenate(strips).astype(np.uint8)[::-1]
