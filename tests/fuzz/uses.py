"""What is done with a spoiled file that could be read: tracked, labelled, solved, exported."""

from collections.abc import Sequence
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pgm_places.experiment.graphs import SourceGraph
from pgm_places.features.object_counts import ObjectCounts
from pgm_places.inference.backends import build
from pgm_places.inference.factor_graph import FactorGraph
from pgm_places.io.logs.bags import MapMessage
from pgm_places.io.maps.map_server import MapFile, load_map
from pgm_places.io.places.exports import EXPORTS, export
from pgm_places.io.places.topology_files import save_topology
from pgm_places.io.uai import read_uai
from pgm_places.labelers.trajectory_labeler import TrajectoryLabeler
from pgm_places.labelling.label import label_map
from pgm_places.maps.occupancy_grid import OccupancyGrid
from pgm_places.models.factor_decoding import decode_factors
from pgm_places.persistence.map_prior import LabelledMapFolder
from pgm_places.persistence.stored import Stored
from pgm_places.teaching.paint import Paint
from pgm_places.topology.from_labels import topological_map
from pgm_places.topology.place_ids import PlaceIds
from pgm_places.topology.topological_map import TopologicalMap
from pgm_places.trajectories.trajectory import Trajectory
from tests.fuzz.seeds import NAMES
from tests.live.test_live_node import Robot
from tests.persistence.test_stored import chain, grid, path
from tests.quick_labeler import places
from tests.topology.floors import gated_floor_map

MOST_CELLS = 200_000
"""Of a map that is labelled; the command's limit is 100 million."""

MOST_STEPS = 20
"""Of a drive that is tracked."""


@lru_cache(1)
def grid_of(folder: Path) -> OccupancyGrid:
    """Of a map that is not the file to spoil."""
    return load_map(folder / "map.yaml").grid


@lru_cache(1)
def tracker() -> TrajectoryLabeler:
    return TrajectoryLabeler.from_places(places())


def label(read: MapFile, _: Path) -> None:
    """The map is labelled and divided into places."""
    found = label_map(places(), read.grid, max_cells=MOST_CELLS, n_threads=1)
    topological_map(read.grid, found.labels, found.label_names, doorways=found.doorways)


def label_messages(read: Sequence[MapMessage], _: Path) -> None:
    for item in read:
        label_map(places(), item.grid, max_cells=MOST_CELLS, n_threads=1)


def label_around(read: Paint, folder: Path) -> None:
    """The map is labelled with corrections."""
    known = read.with_classes(places().label_names_).labels
    label_map(places(), grid_of(folder), known=known, n_threads=1)


def divide(read: NDArray[np.int16], folder: Path) -> None:
    """A map with these labels is divided into places."""
    topological_map(grid_of(folder), read, NAMES)


def track(read: Any, folder: Path) -> None:
    """The first steps are labelled as they come, and as a whole; without scans, on the map."""
    whole: Trajectory = read.trajectory
    whole.graph()
    first = whole[:MOST_STEPS]
    if first.ranges_m is None or first.geometry is None:
        tracker().label(first, known_map=grid_of(folder), n_threads=1)
        return
    online = tracker().online(first.geometry)
    for step in range(len(first)):
        online.step(first.scan(step))
    tracker().label(first, n_threads=1)


def count(read: ObjectCounts, _: Path) -> None:
    times = np.array([-1e9, 0.0, 0.5, 1e9, 1e18])
    read.at(times, within_s=1.0)
    read.seconds_from(times)


def prefer(read: LabelledMapFolder, folder: Path) -> None:
    """A drive on the map that these labels and probabilities are of."""
    tracker().label(path(), known_map=grid_of(folder), map_prior=read.prior, n_threads=1)


def write_places(read: TopologicalMap, folder: Path) -> None:
    """The places are written in every format."""
    target = folder / "exported"
    save_topology(target, read)
    for to in ("nav2-route", "zones", *EXPORTS):
        export(read, to, target)


def go_on(read: PlaceIds, _: Path) -> None:
    """The robot goes on with the places that it knew."""
    read.learn(gated_floor_map())


def label_by(read: Stored, _: Path) -> None:
    """The model labels a small map, a short drive or a chain, whatever it is for."""
    item = read.item
    if read.kind == "backend":
        item.infer(chain())
    elif read.kind == "structured-labeler":
        item.label(chain())
    elif read.kind == "place-labeler":
        label_map(item, grid(), max_cells=MOST_CELLS, n_threads=1)
        TrajectoryLabeler.from_places(item, every_m=0.3).label(path(), known_map=grid())
    elif read.kind == "trajectory-labeler":
        item.label(path(), known_map=grid(), n_threads=1)
    else:
        item.label(grid(), path(), n_threads=1)


def solve(read: Sequence[SourceGraph], _: Path) -> None:
    """Graphs of tables are learned from and labelled."""
    problems, truth = [item.problem for item in read], [item.truth for item in read]
    method = build("crf", {"max_steps": 5}).fit(problems, truth)
    for problem in problems:
        method.infer(problem)


def decode(read: FactorGraph, _: Path) -> None:
    for method in ("exact", "trw-s", "max-product", "lp"):
        decode_factors(read, method)


def decode_known(read: NDArray[np.int64], folder: Path) -> None:
    decode_factors(read_uai(folder / "network.uai"), "exact", known=read)


def drive(read: Sequence[tuple[str, bytes]], _: Path) -> None:
    """A node takes the messages; it complains in lines, and goes on."""
    robot = Robot()
    for step, (what, raw) in enumerate(read):
        robot.node.take(what, raw, now_s=float(step))
        robot.node.turn(float(step))
    assert all("\n" not in line and len(line) < 700 for line in robot.said)
