"""Section 7.2: six kinds of places along a drive, by laser and vision, with and without a model."""

import csv
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import product
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from experiments.paper.confusion_picture import confusion_picture
from experiments.paper.figures import percent
from experiments.paper.furnished_floors import DETECTORS, Floor, make_floor
from experiments.paper.scored_steps import ALONE, MODES, ScoredSteps, scored_modes, step_labeler
from experiments.paper.section import Outcome, Picture, Table
from experiments.paper.setting import AS_PRINTED, WAYS, Setting
from pgm_places.features.object_counts import PAPER_OBJECTS
from pgm_places.io.logs.trajectories import read_trajectory
from pgm_places.io.maps.label_image import load_labels
from pgm_places.io.maps.map_server import load_map
from pgm_places.io.maps.regions import load_regions
from pgm_places.labelers.tracking import Track
from pgm_places.maps.labelled_map import LabelledMap
from pgm_places.pictures.map_pictures import path_map
from pgm_places.report.track_page import belief_plot
from pgm_places.trajectories.similarity import Similarity
from pgm_places.trajectories.trajectory import Trajectory
from pgm_places.unary.options import ClassifierOptions

PLACES = ("corridor", "room", "doorway")

CATEGORIES: Mapping[str, str] = {
    "CR": "corridor",
    "DW": "doorway",
    "KT": "kitchen",
    "1PO": "office",
    "2PO": "office",
    "LO": "large office",
    "PT": "printer area",
}

CATEGORY_NAMES = tuple(dict.fromkeys(CATEGORIES.values()))

NO_RETURN_M = 80.0  # the log writes 81.83 and 81.91

CUT_COLUMN = 366

CELLS_KEPT = 0.25  # of the training cells, at random: neighbouring cells look alike


@dataclass(frozen=True, eq=False)
class Building79:
    """The log with its labels, and which steps lie left of the cut; the left half of the map."""

    path: Trajectory
    category: NDArray[np.int64]
    left: NDArray[np.bool_]
    map: LabelledMap
    training_map: LabelledMap

    @property
    def place(self) -> NDArray[np.int64]:
        """(T,) index into PLACES, -1 where unknown."""
        assert self.path.labels is not None
        return self.path.labels


