"""Segments, gates and places on the real maps: ``python -m experiments.spaces [--data FOLDER]``.

One row for each kind of map. Doors are covered where a candidate matches them. Purity is the share
of the labelled cells, doorways apart, that have the label of most of their place where the true
gates are accepted. The last column names the map with the smallest share of its doors covered.
Processor time on one thread after a first call.
"""

import argparse
import os
import time
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path

import numpy as np

from experiments.paper.front_laser import PLACES, load_cold_folder, place_classes
from pgm_places.datasets import generate_building
from pgm_places.io.maps.label_image import load_labels
from pgm_places.io.maps.map_server import load_map
from pgm_places.maps.labelled_map import LabelledMap
from pgm_places.spaces.cell_features import CellFeatures
from pgm_places.spaces.door_truth import DoorScores, match_doors
from pgm_places.spaces.gates import gate_candidates, gate_features
from pgm_places.spaces.places import Places, places_between
from pgm_places.spaces.segmentation import Segmentation

LABELS = PLACES
DOORWAY = LABELS.index("doorway")
KINDS = {
    "offices, drawn": "floors/office_*",
    "schools, drawn": "floors/school_*",
    "building 79, redrawn": "freiburg079_drawn",
    "building 79, real": "freiburg079",
    "building 52, real": "freiburg052",
    "COLD Freiburg, 10 cm": "cold_freiburg_*",
    "COLD Saarbrücken, 10 cm": "cold_saarbrucken_*",
}


def labelled_maps(folders: Sequence[Path]) -> Iterator[LabelledMap]:
    """The maps of some folders with their labels, whether drawn or given as regions."""
    for folder in folders:
        if (folder / "regions.geojson").exists():
            yield load_cold_folder(folder, place_classes(), LABELS)[0]
            continue
        grid = load_map(folder / "map.yaml").grid
        yield LabelledMap(
            grid, load_labels(folder / "labels.png", LABELS, grid=grid), name=folder.name
        )


def seconds(work: Callable[[], object]) -> float:
    """Processor seconds of the fastest of three calls."""
    times = []
    for _ in range(3):
        start = time.process_time()
        work()
        times.append(time.process_time() - start)
    return min(times)


def purity(places: Places, item: LabelledMap) -> tuple[int, int]:
    """Cells that have the label of most of their place, and cells, doorways apart."""
    place = places.segments.raster()
    known = (place >= 0) & (item.labels >= 0) & (item.labels != DOORWAY)
    table = np.zeros((places.count, len(LABELS)), np.int64)
    np.add.at(table, (place[known], item.labels[known]), 1)
    return int(table.max(axis=1).sum()), int(table.sum())


def row(kind: str, maps: Sequence[LabelledMap]) -> str:
    """One kind of map."""
    cells = sum(item.grid.cells.size for item in maps) / 1e6
    spent = sum(seconds(lambda item=item: Segmentation.of(item.grid)) for item in maps)
    scores: list[DoorScores] = []
    n_gates = n_segments = n_places = 0
    pure = np.zeros(2)
    described = 0.0
    for item in maps:
        found = Segmentation.of(item.grid)
        gates = gate_candidates(found)
        match = match_doors(gates, item.labels, DOORWAY)
        places = places_between(gates, match.is_doorway)
        described += seconds(
            lambda f=found, g=gates, p=places: (CellFeatures.of(f, p), gate_features(g))
        )
        scores.append(match.scores(np.ones(len(gates), np.bool_)))
        n_gates, n_segments = n_gates + len(gates), n_segments + found.scales[0].count
        n_places += places.count
        pure += purity(places, item)
    doors, right = sum(s.doors for s in scores), sum(s.found for s in scores)
    precision = sum(s.right for s in scores) / max(sum(s.accepted for s in scores), 1)
    worst = min(
        range(len(maps)), key=lambda k: 1.0 if scores[k].recall is None else scores[k].recall
    )
    return (
        f"| {kind} | {len(maps)} | {1e3 * spent / cells:.0f} | {1e3 * described / len(maps):.1f} "
        f"| {n_segments / len(maps):.0f} | {n_gates / len(maps):.0f} | {n_places / len(maps):.0f} "
        f"| {100 * pure[0] / pure[1]:.1f} "
        f"| {right} / {doors} = {100 * right / max(doors, 1):.1f} | {100 * precision:.0f} "
        f"| {maps[worst].name}: {scores[worst].found} / {scores[worst].doors} |"
    )


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    default = os.environ.get("PGM_PLACES_DATA") or "../shared/data"
    parser.add_argument("--data", type=Path, default=Path(default))
    data = parser.parse_args().data
    print(
        "| maps | number | segmentation, ms per million cells | features, ms a map | segments "
        "| gates | places by true gates | their purity, % | doors covered, % "
        "| candidates that are doors, % | worst |"
    )
    print("|---" * 11 + "|")
    for kind, pattern in KINDS.items():
        maps = list(labelled_maps(sorted(data.glob(pattern))))
        if maps:
            print(row(kind, maps), flush=True)
    drawn = [generate_building(seed) for seed in range(12)]
    maps = [LabelledMap(item.grid, item.labels, name=item.name) for item in drawn]
    print(row("generated, furnished", maps))


if __name__ == "__main__":
    main()
