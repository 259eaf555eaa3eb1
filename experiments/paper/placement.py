"""Objects placed in a labelled map: monitors in offices, coffee machines in kitchens."""

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import ArrayLike

from experiments.paper.simulated_detector import PlacedObjects
from pgm_places._checks import label_raster
from pgm_places.errors import InputError, nearest_name
from pgm_places.maps.components import connected_components
from pgm_places.maps.occupancy_grid import OccupancyGrid


def place_objects(
    grid: OccupancyGrid,
    labels: ArrayLike,
    label_names: Sequence[str],
    furnishing: Mapping[str, Mapping[str, tuple[int, int]]],
    *,
    seed: int = 0,
    min_area_m2: float = 1.0,
) -> PlacedObjects:
    """Objects at random free cells of the places that they belong to.

    Parameters
    ----------
    grid : OccupancyGrid
    labels : (H, W) int
        Label per cell, -1 for none; each connected region of a label is a place.
    label_names : sequence of str
    furnishing : mapping
        For a label, how many of an object each place of it gets: ``{"kitchen": {"coffee machine":
        (1, 2)}}``, both included, drawn for each place.
    seed : int
    min_area_m2 : float
        Smaller regions stay empty.

    Raises
    ------
    InputError
        An unknown label, or numbers that are no range.

    Examples
    --------
    >>> grid = OccupancyGrid(np.zeros((4, 4), np.int8), resolution_m=1.0)
    >>> wanted = {"kitchen": {"coffee machine": (1, 1)}}
    >>> placed = place_objects(grid, np.zeros((4, 4), int), ["kitchen"], wanted)
    >>> placed.object_names, len(placed)
    (('coffee machine',), 1)
    """
    names = list(label_names)
    raster = label_raster("labels", labels, grid.shape, n_labels=len(names))
    objects = _object_names(names, furnishing)
    generator = np.random.default_rng(seed)
    pieces = connected_components(np.where(grid.free, raster, np.int16(-1)))
    cells: list[np.ndarray] = []
    kinds: list[int] = []
    for number in range(pieces.count):
        wanted = furnishing.get(names[pieces.label[number]], {})
        if not wanted or pieces.size[number] * grid.resolution_m**2 < min_area_m2:
            continue
        inside = np.argwhere(pieces.piece == number)
        for name, (least, most) in wanted.items():
            n_objects = int(generator.integers(least, most, endpoint=True))
            cells.append(inside[generator.integers(0, len(inside), n_objects)])
            kinds += [objects.index(name)] * n_objects
    where = np.concatenate([np.zeros((0, 2), np.int64), *cells])
    return PlacedObjects(grid.cell_centres_m(where), np.array(kinds, np.int64), objects)


def _object_names(
    label_names: list[str], furnishing: Mapping[str, Mapping[str, tuple[int, int]]]
) -> tuple[str, ...]:
    """Every object that is wanted anywhere, in the order of first mention."""
    objects: dict[str, None] = {}
    for label, wanted in furnishing.items():
        if label not in label_names:
            raise InputError(f"no label is called {label!r}. {nearest_name(label, label_names)}")
        for name, (least, most) in wanted.items():
            if not 0 <= least <= most:
                raise InputError(
                    f"{label}, {name}: how many must be (least, most) from 0, got {(least, most)}"
                )
            objects[name] = None
    return tuple(objects)
