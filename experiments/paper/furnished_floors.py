"""Generated buildings whose rooms have a use, with objects in them, and a drive through each."""

import dataclasses
from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from experiments.paper.placement import place_objects
from experiments.paper.simulated_detector import SimulatedDetector
from pgm_places.features.object_counts import PAPER_OBJECTS
from pgm_places.labelers.trajectory_labeler import REACH_M
from pgm_places.maps.components import connected_components
from pgm_places.maps.labelled_map import LabelledMap
from pgm_places.maps.occupancy_grid import OccupancyGrid
from pgm_places.sensing.sensor import SensorNoise
from pgm_places.simulation import generate_building
from pgm_places.simulation.simulated_robot import SimulatedRobot
from pgm_places.trajectories.scan import ScanGeometry
from pgm_places.trajectories.trajectory import Trajectory

NAMES = ("corridor", "doorway", "office", "kitchen", "seminar room", "laboratory")
CORRIDOR, DOORWAY, OFFICE, KITCHEN, SEMINAR, LABORATORY = range(6)
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
"""The least and greatest number of an object in a place."""

DETECTORS: Mapping[str, Mapping[str, float] | None] = {
    "laser alone": None,
    "laser, poor detector": {"p_miss": 0.6, "false_alarms": 0.02},
    "laser, fair detector": {"p_miss": 0.3, "false_alarms": 0.005},
    "laser, perfect detector": {"p_miss": 0.0, "false_alarms": 0.0},
}
SMALL_M2, LARGE_M2 = 14.0, 30.0
RANGE_M = 5.0


@dataclasses.dataclass(frozen=True, eq=False)
class Floor:
    """A building whose rooms have a use, and a drive through it.

    Parameters
    ----------
    grid : OccupancyGrid
    labels : (H, W) int16
        The use of each cell, -1 where unknown.
    drive : Trajectory
    names : tuple of str
        The uses.
    furnishing : mapping
        How many of an object a place has, see :func:`experiments.paper.placement.place_objects`.
    """

    grid: OccupancyGrid
    labels: NDArray[np.int16]
    drive: Trajectory
    names: tuple[str, ...] = NAMES
    furnishing: Mapping[str, Mapping[str, tuple[int, int]]] = dataclasses.field(
        default_factory=lambda: FURNISHING
    )

    def counts(self, options: Mapping[str, float], seed: int) -> NDArray[np.float32]:
        """Columns of the drive: the paper's objects, as seen by a simulated detector."""
        placed = place_objects(self.grid, self.labels, self.names, self.furnishing, seed=seed)
        detector = SimulatedDetector(self.grid, placed, RANGE_M, seed=seed, **options)  # type: ignore[arg-type]
        counts = np.zeros((len(self.drive), len(PAPER_OBJECTS)), np.float32)
        at = [PAPER_OBJECTS.index(name) for name in detector.object_names]
        counts[:, at] = detector.count_along(self.drive.poses)
        return counts


def make_floor(seed: int) -> Floor:
    """A generated building with a tour by a robot whose laser sees all around."""
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
    ones sometimes: size is informative, but not conclusive.
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
