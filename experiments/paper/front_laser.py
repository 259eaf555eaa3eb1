"""Section 7.6: a laser with a half-circle view, on a floor not used in training."""

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import product
from pathlib import Path

import numpy as np

from experiments.paper.figures import DOORWAY, percent
from experiments.paper.scored_steps import ALONE, ScoredSteps, scored_modes, step_labeler
from experiments.paper.section import Outcome, Picture, Table
from experiments.paper.setting import AS_PRINTED, STAND_INS, WAYS, Setting
from pgm_places.errors import ConfigError
from pgm_places.io.logs.pose_csv import read_pose_csv
from pgm_places.io.maps.map_server import load_map
from pgm_places.io.maps.regions import load_regions
from pgm_places.labelers.tracking import Track
from pgm_places.labelers.trajectory_labeler import REACH_M
from pgm_places.maps.coarsening import coarsen
from pgm_places.maps.labelled_map import LabelledMap
from pgm_places.maps.occupancy_grid import OccupancyGrid
from pgm_places.pictures.map_pictures import path_map
from pgm_places.report.track_page import belief_plot
from pgm_places.sensing.sensor import SensorNoise
from pgm_places.simulation import generate_building
from pgm_places.simulation.simulated_robot import SimulatedRobot, scans_along
from pgm_places.trajectories.scan import ScanGeometry
from pgm_places.trajectories.trajectory import Trajectory
from pgm_places.unary.scan_model import BeamOptions

CLASSES: Mapping[str, str] = {
    "CR": "corridor",
    "DW": "doorway",
    "KT": "kitchen",
    "1PO": "office",
    "2PO": "office",
    "BA": "bathroom",
    "PT": "printer area",
    "PA": "printer area",
}

NAMES = tuple(dict.fromkeys(CLASSES.values()))

PLACES = ("corridor", "room", "doorway")

RESOLUTION_M = 0.1

STEP_M = 0.1
"""Recorded positions are a metre apart, far more than a robot drives between two updates."""


def place_of(name: str) -> str:
    """The place that a category belongs to."""
    return name if name in ("corridor", "doorway") else "room"


def place_classes() -> dict[str, str]:
    """The places of all classes of the campaign, by their codes."""
    codes = ("LO", "CF", "RL", "TR", "AT", "LMR", "LR", "MPO", "MR", "PRO", "WS")
    others = dict.fromkeys(codes, "room")
    return {code: place_of(name) for code, name in CLASSES.items()} | others


def load_cold_folder(
    folder: Path,
    classes: Mapping[str, str],
    names: tuple[str, ...],
    resolution_m: float = RESOLUTION_M,
) -> tuple[LabelledMap, list[Trajectory]]:
    """A labelled map with cells of that size, and the runs that were recorded in it."""
    grid = coarsen(load_map(folder / "map.yaml").grid, resolution_m)
    regions = folder / "regions.geojson"
    every = {code: classes.get(code, "") for code in _codes(regions)}
    known = LabelledMap(grid, load_regions(regions, names, grid, classes=every), name=folder.name)
    runs = []
    for table in sorted(folder.glob("trajectory_*.csv")):
        run = read_pose_csv(table, label_column="label").trajectory
        assert run.labels is not None and run.label_names is not None
        codes = [run.label_names[k] if k >= 0 else "" for k in run.labels]
        labels = [names.index(classes[c]) if c in classes else -1 for c in codes]
        runs.append(run.with_labels(np.array(labels), names))
    return known, runs


def _codes(path: Path) -> set[str]:
    features = json.loads(path.read_text(encoding="utf-8"))["features"]
    return {feature["properties"]["class"] for feature in features}


PAPER = 0.844

FLOORS: Mapping[str, tuple[str, ...]] = {
    "A": ("cold_saarbrucken_seq1", "cold_saarbrucken_seq2"),
    "B": ("cold_saarbrucken_seq3", "cold_saarbrucken_seq4"),
}
"""Two parts of one building, and the maps of each."""

DIRECTIONS = (("A", "B"), ("B", "A"))

KTH: Mapping[str, tuple[str, ...]] = {
    "floor 6": ("cold_stockholm_floor6",),
    "floor 7": ("cold_stockholm_floor7",),
}
"""The paper's floors, in COLD-Stockholm."""

MOST_RUNS = 3

SIGMA_M = 0.02

BEAMS: Mapping[str, BeamOptions] = {
    "front only": BeamOptions("max-range"),
    "rear: mirror image": BeamOptions("mirror"),
    "rear: local map": BeamOptions(),
}

SHOWN = "rear: local map"

SMOOTHED = "smoother"


@dataclass(frozen=True, eq=False)
class Run:
    """A drive with scans and true places, and the map of its floor."""

    grid: OccupancyGrid
    drive: Trajectory


def run(
    setting: Setting,
    beams: Mapping[str, BeamOptions] = BEAMS,
    directions: Sequence[tuple[str, ...]] = DIRECTIONS,
) -> Outcome:
    """From one part of a building to another, instead of the paper's floors."""
    what = "Runs of the COLD campaign in Saarbrücken, from one part of the building to another"
    if setting.data is None:
        what = "Simulated drives, from two buildings to two others"
    remark = (
        "A has large rooms and a lobby that is labelled corridor, B has neither: a model "
        "trained in B recognises only a third of the steps in A's rooms.",
    )
    return _outcome(setting, what, FLOORS, directions, beams, remark if setting.data else ())


def kth(setting: Setting, beams: Mapping[str, BeamOptions] = BEAMS) -> Outcome:
    """From the 6th floor to the 7th, as in the paper, and back."""
    names = tuple(KTH)
    what = "Runs of COLD-Stockholm, the paper's building, from floor to floor"
    return _outcome(setting, what, KTH, (names, names[::-1]), beams, ())


