"""The COLD campaign's maps with their regions, and the runs that were recorded in them."""

import json
from collections.abc import Mapping
from pathlib import Path

import numpy as np

from pgm_places.io.logs.pose_csv import read_pose_csv
from pgm_places.io.maps.map_server import load_map
from pgm_places.io.maps.regions import load_regions
from pgm_places.maps.coarsening import coarsen
from pgm_places.maps.labelled_map import LabelledMap
from pgm_places.trajectories.trajectory import Trajectory

__all__ = [
    "CLASSES",
    "NAMES",
    "PLACES",
    "STEP_M",
    "load_cold_folder",
    "place_classes",
]

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
    others = dict.fromkeys(("LO", "CF", "RL", "TR"), "room")
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