def load_building79(data: Path) -> Building79:
    """The map, its labels, the log and the log's labels."""
    folder = data / "freiburg079"
    grid = load_map(folder / "map.yaml").grid
    labels = load_labels(folder / "labels.png", PLACES, grid=grid)
    complete = LabelledMap(grid, labels, name="building 79")
    log = read_trajectory(folder / "laser.log.gz", range_max_m=NO_RETURN_M).trajectory
    path = log.transformed(_log_to_map(grid.shape[0]))
    with (folder / "scan_labels.csv").open(newline="", encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    place = [PLACES.index(row["place"]) if row["place"] else -1 for row in rows]
    category = [
        CATEGORY_NAMES.index(CATEGORIES[row["category"]]) if row["category"] else -1 for row in rows
    ]
    chosen = np.random.default_rng(0).random(grid.shape) < CELLS_KEPT
    window = np.zeros(grid.shape, np.bool_)
    window[:, :CUT_COLUMN] = True
    return Building79(
        path.with_labels(np.array(place), PLACES),
        np.array(category),
        path.poses[:, 0] < CUT_COLUMN * grid.resolution_m,
        complete,
        LabelledMap(grid, np.where(chosen, labels, -1).astype(np.int16), window, "left half"),
    )


def _log_to_map(height: int) -> Similarity:
    """From the log's frame to the map's: the registration that comes with the data."""
    per_cell = np.array([19.8359, 1.596]) * 0.05
    return Similarity(
        float(np.arctan2(per_cell[1], per_cell[0])),
        (492.7 * 0.05, (height - 135.37) * 0.05),
        float(np.hypot(*per_cell)),
    )


PAPER = {ALONE: 0.754, "filter": 0.912}

SHOWN = "laser, fair detector"
"""The detector whose figures are compared with the paper's, which used its own."""

PRINTED_ORDER = (
    "corridor", "doorway", "kitchen", "laboratory", "large office", "seminar room", "printer area",
    "office",
)  # fmt: skip
"""The paper's list, with our categories in the places of its laboratory and its seminar room."""

SMOOTHED = MODES["smooth"]

FURNISHING_79: Mapping[str, Mapping[str, tuple[int, int]]] = {
    "office": {
        "monitor on": (0, 2),
        "monitor off": (0, 2),
        "office cupboard": (1, 2),
        "frontal face": (0, 1),
    },
    "large office": {"monitor on": (2, 6), "monitor off": (1, 3), "office cupboard": (1, 3)},
    "kitchen": {"coffee machine": (1, 2), "office cupboard": (0, 1), "upper human body": (0, 1)},
    "printer area": {"office cupboard": (1, 2), "upper human body": (0, 1)},
    "corridor": {"full human body": (0, 2)},
}
"""The objects placed in building 79; the data set does not record the real ones."""

LEARN_SEEDS, LABEL_SEEDS = (1, 2), (11,)
"""Of the generated buildings that stand in."""


def run(
    setting: Setting, detectors: Mapping[str, Mapping[str, float] | None] = DETECTORS
) -> Outcome:
    """Laser alone and with simulated detectors of several qualities."""
    with setting.progress.stage("drives"):
        if setting.data is None:
            learn = [make_floor(seed) for seed in LEARN_SEEDS]
            label = [make_floor(seed) for seed in LABEL_SEEDS]
        else:
            learn, label = _building79(setting.data)
    found = {}
    for way, (name, options) in product(WAYS, detectors.items()):
        with setting.progress.stage(f"{name}, {way}"):
            found[way, name] = _scored(way, learn, label, options, setting.n_threads)
    findings = [
        steps.finding(
            f"six categories, {name}, {mode}",
            way,
            paper=PAPER.get(mode) if name == SHOWN else None,
        )
        for (way, name), modes in found.items()
        for mode, steps in modes.items()
        if name in ("laser alone", SHOWN) and mode != MODES["viterbi"]
    ]
    names = label[0].names
    shown = found[AS_PRINTED, SHOWN]
    return Outcome(
        setting=_words(learn, label, real=setting.data is not None),
        findings=tuple(findings),
        tables=(_table(found, names),),
        pictures=(
            Picture("true.png", "Ground truth of the drive to be labelled."),
            Picture("labelled.png", f"The same by the {SMOOTHED}, fair detector (paper, Fig. 8)."),
            Picture("beliefs.png", f"Beliefs of the {SMOOTHED} along the path."),
            Picture("confusion.png", "Confusion between categories."),
        ),
        files=_pictures(label[0], shown[SMOOTHED]),
        remarks=(
            "The objects are placed in the map and seen by a simulated detector: the fair one "
            "misses 30 % of the objects in an image and reports 0.04 false objects of each class "
            "per observation, the poor one 60 % and 0.16; the perfect one makes no errors.",
        ),
    )


def _building79(data: Path) -> tuple[list[Floor], list[Floor]]:
    """The real log in its own frame: its right half to learn from, its left half to label."""
    building = load_building79(data)
    folder = data / "freiburg079"
    log = read_trajectory(folder / "laser.log.gz", range_max_m=NO_RETURN_M).trajectory
    grid = load_map(folder / "log_map.yaml").grid
    raster = load_regions(folder / "log_regions.geojson", CATEGORY_NAMES, grid, classes=_classes())

    def half(chosen: np.ndarray) -> list[Floor]:
        drive = log.with_labels(np.where(chosen, building.category, -1), CATEGORY_NAMES)
        return [Floor(grid, raster, drive, CATEGORY_NAMES, FURNISHING_79)]

    return half(~building.left), half(building.left)


def _classes() -> dict[str, str]:
    """The categories of the polygons; categories that the drive did not see have none."""
    return {"BA": "", "ST": "", "PA": "", "EV": "", "CF": "", "RL": "", "TR": "", **CATEGORIES}


def _scored(
    way: str,
    learn: Sequence[Floor],
    label: Sequence[Floor],
    options: Mapping[str, float] | None,
    n_threads: int | None,
) -> dict[str, ScoredSteps]:
    extra = None if options is None else [item.counts(options, k) for k, item in enumerate(learn)]
    extra_names = () if extra is None else PAPER_OBJECTS
    names, printed = learn[0].names, {}
    if way == AS_PRINTED:
        order = tuple(name for name in PRINTED_ORDER if name in names)
        printed["classifier"] = ClassifierOptions(order=order, prior_weight=0.0).classifier(names)
    labeler = step_labeler(way, names, extra_names=extra_names, **printed).fit(
        [], [item.drive for item in learn], extra=extra, n_threads=n_threads
    )
    scores = []
    for k, item in enumerate(label):
        # One building has one set of objects, whichever part of it is labelled.
        seed = k if item.grid is learn[0].grid else 100 + k
        counts = None if options is None else item.counts(options, seed)
        scores.append(labeler.scores(item.drive, extra=counts, n_threads=n_threads))
    return scored_modes(labeler, [item.drive for item in label], scores)


def _table(
    found: Mapping[tuple[str, str], Mapping[str, ScoredSteps]], names: tuple[str, ...]
) -> Table:
    heading = ("options", "features", "steps", "all", "balanced", *names)
    rows = [
        (
            way,
            name,
            mode,
            percent(steps.evaluation.accuracy),
            percent(steps.evaluation.balanced_accuracy),
            *(percent(steps.evaluation.recall[item]) for item in names),
        )
        for (way, name), modes in found.items()
        for mode, steps in modes.items()
    ]
    return Table("Correct steps in percent, overall and by category", heading, tuple(rows))


def _pictures(floor: Floor, steps: ScoredSteps) -> dict[str, bytes]:
    drive, labeling = floor.drive, steps.labelings[0]
    assert drive.labels is not None  # drives to be scored have some
    known = drive.labels >= 0
    positions = drive.poses[:, :2]
    shown = np.where(known, labeling.labels, -1)
    beliefs = None if labeling.beliefs is None else labeling.beliefs[known]
    half = replace(labeling, labels=labeling.labels[known], beliefs=beliefs)
    track = Track(drive.subset(known), half, floor.names)
    found = steps.evaluation.confusion
    occurring = np.flatnonzero(found.sum(axis=0) + found.sum(axis=1))
    return {
        "true.png": path_map(floor.grid, positions, drive.labels, floor.names),
        "labelled.png": path_map(floor.grid, positions, shown, floor.names),
        "beliefs.png": belief_plot(track),
        "confusion.png": confusion_picture(
            found[np.ix_(occurring, occurring)], [floor.names[k] for k in occurring]
        ),
    }


def _words(learn: Sequence[Floor], label: Sequence[Floor], *, real: bool) -> str:
    n_learn, n_label = (
        sum(int((item.drive.labels >= 0).sum()) for item in part if item.drive.labels is not None)
        for part in (learn, label)
    )
    if real:
        return (
            f"The log of building 79: {n_learn:,} labelled training scans in its right half, "
            f"{n_label:,} test scans in its left half, a 180 degree laser, rear beams from the "
            "local map; corridor, doorway, kitchen, office, large office and printer area."
        )
    return (
        f"Simulated drives: {n_learn:,} training steps in {len(learn)} buildings, {n_label:,} test "
        f"steps in {len(label)} others, a 360° laser."
    )
