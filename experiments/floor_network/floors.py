"""The floors that the network learns from: rasters with labels, weights and folds of buildings."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from experiments.known_maps import GENERATED_STYLES, NAMES, WITH_HALLS, KnownMap, real_maps
from experiments.robot_maps.catalogue import declared
from pgm_places.io.atomic import atomic_file
from pgm_places.io.maps.label_image import load_labels
from pgm_places.io.maps.map_server import load_map
from pgm_places.maps.labelled_map import LabelledMap
from pgm_places.progress import Progress
from pgm_places.simulation import MapSimulation, generate_building, simulate_map
from pgm_places.spaces.doorways import true_doors
from pgm_places.training.labelled_raster import labelled_raster

N_FOLDS = 4
SINGLE_SPACES = (
    "arena_multifloor",
    "bookstore_aws",
    "flat_movecare",
    "home_envinav",
    "house_aws",
    "lab_aalborg",
    "lab_fansaorz_desks",
    "lab_hv",
    "lab_urjc",
    "lab_nursing",
    "lecture_hall_ecn",
    "office_attraclab",
    "warehouse_aws",
    "warehouse_sendbooster",
    "warehouse_uom",
)
UNSURE = {"floor_uom": 0.4, "hall_upo": 0.4, "lab_ecn": 0.4, **dict.fromkeys(SINGLE_SPACES, 0.3)}
"""How often a robot's map is drawn, against 1: those with unsure labels, and single rooms."""

DOORWAY_DEPTH_M = 0.8
"""The depth of doorways on drawn floors; 0.7 to 0.75 on other real maps, 0.3 to 0.5 on robots'."""

KINDS_TOGETHER = (
    ("cells", "home", "hotel", "apartment"),
    ("clinic", "university", "hall", "museum", "atrium"),
    ("mall", "open-plan", "suite", "lab", "passage"),
    ("ring", "school", "office", "varied"),
)
"""Generated kinds that resemble each other are left out together, one row in each fold."""

ROBOT = MapSimulation(scale=(0.8, 1.25), coverage=(0.6, 1.0))
COPIES, PER_STYLE, EFFECTS = 5, 16, 800
NEW_KINDS = ("apartment", "lab", "passage", "atrium")
"""Kinds that no list has learned from."""


def _effects(seed: int) -> MapSimulation:
    """What robots' maps show of buildings: each effect in some of the maps."""
    rng = np.random.default_rng([seed, 77])

    def some(share: float, most: float) -> tuple[float, float]:
        return (0.0, most if rng.random() < share else 0.0)

    return MapSimulation(
        furniture=(0.0, 1.3),
        corridor_furniture=(0.0, 2.0),
        coverage=(0.5, 1.0) if rng.random() < 0.5 else (0.9, 1.0),
        entered_rooms=(0.2, 1.0),
        reach_m=(4.0, 16.0),
        pose_noise_m=(0.0, 0.15),
        bend=(0.0, 0.04),
        oblique=0.6,
        windows=some(0.75, 0.5),
        glass_fronts=some(0.35, 0.3),
        closed_doors=some(0.6, 0.8),
        large_furniture=some(0.8, 1.5),
        slip_m=some(0.25, 0.5),
        least_seen=0.45,
    )


@dataclass(frozen=True)
class Floor:
    """A labelled floor to learn from.

    Parameters
    ----------
    name : str
    source : {"robot", "real", "drawn", "simulated", "generated", "generated-robot", "effects"}
    building : str
        Floors of one building are in one fold.
    weight : float
        How often it is drawn among those of its source.
    load : callable
        Makes the labelled map; its labels are those of ``WITH_HALLS``.
    tells_halls : bool
        Whether halls have a label of their own.
    """

    name: str
    source: str
    building: str
    weight: float
    load: Callable[[], LabelledMap]
    tells_halls: bool = True

    def arrays(self) -> dict[str, NDArray[np.uint8]]:
        """See :func:`pgm_places.training.labelled_raster.labelled_raster`."""
        names = WITH_HALLS.names if self.tells_halls else NAMES
        return labelled_raster(self.load(), names)