def _outcome(
    setting: Setting,
    what: str,
    of_floors: Mapping[str, tuple[str, ...]],
    directions: Sequence[tuple[str, ...]],
    completions: Mapping[str, BeamOptions],
    remarks: tuple[str, ...],
) -> Outcome:
    """With nothing behind the robot, with a mirror image, and with the local map."""
    geometry = ScanGeometry.half_circle(180, range_max_m=REACH_M)
    with setting.progress.stage("drives"):
        floors = {name: _runs(setting, folders, geometry) for name, folders in of_floors.items()}
    found = {}
    for way, (learn, label), (name, beams) in product(WAYS, directions, completions.items()):
        with setting.progress.stage(f"{learn} to {label}, {name}, {way}"):
            found[way, f"{learn} to {label}", name] = _scored(
                way,
                [item.drive for item in floors[learn]],
                [item.drive for item in floors[label]],
                beams,
                setting.n_threads,
            )
    shown = " to ".join(directions[0])
    findings = [
        steps.finding(
            f"{where}, {name}, {mode}",
            way,
            paper=PAPER if (where, mode) == (shown, ALONE) else None,
        )
        for (way, where, name), modes in found.items()
        for mode, steps in modes.items()
        if name == SHOWN
    ]
    first, second = (floors[name] for name in directions[0])
    steps = (
        f"{sum(_n_known(item.drive) for item in floors[name]):,} steps in {name}" for name in floors
    )
    recorded = (
        "Positions were recorded a metre apart; the robot is assumed to drive straight from one "
        "to the next, with a scan cast in the map every 0.1 m.",
    )
    return Outcome(
        setting=f"{what}: {', '.join(steps)}; 180 simulated beams ahead of "
        f"the robot, {REACH_M:g} m, {100 * SIGMA_M:g} cm of noise.",
        findings=tuple(findings),
        tables=(_table(found),),
        pictures=(
            Picture("learned.png", "A training drive (paper, Fig. 13, above)."),
            Picture("labelled.png", f"A drive as the {SMOOTHED} labels it (Fig. 13, below)."),
            Picture("beliefs.png", f"Beliefs of the {SMOOTHED} along that drive."),
        ),
        files=_pictures(first[-1], second[-1], found[AS_PRINTED, shown, SHOWN][SMOOTHED]),
        remarks=(*(recorded if setting.data else ()), *remarks),
    )


def _scored(
    way: str,
    learn: Sequence[Trajectory],
    label: Sequence[Trajectory],
    beams: BeamOptions,
    n_threads: int | None,
) -> dict[str, ScoredSteps]:
    labeler = step_labeler(way, PLACES, beams=beams).fit([], learn, n_threads=n_threads)
    scores = [labeler.scores(item, n_threads=n_threads) for item in label]
    return scored_modes(labeler, label, scores)


def _runs(setting: Setting, folders: Sequence[str], geometry: ScanGeometry) -> list[Run]:
    data = setting.data
    if data is None:
        return [_simulated(folder, geometry) for folder in folders]
    return [item for folder in folders for item in _recorded(data / folder, geometry)]


def _recorded(folder: Path, geometry: ScanGeometry) -> list[Run]:
    known, runs = load_cold_folder(folder, place_classes(), PLACES)
    if not runs:
        raise ConfigError(f"{folder} has no run; give it at least one trajectory_*.csv")
    found = []
    for number, item in enumerate(runs[:MOST_RUNS]):
        drive = item.resampled(STEP_M).labelled_by(known, PLACES)
        noise = SensorNoise(SIGMA_M, seed=number)
        found.append(Run(known.grid, scans_along(known.grid, drive, geometry, noise=noise)))
    return found


def _simulated(folder: str, geometry: ScanGeometry) -> Run:
    seed = STAND_INS[folder]
    building = generate_building(seed)
    robot = SimulatedRobot(geometry, scan_every_s=0.5, sensor_noise=SensorNoise(SIGMA_M, seed=seed))
    known = LabelledMap(building.grid, building.labels, name=building.name)
    drive = robot.explore(building.grid, spacing_m=2.0, seed=seed, name=building.name)
    return Run(building.grid, drive.labelled_by(known, PLACES))


def _n_known(drive: Trajectory) -> int:
    return 0 if drive.labels is None else int((drive.labels >= 0).sum())


def _table(found: Mapping[tuple[str, str, str], Mapping[str, ScoredSteps]]) -> Table:
    rows = []
    for (way, where, name), modes in found.items():
        for mode, steps in modes.items():
            scored = steps.evaluation
            recalls = (percent(scored.recall[place]) for place in PLACES)
            figures = (scored.accuracy, scored.balanced_accuracy, scored.f1[DOORWAY])
            rows.append((way, where, name, mode, *map(percent, figures), *recalls))
    places = (f"{place} recall" for place in PLACES)
    heading = ("options", "floors", "beams", "steps", "accuracy", "balanced", "doorway F1", *places)
    return Table("Correct steps in percent", heading, tuple(rows))


def _pictures(learn: Run, label: Run, steps: ScoredSteps) -> dict[str, bytes]:
    assert learn.drive.labels is not None  # what is learned from has some
    labeling = steps.labelings[-1]
    before, after = learn.drive.poses[:, :2], label.drive.poses[:, :2]
    return {
        "learned.png": path_map(learn.grid, before, learn.drive.labels, PLACES),
        "labelled.png": path_map(label.grid, after, labeling.labels, PLACES),
        "beliefs.png": belief_plot(Track(label.drive, labeling, PLACES)),
    }
