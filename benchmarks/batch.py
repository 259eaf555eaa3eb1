"""Many maps: two processes against one, and a cluster.

Parts of generated floors, and such parts tiled side by side, labelled with the model that ships
with the package by `pgm-places label`. A single map is labelled in this process, one after the
other with the model and the kernels loaded: the sum of those is what a batch on one process is
compared with, which also starts a process and loads both. Each worker has one thread. The cluster
is Dask's `LocalCluster` of two processes. Processor time is that of all processes of the batch
together, which other work on the machine changes little; that of a cluster's workers is not known.
"""

import os
import shutil
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import psutil

from pgm_places.batch.dask_workers import DaskWorkers
from pgm_places.batch.found_maps import find_maps
from pgm_places.batch.label_batch import label_batch
from pgm_places.batch.local_workers import LocalWorkers, Workers
from pgm_places.batch.map_task import LabelledRow, MapTask, label_one
from pgm_places.io.maps.map_server import save_map
from pgm_places.labelling.model import LoadedModel
from pgm_places.labelling.options import LabelOptions
from pgm_places.maps.occupancy_grid import OccupancyGrid
from pgm_places.progress import Silent
from pgm_places.simulation import generate_building

N_MAPS, N_MAPS_QUICK = 1000, 12
DIFFERENT, TILED_EVERY, PART_M = 20, 10, 3.0
OPTIONS = LabelOptions()


def write_maps(folder: Path, n_maps: int) -> None:
    """Maps as files, each the left end of a small floor; every tenth twice that, side by side."""
    floors = [
        generate_building(seed, size="small", resolution_m=0.05).grid for seed in range(DIFFERENT)
    ]
    for number in range(n_maps):
        grid = floors[number % DIFFERENT]
        cells = grid.cells[:, : round(PART_M / grid.resolution_m)]
        if number % TILED_EVERY == TILED_EVERY - 1:
            cells = np.hstack([cells, cells])
        (folder / f"floor{number:04d}").mkdir(parents=True)
        made = OccupancyGrid(cells, grid.resolution_m)
        save_map(made, folder / f"floor{number:04d}" / "map")


class Taken(NamedTuple):
    """Seconds of wall clock, and of processor time where it is known."""

    wall_s: float
    processor_s: float | None


def single_seconds(maps: Path, out: Path) -> Taken:
    """What all maps take, one after the other in this process."""
    sha256 = LoadedModel.load(OPTIONS).sha256
    wall_s = processor_s = 0.0
    for first, found in enumerate(find_maps([str(maps)], out).maps):
        task = MapTask(found.name, found.path, out / found.name, OPTIONS, sha256)
        if not first:  # imports, and reads the model
            label_one(MapTask("warm", found.path, out / "warm", OPTIONS, sha256))
        start, before = time.perf_counter(), processor_seconds()
        assert isinstance(label_one(task), LabelledRow)
        wall_s += time.perf_counter() - start
        processor_s += processor_seconds() - before
    return Taken(wall_s, processor_s)


def batch_seconds(maps: Path, out: Path, workers: Workers) -> Taken:
    """What a batch takes."""
    start, before = time.perf_counter(), processor_seconds()
    found = find_maps([str(maps)], out)
    done = label_batch(found, out, OPTIONS, workers, progress=Silent())
    assert done.n_labelled == len(found.maps)
    wall_s, ours = time.perf_counter() - start, isinstance(workers, LocalWorkers)
    return Taken(wall_s, ended_processor_seconds() - before if ours else None)


def processor_seconds() -> float:
    """Processor time of this process, and of its children that have ended."""
    times = os.times()
    return times.user + times.system + times.children_user + times.children_system


def ended_processor_seconds() -> float:
    """The same, once the workers have ended."""
    workers = psutil.Process().children()
    psutil.wait_procs(workers, timeout=10)
    return processor_seconds()


@contextmanager
def local_cluster() -> Iterator[str]:
    """The address of two processes of Dask's own."""
    from distributed import LocalCluster

    with LocalCluster(
        n_workers=2, threads_per_worker=1, dashboard_address=None, silence_logs=50
    ) as cluster:
        yield str(cluster.scheduler_address)


def measured(n_maps: int) -> dict[str, Taken]:
    """What each way to label takes, in turn."""
    with tempfile.TemporaryDirectory() as name, local_cluster() as address:
        folder = Path(name)
        maps, out = folder / "maps", folder / "out"
        write_maps(maps, n_maps)
        found = {"single maps, one after the other": single_seconds(maps, out)}
        for title, workers in (
            ("1 process", LocalWorkers(1)),
            ("2 processes", LocalWorkers(2)),
            ("Dask, LocalCluster of 2", DaskWorkers(address)),
        ):
            shutil.rmtree(out)
            found[title] = batch_seconds(maps, out, workers)
        return found


def run(quick: bool) -> list[dict[str, Any]]:
    """The rows of the table."""
    n_maps = N_MAPS_QUICK if quick else N_MAPS
    found = measured(n_maps)
    alone, one = found["single maps, one after the other"], found["1 process"]
    return [
        {
            "maps": n_maps,
            "by": title,
            "wall s": taken.wall_s,
            "maps a second": n_maps / taken.wall_s,
            "against 1 process": one.wall_s / taken.wall_s,
            "against the sum of single maps": alone.wall_s / taken.wall_s,
            "processor s": taken.processor_s,
        }
        for title, taken in found.items()
    ]
