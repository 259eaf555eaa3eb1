"""The labelled maps of all available buildings, by kind, and samples of their cells."""

import csv
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from experiments.kept import KeptArrays, fingerprint
from experiments.paper.front_laser import PLACES, place_classes
from experiments.paper.setting import Setting
from pgm_places._version import __version__
from pgm_places.datasets import generate_building, simulate_map
from pgm_places.io.maps.label_image import load_labels
from pgm_places.io.maps.map_server import load_map
from pgm_places.io.maps.regions import load_regions
from pgm_places.kernels.threads import thread_limit
from pgm_places.maps.coarsening import coarsen, coarsen_labels
from pgm_places.maps.labelled_map import LabelledMap
from pgm_places.maps.occupancy_grid import OccupancyGrid
from pgm_places.sensing.sensor import Sensor
from pgm_places.unary.halls import HallNames
from pgm_places.unary.training_cells import training_features

NAMES = PLACES
WITH_HALLS = HallNames((*PLACES, "hall"))
"""The labels that are learned; in tests, halls count as corridors."""

CELLS_M = 0.05
"""The cell size to which finer maps are coarsened, and that of robot-like copies."""

EXAMPLES_PER_MAP = 1000
LATTICE_STEP = 4
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

STAND_INS = ("school", "office", "school", "office", "school", "office")
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


@dataclass(frozen=True, eq=False)
class Sample:
    """Some labelled cells of a map: examples to train on, and a lattice to test on.

    Parameters
    ----------
    known : KnownMap
    kept : KeptArrays
        Where their features are.
    stem : str
        The name of the features' files.
    """

    known: KnownMap
    kept: KeptArrays
    stem: str

    @property
    def examples(self) -> NDArray[np.bool_]:
        """(H, W) at most ``EXAMPLES_PER_MAP`` labelled cells, drawn at random."""
        mask = self.known.item.labelled_cells
        cells = np.flatnonzero(mask)
        some = np.random.default_rng(0).permutation(len(cells))[:EXAMPLES_PER_MAP]
        found = np.zeros(mask.size, np.bool_)
        found[cells[some]] = True
        return found.reshape(mask.shape)

    @property
    def lattice(self) -> NDArray[np.bool_]:
        """(H, W) the labelled cells of every fourth row and column."""
        found = np.zeros(self.known.item.labels.shape, np.bool_)
        found[::LATTICE_STEP, ::LATTICE_STEP] = True
        return found & self.known.item.labelled_cells

    def example_features(self, n_threads: int | None = None) -> NDArray[np.float32]:
        """(n, 321) laser features of the examples in row-major order."""
        return self._features("examples", self.examples, n_threads)

    def lattice_features(self, n_threads: int | None = None) -> NDArray[np.float32]:
        """(m, 321) laser features of the lattice in row-major order."""
        return self._features("lattice", self.lattice, n_threads)

    def _features(
        self, part: str, mask: NDArray[np.bool_], n_threads: int | None
    ) -> NDArray[np.float32]:
        def make() -> dict[str, NDArray[np.float32]]:
            maps = [self.known.item]
            with thread_limit(n_threads):
                return {"x": training_features(maps, Sensor(), masks=[mask])}

        return self.kept.arrays(f"{self.stem}-{part}", make)["x"]


def sampled_maps(setting: Setting) -> list[Sample]:
    """All maps, their robot-like copies and generated buildings, ready for training."""
    kept, found = KeptArrays(setting.kept), []
    with setting.progress.stage("maps, robot-like copies and features") as stage:
        plans = [*(_stand_ins() if setting.data is None else real_maps(setting.data))]
        plans += _generated()
        for number, known in enumerate(plans):
            for each in _with_copy(known, number, kept):
                found.append(sampled(each, kept))
                found[-1].example_features(setting.n_threads)
            stage.update((number + 1) / len(plans), known.item.name)
    return found


def known_maps(data: Path, kept: KeptArrays) -> Iterator[KnownMap]:
    """Every labelled map of the real data with its robot-like copy, then the generated ones."""
    for number, known in enumerate([*real_maps(data), *_generated()]):
        yield from _with_copy(known, number, kept)


def _with_copy(known: KnownMap, number: int, kept: KeptArrays) -> Iterator[KnownMap]:
    yield known
    if known.source == DRAWN and known.kind in _COPIED:
        yield _robot_like(known, number + 1, kept)


_COPIED = ("school", "office")


def sampled(known: KnownMap, kept: KeptArrays) -> Sample:
    """The sample of a map; its features are computed on first use, and kept."""
    grid = known.item.grid
    sampling = (__version__, EXAMPLES_PER_MAP, LATTICE_STEP, grid.resolution_m)
    return Sample(known, kept, fingerprint(sampling, grid.cells, known.item.labels))


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


def _stand_ins() -> Iterator[KnownMap]:
    for number, style in enumerate(STAND_INS):
        made = generate_building(100 + number, style=style, furniture=False, slam_noise=False)  # type: ignore[arg-type]
        yield KnownMap(LabelledMap(made.grid, made.labels, None, made.name), style, DRAWN)


def _generated() -> Iterator[KnownMap]:
    wanted = [style for style in GENERATED_STYLES for _ in range(PER_STYLE)]
    for seed, style in enumerate(wanted, start=1):
        drawn = {} if seed % 2 else {"furniture": False, "slam_noise": False}
        made = generate_building(seed, style=style, halls="hall", **drawn)  # type: ignore[arg-type]
        item = LabelledMap(made.grid, made.labels, None, f"generated {style} {seed}")
        yield KnownMap.of(item, style, GENERATED)


def _robot_like(plan: KnownMap, seed: int, kept: KeptArrays) -> KnownMap:
    """The map that a robot would have made of a drawn floor."""

    def make() -> dict[str, NDArray[np.generic]]:
        named = replace(plan.item, labels=plan.finer)
        made = simulate_map(named, WITH_HALLS.names, seed=seed, resolution_m=CELLS_M)
        resolution = np.array([made.grid.resolution_m])
        return {"cells": made.grid.cells, "labels": made.labels, "resolution": resolution}

    stem = fingerprint(__version__, seed, CELLS_M, plan.item.grid.cells, plan.finer)
    found = kept.arrays(f"{stem}-robot-like", make)
    grid = OccupancyGrid(found["cells"], float(found["resolution"][0]))
    name = f"{plan.item.name}, simulated"
    item = LabelledMap(grid, found["labels"], None, name, plan.building)
    return KnownMap.of(item, plan.kind, SIMULATED)


def building_numbers(samples: Sequence[Sample], n_folds: int) -> NDArray[np.int64]:
    """(M,) fold of each map: whole buildings, the kinds spread evenly; ``n_folds`` if generated."""
    tested = {(each.known.kind, each.known.building) for each in samples if _is_tested(each)}
    first = {building: kind for kind, building in sorted(tested, reverse=True)}
    order = sorted(first, key=lambda building: (first[building], building))
    fold = {building: number % n_folds for number, building in enumerate(order)}
    return np.array(
        [fold[each.known.building] if _is_tested(each) else n_folds for each in samples], np.int64
    )


def _is_tested(sample: Sample) -> bool:
    return sample.known.source != GENERATED
