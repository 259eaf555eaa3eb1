"""The labelled maps of all available buildings, by kind."""

import csv
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from experiments.array_cache import ArrayCache, fingerprint
from experiments.paper.front_laser import PLACES, place_classes
from pgm_places._version import __version__
from pgm_places.io.maps.label_image import load_labels
from pgm_places.io.maps.map_server import load_map
from pgm_places.io.maps.regions import load_regions
from pgm_places.maps.coarsening import Coarsening, coarsen, coarsen_labels, refine
from pgm_places.maps.labelled_map import LabelledMap
from pgm_places.maps.occupancy_grid import OccupancyGrid
from pgm_places.simulation import generate_building, simulate_map
from pgm_places.unary.halls import HallNames

NAMES = PLACES
DOORWAY = NAMES.index("doorway")
WITH_HALLS = HallNames((*PLACES, "hall"))
"""The labels that are learned; in tests, halls count as corridors."""

CELLS_M = 0.05
"""The cell size to which finer maps are coarsened, and that of robot-like copies."""

GENERATED_STYLES = (
    "office",
    "varied",
    "school",
    "university",
    "clinic",
    "hotel",
    "hall",
    "ring",
    "open-plan",
    "cells",
    "home",
    "mall",
    "museum",
    "suite",
)
"""Generated buildings of these styles are learned from."""

PER_STYLE = 4
"""How many of each style: every other one furnished and mapped by a robot, the rest clean."""

DRAWN, SIMULATED, REAL, GENERATED = "drawn", "simulated SLAM", "real SLAM", "generated"
_CLASSES = place_classes() | {"ST": "room", "EV": "room"}
_FLOOR_CLASSES = {
    "corridor": "corridor",
    "hall": "hall",
    "lobby": "hall",
    "doorway": "doorway",
    "stairs": "",
    "entrance": "",
    "elevator": "",
    "*": "room",
}


@dataclass(frozen=True, eq=False)
class KnownMap:
    """A labelled map and its kind.

    Parameters
    ----------
    item : LabelledMap
    kind : str
        The kind of building, or the building itself if it is the only one of its kind.
    source : str
        The kind of map: drawn, simulated, real, or generated (for training only).
    halls : (H, W) bool, optional
        The corridors that are halls, where that is known.
    """

    item: LabelledMap
    kind: str
    source: str
    halls: NDArray[np.bool_] | None = None

    @classmethod
    def of(cls, named: LabelledMap, kind: str, source: str) -> "KnownMap":
        """The map with halls as a fourth label."""
        return cls(WITH_HALLS.fold(named), kind, source, named.labels == len(NAMES))

    @property
    def finer(self) -> NDArray[np.int16]:
        """(H, W) the labels with halls as a label after the others."""
        if self.halls is None:
            return self.item.labels
        return np.where(self.halls, np.int16(len(NAMES)), self.item.labels)

    @property
    def building(self) -> str:
        """The group of maps that are held out together."""
        return self.item.building or self.item.name

    @property
    def group(self) -> str:
        """The row of the tables to which it belongs."""
        return f"{self.kind}, {self.source}"


def known_maps(data: Path, cache: ArrayCache) -> Iterator[KnownMap]:
    """Every labelled map of the real data with its robot-like copy, then the generated ones."""
    for number, known in enumerate([*real_maps(data), *_generated()]):
        yield from _with_copy(known, number, cache)


def _with_copy(known: KnownMap, number: int, cache: ArrayCache) -> Iterator[KnownMap]:
    yield known
    if known.source == DRAWN and known.kind in _COPIED:
        yield _robot_like(known, number + 1, cache)


_COPIED = ("school", "office")


