"""Ten thousand small maps in one batch: memory of the client, time when all is done, files.

Each map is a different piece, 3.2 m wide, of one of 20 generated floors in cells of 0.2 m, in
folders of a hundred. A list of three rounds labels them, so that as little as possible of the time
is that of the model. Of each command, the processor time of all its processes is measured and the
most memory that its first process had; with `label`, this process hands out the maps and collects
what becomes of them. `--maps 1000` takes fewer.
"""

import argparse
import os
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import psutil

from pgm_places.datasets import generate_building
from pgm_places.io.maps.map_server import save_map
from pgm_places.labelers.place_labeler import PlaceLabeler, PlaceMethod
from pgm_places.maps.labelled_map import LabelledMap
from pgm_places.maps.occupancy_grid import OccupancyGrid
from pgm_places.models.decision_list import DecisionListClassifier
from pgm_places.persistence.stored import save

N_MAPS, N_MAPS_QUICK, TOGETHER = 10_000, 40, 100
DIFFERENT, RESOLUTION_M, PART_M = 20, 0.2, 3.2


def write_model(folder: Path) -> Path:
    """A model that is learned and labels in no time."""
    building = generate_building(size="small", resolution_m=RESOLUTION_M)
    labeler = PlaceLabeler(
        building.label_names,
        {"alone": PlaceMethod("independent", "laser")},
        classifier=DecisionListClassifier(n_rounds=3),
        max_examples_per_map=300,
        n_folds=2,
    )
    labeler.fit([LabelledMap(building.grid, building.labels)])
    return save(labeler, folder)


def write_maps(folder: Path, n_maps: int) -> None:
    """Pieces of floors, in folders of a hundred."""
    floors = [
        generate_building(seed, size="small", resolution_m=RESOLUTION_M).grid
        for seed in range(DIFFERENT)
    ]
    wide = round(PART_M / RESOLUTION_M)
    for number in range(n_maps):
        cells = floors[number % DIFFERENT].cells
        left = number // DIFFERENT % max(cells.shape[1] - wide, 1)
        site = folder / f"site{number // TOGETHER:04d}"
        site.mkdir(parents=True, exist_ok=True)
        piece = OccupancyGrid(cells[:, left : left + wide], RESOLUTION_M)
        save_map(piece, site / f"floor{number % TOGETHER:02d}")


def measured(words: Sequence[str]) -> dict[str, Any]:
    """What a command takes."""
    start, before = time.perf_counter(), os.times()
    with subprocess.Popen(
        [sys.executable, "-m", "pgm_places", *words], stdout=subprocess.PIPE, text=True
    ) as process:
        most = 0
        while process.poll() is None:
            try:
                most = max(most, psutil.Process(process.pid).memory_info().rss)
            except psutil.Error:
                break
            time.sleep(0.2)
        said = (process.stdout.read() if process.stdout else "").splitlines()
    after = os.times()
    return {
        "command": f"{words[0]}{' --dry-run' if '--dry-run' in words else ''}",
        "said": said[0] if said else "",
        "wall s": time.perf_counter() - start,
        "processor s": after.children_user
        + after.children_system
        - before.children_user
        - before.children_system,
        "client MB": most / 1e6,
    }


def run(quick: bool, n_maps: int | None = None) -> list[dict[str, Any]]:
    """The rows of the table."""
    n_maps = n_maps or (N_MAPS_QUICK if quick else N_MAPS)
    folder = Path(tempfile.mkdtemp(prefix="pgm_places_many_"))
    try:
        model, maps, out = write_model(folder / "model"), folder / "maps", folder / "out"
        write_maps(maps, n_maps)
        few = folder / "few"
        shutil.copytree(maps / "site0000", few)
        label = ["label", str(maps), "-m", str(model), "-o", str(out), "-j", "1", "-q"]
        first = ["label", str(few), "-m", str(model), "-o", str(folder / "first"), "-j", "1", "-q"]
        commands = {
            "first 100, all outputs": first,
            "all maps": [*label, "--outputs", "none"],
            "again, all done": [*label, "--outputs", "none"],
            "plan": [*label, "--outputs", "none", "--dry-run"],
            "index": ["index", str(out), "--parquet", "-q"],
        }
        rows = []
        for title, words in commands.items():
            rows.append({"": title, **measured(words)})
            print(rows[-1], flush=True)
        written = [path for path in out.rglob("*") if path.is_file()]
        lists = {path.name: path.stat().st_size for path in out.iterdir() if path.is_file()}
        print(
            f"{len(written):,} files, {sum(path.stat().st_size for path in written):,} bytes; "
            f"lists: {lists}"
        )
        return rows
    finally:
        shutil.rmtree(folder)


def main() -> None:
    """Measure as many maps as are asked for."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--maps", type=int, default=N_MAPS, help=f"{N_MAPS} by default")
    run(quick=False, n_maps=parser.parse_args().maps)


if __name__ == "__main__":
    main()