def all_floors(data: Path) -> Iterator[Floor]:
    """Maps that robots made, real and drawn floors, and generated buildings, easiest first."""
    yield from _robots(data)
    plans = list(_real(data))
    yield from plans
    for copy in range(COPIES):
        for number, plan in enumerate(plans):
            if plan.source == "drawn":
                yield _robot_copy(plan, 1000 * copy + number, "simulated")
        for number, style in enumerate(GENERATED_STYLES):
            for k in range(PER_STYLE // COPIES + 1):
                seed = 20_000 + 1000 * copy + 20 * k + number
                plan = _generated(style, seed)
                yield plan
                yield _robot_copy(plan, seed, "generated-robot")
    for number in range(EFFECTS):
        style = (*NEW_KINDS, *NEW_KINDS, *GENERATED_STYLES)[number % (8 + len(GENERATED_STYLES))]
        plan = _generated(style, 30_000 + number)
        yield _robot_copy(plan, number, "effects", _effects(number))


def _robots(data: Path) -> Iterator[Floor]:
    maps = declared()
    for folder in sorted((data / "robots").iterdir()):
        if not (folder / "map.yaml").exists():
            continue
        name = folder.name

        def load(folder: Path = folder) -> LabelledMap:
            grid = load_map(folder / "map.yaml").grid
            labels = load_labels(folder / "labels.png", WITH_HALLS.names, grid=grid)
            return _deepened(LabelledMap(grid, labels, None, folder.name))

        building = maps[name].building
        yield Floor(f"robot_{name}", "robot", building, UNSURE.get(name, 1.0), load)


def _deepened(known: LabelledMap) -> LabelledMap:
    """The map with doorways as deep as on all other floors: robots' maps have them half as deep."""
    labels, doorway = known.labels.copy(), WITH_HALLS.names.index("doorway")
    for door in true_doors(known, doorway):
        cells = tuple(replace(door, depth_m=max(door.depth_m, DOORWAY_DEPTH_M)).cells(known.grid).T)
        labels[cells] = np.where(labels[cells] < 0, -1, doorway)
    return replace(known, labels=labels)


def held_out_with(known: KnownMap) -> str:
    """The building whose fold a map is in: both buildings of Freiburg are held out together."""
    return "Freiburg 79" if "Freiburg" in known.building else known.building


def _real(data: Path) -> Iterator[Floor]:
    for known in real_maps(data):

        def load(known: KnownMap = known) -> LabelledMap:
            return replace(known.item, labels=known.finer)

        drawn = known.source == "drawn" and known.halls is not None
        source = "drawn" if known.source == "drawn" else "real"
        name = f"{source}_{known.item.name}".replace(" ", "-").replace(",", "")
        yield Floor(name, source, held_out_with(known), 1.0, load, drawn)


def _generated(style: str, seed: int) -> Floor:
    def load() -> LabelledMap:
        clean = {"furniture": False, "slam_noise": False}
        made = generate_building(seed, style=style, halls="hall", **clean)  # type: ignore[arg-type]
        return LabelledMap(made.grid, made.labels, None, f"{style} {seed}")

    return Floor(f"generated_{style}_{seed}", "generated", style, 1.0, load)


def _robot_copy(plan: Floor, seed: int, source: str, options: MapSimulation = ROBOT) -> Floor:
    def load() -> LabelledMap:
        return simulate_map(plan.load(), WITH_HALLS.names, seed=seed, options=options)

    name = f"{source}_{plan.name}_{seed}"
    return Floor(name, source, plan.building, 1.0, load, plan.tells_halls)


def fold_of(floors: list[Floor]) -> dict[str, int]:
    """The fold of each building: by table, or in turn within its source."""
    folds = {kind: k for k, kinds in enumerate(KINDS_TOGETHER) for kind in kinds}
    for source in ("real", "drawn"):
        names = sorted({each.building for each in floors if each.source == source} - set(folds))
        folds |= {name: number % N_FOLDS for number, name in enumerate(names)}
    return folds | {known.building: known.fold for known in declared().values()}


def network_file(kept: Path, fold: int) -> Path:
    """The state of a fold's network while it is trained."""
    return kept / f"network_{fold}.npz"


def write_floors(data: Path, kept: Path, part: tuple[int, int], progress: Progress) -> None:
    """Make the floors that are not there yet; of ``part`` (i, n), every n-th from the i-th on."""
    folder = kept / "floors"
    folder.mkdir(exist_ok=True)
    mine = list(all_floors(data))[part[0] :: part[1]]
    with progress.stage("floors") as stage:
        for count, floor in enumerate(mine, start=1):
            path = folder / f"{floor.name}.npz"
            if not path.exists():
                with atomic_file(path) as temporary, temporary.open("wb") as file:
                    np.savez_compressed(file, **floor.arrays())  # type: ignore[arg-type]
            stage.update(count / len(mine), floor.name)
