"""Simulated drives in every labelled map, each with another laser, and their features."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from experiments.array_cache import ArrayCache, fingerprint
from experiments.known_maps import GENERATED, NAMES, KnownMap
from pgm_places._version import __version__
from pgm_places.labelers.trajectory_labeler import REACH_M
from pgm_places.maps.labelled_map import LabelledMap
from pgm_places.sensing.sensor import Sensor, SensorNoise
from pgm_places.simulation.simulated_robot import SimulatedRobot
from pgm_places.trajectories.path import PathSegments
from pgm_places.trajectories.scan import ScanGeometry
from pgm_places.trajectories.trajectory import Trajectory
from pgm_places.unary.floor_model import FloorModel
from pgm_places.unary.scan_model import BeamOptions, observed_along

EVERY_M = 0.25
"""Way between two updates of the model, and between two examples."""

LENGTH_M = 120.0

BEAMS = BeamOptions(spaces_m=12.0)
SENSOR = Sensor(max_range_m=REACH_M)


@dataclass(frozen=True)
class Laser:
    """A laser scanner that looks ahead.

    Parameters
    ----------
    view_degrees : float
    n_beams : int
    reach_m : float
    noise_m : float
        Standard deviation of its readings.
    p_lost : float
        Share of the beams without a return.
    """

    view_degrees: float
    n_beams: int
    reach_m: float
    noise_m: float = 0.02
    p_lost: float = 0.01

    @classmethod
    def drawn(cls, rng: np.random.Generator) -> "Laser":
        """One of 90 to 360 degrees, a beam every 0.25 to 3 degrees, and 4 to 80 m of reach."""
        view = float(rng.choice([90, 120, 180, 180, 240, 270, 360, 360]))
        spacing = float(np.exp(rng.uniform(np.log(0.25), np.log(3.0))))
        reach = float(np.exp(rng.uniform(np.log(4), np.log(80))))
        noise = float(rng.uniform(0.005, 0.05))
        return cls(
            view, max(30, int(view / spacing)), reach, noise, float(rng.choice([0, 1, 3]) / 100)
        )

    @property
    def geometry(self) -> ScanGeometry:
        """Its beams."""
        view = float(np.deg2rad(self.view_degrees))
        return ScanGeometry.ahead(self.n_beams, view, range_max_m=self.reach_m)

    def noise(self, seed: int) -> SensorNoise:
        """Its errors."""
        return SensorNoise(self.noise_m, p_random=0.001, p_max=self.p_lost, seed=seed)


@dataclass(frozen=True, eq=False)
class Observed:
    """The labelled steps of a drive, and what the robot saw there.

    Parameters
    ----------
    name, building, group : str
        Of the map; the group is its kind, as in the tables.
    laser : Laser
    generated : bool
        Only learned from, never tested on.
    poses : (n, 3) float64
    labels : (n,) int64
    circles_m : (n, 360) float32
    spaces : (n, F) float32
    floor : (n, K) float64 or None
        Log-probabilities of the floor networks, if requested.
    """

    name: str
    building: str
    group: str
    laser: Laser
    generated: bool
    poses: NDArray[np.float64]
    labels: NDArray[np.int64]
    circles_m: NDArray[np.float32]
    spaces: NDArray[np.float32]
    floor: NDArray[np.float64] | None = None

    @property
    def trajectory(self) -> Trajectory:
        """Its labelled steps, without scans."""
        return Trajectory(
            np.arange(len(self.poses), dtype=np.float64),
            self.poses,
            labels=self.labels,
            label_names=NAMES,
            name=self.name,
            building=self.building,
        )


def simulated_drive(
    known: KnownMap,
    number: int,
    cache: ArrayCache,
    laser: Laser | None = None,
    length_m: float = LENGTH_M,
) -> Observed:
    """A drive through a map with a laser that the number draws, unless one is given."""
    chosen = laser or Laser.drawn(np.random.default_rng([number, 7]))

    def drive() -> Trajectory:
        robot = SimulatedRobot(
            chosen.geometry, radius_m=0.2, speed_m_s=0.5, sensor_noise=chosen.noise(number)
        )
        path = robot.explore(known.item.grid, max_length_m=length_m, seed=number)
        return path.labelled_by(known.item, NAMES)

    stem = fingerprint(number, chosen, length_m, known.item.grid.cells, known.item.labels)
    return observed(known.item, known.group, chosen, drive, cache, stem, known.source == GENERATED)


def observed(
    item: LabelledMap,
    group: str,
    laser: Laser,
    drive: Callable[[], Trajectory],
    cache: ArrayCache,
    stem: str,
    generated: bool = False,
    all_steps: bool = False,
    floor: FloorModel | None = None,
) -> Observed:
    """What a drive shows at its labelled steps a quarter of a metre apart, or at all steps.

    ``floor`` are networks that look at what the robot has mapped so far.
    """

    def make() -> dict[str, NDArray[np.generic]]:
        path = drive()
        assert path.labels is not None
        observations = observed_along(path, SENSOR, BEAMS, floor=floor)
        steps = np.arange(len(path)) if all_steps else PathSegments(path.poses, EVERY_M).first
        if not all_steps:
            steps = steps[path.labels[steps] >= 0]
        shown: dict[str, NDArray[Any]] = {
            "poses": path.poses[steps],
            "labels": path.labels[steps],
            "circles": observations.circles_m[steps],
            "spaces": observations.spaces[steps],
        }
        return (
            shown if observations.floor is None else {**shown, "floor": observations.floor[steps]}
        )

    networks = () if floor is None else (floor.networks[0].packed(), floor.shares)
    key = fingerprint(__version__, stem, BEAMS, SENSOR, all_steps, *networks)
    arrays = cache.arrays(f"{key}-drive", make)
    parts: list[Any] = [
        arrays.get(name) for name in ("poses", "labels", "circles", "spaces", "floor")
    ]
    building = str(item.building or item.name)
    return Observed(item.name, building, group, laser, generated, *parts)


def simulated_drives(maps: Iterator[KnownMap], cache: ArrayCache) -> list[Observed]:
    """A drive through each map."""
    found = []
    for number, known in enumerate(maps):
        found.append(simulated_drive(known, number, cache))
        print(f"{number}: {known.item.name}, {len(found[-1].labels)} steps", flush=True)
    return found
