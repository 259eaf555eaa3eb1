"""What counts of objects add to the laser: the paper's six categories in generated buildings.

``python -m experiments.vision`` prints the table of docs/vision.md. Buildings, the use of their
rooms and the objects in them are invented; scans and detections are simulated.
"""

import dataclasses
from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from pgm_places.datasets import generate_building
from pgm_places.evaluation import evaluate
from pgm_places.grid import OccupancyGrid
from pgm_places.labelled_map import LabelledMap
from pgm_places.scan import ScanGeometry
from pgm_places.sensing.sensor import SensorNoise
from pgm_places.sensing.simulated_robot import SimulatedRobot
from pgm_places.topology.components import connected_components
from pgm_places.trajectory import Trajectory
from pgm_places.trajectory_labeler import REACH_M, TrajectoryLabeler
from pgm_places.vision.detector import PAPER_OBJECTS
from pgm_places.vision.placement import place_objects
from pgm_places.vision.simulated_detector import SimulatedDetector

NAMES = ("corridor", "doorway", "office", "kitchen", "seminar room", "laboratory")
CORRIDOR, DOORWAY, OFFICE, KITCHEN, SEMINAR, LABORATORY = range(6)
LEARN, LABEL = (1, 2, 3, 4), (11, 12)
"""Seeds of the buildings to learn from, and of those to label."""

FURNISHING: Mapping[str, Mapping[str, tuple[int, int]]] = {
    "office": {
        "monitor on": (0, 2),
        "monitor off": (0, 2),
        "office cupboard": (1, 2),
        "frontal face": (0, 1),
    },
    "kitchen": {"coffee machine": (1, 2), "office cupboard": (0, 1), "upper human body": (0, 1)},
    "seminar room": {"office cupboard": (0, 1), "face profile": (0, 3)},
    "laboratory": {"monitor on": (2, 6), "monitor off": (1, 3), "office cupboard": (0, 2)},
    "corridor": {"full human body": (0, 2)},
}
"""How many of an object a place has: from, to."""

DETECTORS: Mapping[str, Mapping[str, float] | None] = {
    "laser alone": None,
    "and a poor detector": {"p_miss": 0.6, "false_alarms": 0.02},
    "and a fair one": {"p_miss": 0.3, "false_alarms": 0.005},
    "and a perfect one": {"p_miss": 0.0, "false_alarms": 0.0},
}
SMALL_M2, LARGE_M2 = 14.0, 30.0
RANGE_M = 5.0


@dataclasses.dataclass(frozen=True, eq=False)
class Floor:
    """A building whose rooms have a use, and a drive through it."""

    grid: OccupancyGrid
    labels: NDArray[np.int16]
    drive: Trajectory

    def counts(self, options: Mapping[str, float], seed: int) -> NDArray[np.float32]:
        """Columns of the drive: the paper's objects, as seen by a simulated detector."""
        placed = place_objects(self.grid, self.labels, NAMES, FURNISHING, seed=seed)
        detector = SimulatedDetector(self.grid, placed, RANGE_M, seed=seed, **options)  # type: ignore[arg-type]
        seen = np.zeros((len(self.drive), len(PAPER_OBJECTS)), np.float32)
        at = [PAPER_OBJECTS.index(name) for name in detector.object_names]
        seen[:, at] = detector.count_along(self.drive.poses)
        return seen


def make_floor(seed: int) -> Floor:
    """A generated building with a tour of a robot whose laser sees all around."""
    building = generate_building(seed)
    labels = used_rooms(building.labels, building.label_names, building.grid.resolution_m, seed)
    geometry = ScanGeometry.full_circle(360, range_max_m=REACH_M)
    robot = SimulatedRobot(geometry, scan_every_s=1.0, sensor_noise=SensorNoise(0.02, seed=seed))
    drive = robot.explore(building.grid, spacing_m=2.0, seed=seed, name=building.name)
    known = LabelledMap(building.grid, labels, name=building.name)
    return Floor(building.grid, labels, drive.labelled_by(known, NAMES))


def used_rooms(
    labels: NDArray[np.int16], label_names: Sequence[str], resolution_m: float, seed: int
) -> NDArray[np.int16]:
    """Labels in which each room is one of four kinds, as its size allows.

    A third of the small rooms are kitchens; large rooms are seminar rooms or laboratories, medium
    ones sometimes: size tells something, but not all.
    """
    rng = np.random.default_rng(seed)
    rooms = connected_components(np.where(labels == label_names.index("room"), labels, -1))
    use = np.empty(rooms.count + 1, np.int16)
    for number, area in enumerate(rooms.size * resolution_m**2):
        kinds = [OFFICE, OFFICE, KITCHEN]
        if area > SMALL_M2:
            kinds = [OFFICE, OFFICE, SEMINAR, LABORATORY]
        if area > LARGE_M2:
            kinds = [SEMINAR, LABORATORY]
        use[number] = rng.choice(kinds)
    use[-1] = -1
    found = use[rooms.piece]
    found[labels == label_names.index("corridor")] = CORRIDOR
    found[labels == label_names.index("doorway")] = DOORWAY
    return found


def rates(
    learn: Sequence[Floor], label: Sequence[Floor], options: Mapping[str, float] | None
) -> dict[str, NDArray[np.float64]]:
    """Accuracy and recalls in per cent, from each step alone and with the filter."""
    extra = None
    if options is not None:
        extra = [floor.counts(options, k) for k, floor in enumerate(learn)]
    labeler = TrajectoryLabeler(NAMES).fit(
        [],
        [floor.drive for floor in learn],
        extra=extra,
        extra_names=() if extra is None else PAPER_OBJECTS,
    )
    truth, alone, filtered = [], [], []
    for k, floor in enumerate(label):
        seen = None if options is None else floor.counts(options, 100 + k)
        scores = labeler.scores(floor.drive, extra=seen)
        truth.append(floor.drive.labels)
        alone.append(scores.argmax(axis=1))
        filtered.append(labeler.infer(floor.drive, scores).labels)
    wanted = np.concatenate(truth)
    return {
        name: _row(wanted, np.concatenate(found))
        for name, found in (("alone", alone), ("filter", filtered))
    }


def _row(truth: NDArray[np.int64], found: NDArray[np.int64]) -> NDArray[np.float64]:
    scored = evaluate(truth, found, NAMES)
    return 100 * np.array([scored.accuracy, *(scored.recall[name] or 0.0 for name in NAMES)])


def main() -> None:
    """Print the table."""
    learn, label = [make_floor(seed) for seed in LEARN], [make_floor(seed) for seed in LABEL]
    for floors in (learn, label):
        steps = np.concatenate([floor.drive.labels for floor in floors])
        counts = [f"{int((steps == k).sum())} {name}" for k, name in enumerate(NAMES)]
        print(f"{len(steps)} steps: {', '.join(counts)}", flush=True)
    print(f"| features | steps | all | {' | '.join(NAMES)} |\n|---|---|{'---|' * (len(NAMES) + 1)}")
    for name, options in DETECTORS.items():
        for key, values in rates(learn, label, options).items():
            print(f"| {name} | {key} | {' | '.join(f'{v:.1f}' for v in values)} |", flush=True)


if __name__ == "__main__":
    main()