def real_maps(data: Path) -> Iterator[KnownMap]:
    """Every labelled map of the real data, with its kind."""
    with (data / "floors" / "index.csv").open(encoding="utf-8", newline="") as file:
        floors = list(csv.DictReader(file))
    for row in floors:
        folder, names = data / "floors" / row["floor"], WITH_HALLS.names
        grid = load_map(folder / "map.yaml").grid
        labels = load_labels(folder / "fine.png", names, grid=grid, classes=_FLOOR_CLASSES)
        item = LabelledMap(grid, labels, None, row["floor"], row["building"])
        yield KnownMap.of(item, row["floor"].partition("_")[0], DRAWN)
    one = "Freiburg 79"
    yield KnownMap(_with_image(data / "freiburg079", "building 79", one), "building 79", REAL)
    drawn = _with_image(data / "freiburg079_drawn", "building 79, redrawn", one)
    yield KnownMap(drawn, "building 79", DRAWN)
    item = _with_image(data / "freiburg052", "building 52", "Freiburg 52")
    yield KnownMap(item, "building 52", REAL)
    for town, building in (("freiburg", one), ("saarbrucken", "Saarbrücken")):
        for folder in sorted(data.glob(f"cold_{town}_*")):
            yield KnownMap(_with_regions(folder, building), f"COLD {building.split()[0]}", REAL)


def _with_image(folder: Path, name: str, building: str) -> LabelledMap:
    grid = load_map(folder / "map.yaml").grid
    labels = load_labels(folder / "labels.png", NAMES, grid=grid)
    return LabelledMap(grid, labels, None, name, building)


def _with_regions(folder: Path, building: str) -> LabelledMap:
    grid = load_map(folder / "map.yaml").grid
    labels = load_regions(folder / "regions.geojson", NAMES, grid, classes=_CLASSES)
    coarse = coarsen(grid, CELLS_M)
    return LabelledMap(coarse, coarsen_labels(labels, grid, coarse), None, folder.name, building)


def _generated() -> Iterator[KnownMap]:
    wanted = [style for style in GENERATED_STYLES for _ in range(PER_STYLE)]
    for seed, style in enumerate(wanted, start=1):
        drawn = {} if seed % 2 else {"furniture": False, "slam_noise": False}
        made = generate_building(seed, style=style, halls="hall", **drawn)  # type: ignore[arg-type]
        item = LabelledMap(made.grid, made.labels, None, f"generated {style} {seed}")
        yield KnownMap.of(item, style, GENERATED)


def _robot_like(plan: KnownMap, seed: int, cache: ArrayCache) -> KnownMap:
    """The map that a robot would have made of a drawn floor."""

    def make() -> dict[str, NDArray[np.generic]]:
        named = replace(plan.item, labels=plan.finer)
        made = simulate_map(named, WITH_HALLS.names, seed=seed, resolution_m=CELLS_M)
        resolution = np.array([made.grid.resolution_m])
        return {"cells": made.grid.cells, "labels": made.labels, "resolution": resolution}

    stem = fingerprint(__version__, seed, CELLS_M, plan.item.grid.cells, plan.finer)
    arrays = cache.arrays(f"{stem}-robot-like", make)
    grid = OccupancyGrid(arrays["cells"], float(arrays["resolution"][0]))
    name = f"{plan.item.name}, simulated"
    item = LabelledMap(grid, arrays["labels"], None, name, plan.building)
    return KnownMap.of(item, plan.kind, SIMULATED)


def at_model_cells(item: LabelledMap) -> LabelledMap:
    """The map with the cells that models are trained at, as labelling does it."""
    if item.grid.resolution_m < CELLS_M:
        grid = coarsen(item.grid, CELLS_M)
        return replace(item, grid=grid, labels=coarsen_labels(item.labels, item.grid, grid))
    grid = refine(item.grid, CELLS_M)
    if grid is item.grid:
        return item
    cells = np.argwhere(grid.free)
    labels = np.full(grid.shape, -1, np.int16)
    labels[tuple(cells.T)] = item.labels[tuple(Coarsening(grid, item.grid).holders(cells).T)]
    return replace(item, grid=grid, labels=labels)
