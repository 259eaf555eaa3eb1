"""Ten thousand small maps in one batch: memory of the client, time when all is done, files.

Each map is a piece, 3.2 m wide, of one of 20 generated floors in cells of 0.2 m, in folders of a
hundred. A list of three rounds labels them, so that as little as possible of the time is that of
the model. Only the first folders are labelled (`--labelled`); all others are copies of these with
their results, which are done as well, because a result belongs to the content of its map.
Of each command, the processor time of all its processes is measured and the most memory that its
first process had; with `label`, this process hands out the maps and collects what becomes of them.
`--maps 1000` takes fewer.
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

from pgm_places.io.maps.map_server import save_map
from pgm_places.labelers.place_labeler import PlaceLabeler, PlaceMethod
from pgm_places.maps.labelled_map import LabelledMap
from pgm_places.maps.occupancy_grid import OccupancyGrid
from pgm_places.models.decision_list import DecisionListClassifier
from pgm_places.persistence.stored import save
from pgm_places.simulation import generate_building

N_MAPS, N_MAPS_QUICK, N_LABELLED, N_PICTURED, TOGETHER = 10_000, 40, 400, 40, 100
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


def copy_folders(folder: Path, n_maps: int) -> None:
    """Fill a folder of maps or results up to so many maps with copies of its folders."""
    made = sorted(path for path in folder.iterdir() if path.is_dir() and path.name[0] != ".")
    for number in range(len(made), -(-n_maps // TOGETHER)):
        shutil.copytree(made[number % len(made)], folder / f"site{number:04d}")


def described(folder: Path) -> str:
    """How many files there are below a folder, how large they are, and those beside the folders."""
    sizes = [path.stat().st_size for path in folder.rglob("*") if path.is_file()]
    lists = {path.name: path.stat().st_size for path in folder.iterdir() if path.is_file()}
    return f"{len(sizes):,} files, {sum(sizes):,} bytes; beside the folders: {lists}"


def run(
    quick: bool, n_maps: int | None = None, n_labelled: int | None = None
) -> list[dict[str, Any]]:
    """The rows of the table."""
    n_maps = n_maps or (N_MAPS_QUICK if quick else N_MAPS)
    folder, rows = Path(tempfile.mkdtemp(prefix="pgm_places_many_")), []

    def measure(title: str, *words: str) -> None:
        rows.append({"": title, **measured(words)})
        print(rows[-1], flush=True)

    try:
        model, maps, out = write_model(folder / "model"), folder / "maps", folder / "out"
        write_maps(maps, min(n_maps, n_labelled or N_LABELLED))
        for path in sorted((maps / "site0000").iterdir())[: 2 * N_PICTURED]:
            (folder / "few").mkdir(exist_ok=True)
            shutil.copy(path, folder / "few")
        label = ["-m", str(model), "-j", "1", "-q"]
        pictured = folder / "pictured"
        measure("with pictures", "label", str(folder / "few"), "-o", str(pictured), *label)
        print(described(pictured))
        plain = ["label", str(maps), "-o", str(out), *label, "--outputs", "none"]
        measure("without", *plain)
        print(described(out))
        copy_folders(maps, n_maps)
        copy_folders(out, n_maps)
        (out / "summary.csv").unlink()
        measure("all done, no lists", *plain)
        measure("all done", *plain)
        measure("plan", *plain, "--dry-run")
        measure("index", "index", str(out), "--parquet", "-q")
        print(described(out))
        return rows
    finally:
        shutil.rmtree(folder)


def main() -> None:
    """Measure as many maps as are asked for."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--maps", type=int, default=N_MAPS, help=f"{N_MAPS} by default")
    parser.add_argument("--labelled", type=int, default=N_LABELLED, help=f"{N_LABELLED}")
    given = parser.parse_args()
    run(quick=False, n_maps=given.maps, n_labelled=given.labelled)


if __name__ == "__main__":
    main()
