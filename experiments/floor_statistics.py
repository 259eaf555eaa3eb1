"""Sizes of rooms, corridors and doors on drawn floors, which the generated buildings follow.

``python -m experiments.floor_statistics`` measures the labelled floors of ``$PGM_PLACES_DATA`` and
prints a table per kind of building; ``pgm_places/datasets/kinds.py`` holds its numbers.
"""

import csv
import os
import sys
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from pgm_places.io.maps.label_image import load_labels
from pgm_places.io.maps.label_values import listed_names
from pgm_places.io.maps.map_server import load_map
from pgm_places.maps.occupancy_grid import OccupancyGrid

NAMES = ("corridor", "room", "doorway")
QUANTILES = (10, 20, 40, 50, 60, 80, 90)
LEAST_ROOM_M2, LEAST_HALL_M2 = 2.0, 6.0
HALLS = ("hall", "lobby")
"""Fine kinds of space that one waits in or passes through to reach several rooms."""

Measures = dict[str, list[float]]


def side_lengths_m(part: NDArray[np.bool_], resolution_m: float) -> tuple[float, float]:
    """The longer and the shorter side of the smallest rectangle around a part, at any angle."""
    rows, columns = np.nonzero(part & ~ndimage.binary_erosion(part))
    points = np.column_stack([columns, rows]).astype(float)
    angles = np.deg2rad(np.arange(0, 90, 2.0))
    extents = []
    for angle in angles:
        axes = np.array([[np.cos(angle), np.sin(angle)], [-np.sin(angle), np.cos(angle)]])
        extents.append(np.ptp(points @ axes.T, axis=0) + 1)
    best = min(extents, key=np.prod)
    return float(best.max() * resolution_m), float(best.min() * resolution_m)


def corridor_widths_m(corridor: NDArray[np.bool_], resolution_m: float) -> NDArray[np.float64]:
    """Twice the clearance on the middle line of the corridors: where it is a local maximum."""
    clearance = ndimage.distance_transform_edt(np.pad(corridor, 1))[1:-1, 1:-1]
    ridge = (clearance >= ndimage.maximum_filter(clearance, 5)) & (clearance * resolution_m > 0.4)
    return 2 * clearance[ridge] * resolution_m


def measure(labels: NDArray[np.int16], resolution_m: float) -> Measures:
    """What a floor's rooms, corridors and doorways measure, each as a list."""
    found: Measures = {}

    def note(name: str, *values: float) -> None:
        found.setdefault(name, []).extend(values)

    rooms, _ = ndimage.label(labels == 1)
    n_rooms = 0
    for index, window in enumerate(ndimage.find_objects(rooms), start=1):
        part = np.pad(rooms[window] == index, 1)
        area = float(part.sum() * resolution_m**2)
        if area < LEAST_ROOM_M2:
            continue
        n_rooms += 1
        longer, shorter = side_lengths_m(part, resolution_m)
        note("room area m2", area)
        note("room longer side m", longer)
        note("room shorter side m", shorter)
        note("room aspect", longer / shorter)
        note("room share of rectangle", area / (longer * shorter))
    corridor = labels == 0
    widths = corridor_widths_m(corridor, resolution_m)
    note("corridor width m", *widths.tolist())
    length_m = corridor.sum() * resolution_m**2 / np.median(widths)
    note("rooms per corridor metre", n_rooms / length_m)
    note("corridor share of area", float(corridor.sum() / (labels >= 0).sum()))
    doors, _ = ndimage.label(labels == 2)
    for index, window in enumerate(ndimage.find_objects(doors), start=1):
        longer, shorter = side_lengths_m(np.pad(doors[window] == index, 1), resolution_m)
        note("door longer side m", longer)
        note("door shorter side m", shorter)
    note("doors per room", doors.max() / n_rooms)
    return found


def measure_halls(kinds: NDArray[np.int16], halls: Sequence[int], grid: OccupancyGrid) -> Measures:
    """Area and shorter side of each hall, its width at right angles to its length."""
    found: Measures = {"hall area m2": [], "hall shorter side m": []}
    parts, _ = ndimage.label(np.isin(kinds, halls) & grid.free)
    for index, window in enumerate(ndimage.find_objects(parts), start=1):
        part = np.pad(parts[window] == index, 1)
        area = float(part.sum() * grid.resolution_m**2)
        if area >= LEAST_HALL_M2:
            found["hall area m2"].append(area)
            found["hall shorter side m"].append(side_lengths_m(part, grid.resolution_m)[1])
    return found


def floors(folder: Path) -> Iterator[tuple[str, Measures]]:
    """Kind of building and measures of each labelled floor."""
    with (folder / "index.csv").open(encoding="utf-8") as lines:
        names = [row["floor"] for row in csv.DictReader(lines)]
    for name in names:
        grid = load_map(folder / name / "map.yaml").grid
        labels = load_labels(folder / name / "labels.png", NAMES, grid=grid)
        labels = np.where(grid.free, labels, -1).astype(np.int16)
        found = measure(labels, grid.resolution_m)
        fine = folder / name / "fine.png"
        kinds = listed_names(fine, None)
        of_cell = load_labels(fine, kinds, grid=grid)
        found |= measure_halls(of_cell, [kinds.index(k) for k in HALLS if k in kinds], grid)
        yield name.partition("_")[0], found


def table(measures: Mapping[str, Measures]) -> str:
    """Quantiles of every measure, a row for each kind of building."""
    head = ["measure", "kind", "n", *(f"{q} %" for q in QUANTILES)]
    lines = ["| " + " | ".join(head) + " |", "|---" * len(head) + "|"]
    for name in next(iter(measures.values())):
        for kind, found in measures.items():
            cells = [f"{value:.2f}" for value in np.percentile(found[name], QUANTILES)]
            lines.append("| " + " | ".join([name, kind, str(len(found[name])), *cells]) + " |")
    return "\n".join(lines)


def main() -> None:
    """Measure all floors and print the table."""
    data = os.environ.get("PGM_PLACES_DATA")
    if not data:
        sys.exit("set PGM_PLACES_DATA to the folder that holds the labelled floors")
    measures: dict[str, Measures] = {}
    for kind, found in floors(Path(data) / "floors"):
        for name, values in found.items():
            measures.setdefault(kind, {}).setdefault(name, []).extend(values)
    print(table(measures))


if __name__ == "__main__":
    main()
