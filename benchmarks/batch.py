"""Many maps: two processes against one, a cluster, and fifty kills.

Parts of generated floors, and such parts tiled side by side, labelled with the model that ships
with the package by `pgm-places label`. A single map is labelled in this process, one after the
other with the model and the kernels loaded: the sum of those is what a batch on one process is
compared with, which also starts a process and loads both. Each worker has one thread. The cluster
is Dask's `LocalCluster` of two processes, then a scheduler and two workers started by themselves
that speak TCP on 127.0.0.1.
Processor time is that of all processes of the batch together, which other work on the machine
changes little; that of a cluster's workers is not known here.
For the kills, a batch of 10 smaller maps on two processes is begun again and again; each time, at a
moment drawn by chance from the time that four maps take, the batch or one of its workers is killed
(`kill -9`). A map is lost if it was complete and is not any more, or is not done in the end,
and done twice if it is written again after it was complete.
The stages can be run one at a time, such as `--stages single,1`; what a stage found is kept until
all are done. `--maps 30` takes fewer maps than a thousand.
"""

import argparse
import json
import os
import random
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator, Sequence
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
from pgm_places.datasets import generate_building
from pgm_places.io.maps.map_server import save_map
from pgm_places.labelling.model import LoadedModel
from pgm_places.labelling.options import LabelOptions
from pgm_places.maps.occupancy_grid import OccupancyGrid
from pgm_places.progress import Silent

N_MAPS, N_MAPS_QUICK = 1000, 12
N_KILLS, N_KILLS_QUICK = 50, 4
N_KILLED_MAPS, N_FIRST = 10, 4
DIFFERENT, TILED_EVERY, PART_M, SMALL_PART_M = 20, 10, 3.0, 2.0
OPTIONS = LabelOptions()


def write_maps(folder: Path, n_maps: int, part_m: float = PART_M) -> None:
    """Maps as files, each the left end of a small floor; every tenth twice that, side by side."""
    floors = [
        generate_building(seed, size="small", resolution_m=0.05).grid for seed in range(DIFFERENT)
    ]
    for number in range(n_maps):
        grid = floors[number % DIFFERENT]
        cells = grid.cells[:, : round(part_m / grid.resolution_m)]
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


@contextmanager
def tcp_cluster() -> Iterator[str]:
    """The address of a scheduler with two workers, each a command of its own."""
    address = "tcp://127.0.0.1:18786"
    worker = ["distributed.cli.dask_worker", address, "--nthreads", "1", "--no-dashboard"]
    commands = [
        ["distributed.cli.dask_scheduler", "--port", "18786", "--no-dashboard"],
        worker,
        worker,
    ]
    started = []
    try:
        for module, *arguments in commands:
            command = [sys.executable, "-m", module, *arguments]
            quiet = subprocess.DEVNULL
            started.append(subprocess.Popen(command, stdout=quiet, stderr=quiet))
        yield address
    finally:
        for process in reversed(started):
            process.terminate()
            process.wait()


def kills(folder: Path, n_kills: int) -> dict[str, Any]:
    """What is lost and what is done twice where a batch is killed again and again."""
    maps, out, rng = folder / "small", folder / "out", random.Random(0)
    write_maps(maps, N_KILLED_MAPS, SMALL_PART_M)
    few = sorted(maps.iterdir())[:N_FIRST]
    longest_s = seconds_of(few, folder / "first")
    n_killed, lost, done_twice = 0, 0, 0
    done: dict[Path, int] = {}
    start = time.perf_counter()
    while n_killed < n_kills:
        if len(done) == N_KILLED_MAPS:  # so that there is work left for the kills that follow
            shutil.rmtree(out)
            done = {}
        n_killed += killed([maps], out, rng.uniform(0.0, longest_s), rng)
        now = {path: path.stat().st_mtime_ns for path in out.glob("*/map/manifest.json")}
        lost += len(done.keys() - now.keys())
        done_twice += sum(now[path] != done[path] for path in done.keys() & now.keys())
        done = now
        print(f"{n_killed} kills: {lost} lost, {done_twice} done twice", flush=True)
    subprocess.run(command_of([maps], out), check=True, stdout=subprocess.DEVNULL)
    return {
        "kills": n_killed,
        "drawn from (s)": longest_s,
        "wall s": time.perf_counter() - start,
        "lost": lost + N_KILLED_MAPS - len(list(out.glob("*/map/manifest.json"))),
        "done twice": done_twice,
        "left behind": len(list(out.rglob(".*.tmp"))),
    }


def killed(maps: Sequence[Path], out: Path, after_s: float, rng: random.Random) -> bool:
    """Begin a batch, and kill it or one of its workers; whether it was still at work."""
    with subprocess.Popen(command_of(maps, out), stdout=subprocess.DEVNULL) as batch:
        time.sleep(after_s)
        children = psutil.Process(batch.pid).children() if batch.poll() is None else []
        victim = rng.choice([None, *children])
        alive = batch.poll() is None
        if alive:
            (batch if victim is None else victim).kill()
    if victim is not None or not alive:  # nobody killed the batch itself
        assert batch.returncode == 0
    return alive


def command_of(maps: Sequence[Path], out: Path) -> list[str]:
    """The command that labels maps on two processes."""
    words = [sys.executable, "-m", "pgm_places", "label", *map(str, maps)]
    return [*words, "--out", str(out), "-j", "2", "-q"]


def seconds_of(maps: Sequence[Path], out: Path) -> float:
    """Wall seconds of that command, from its start to its end."""
    start = time.perf_counter()
    subprocess.run(command_of(maps, out), check=True, stdout=subprocess.DEVNULL)
    return time.perf_counter() - start


def stages(folder: Path, n_kills: int) -> dict[str, Callable[[], Any]]:
    """What is measured, each by itself."""
    maps, out = folder / "maps", folder / "out"

    def on(workers: Workers) -> Taken:
        return batch_seconds(maps, out, workers)

    def on_cluster(cluster: Callable[[], Any]) -> Taken:
        with cluster() as address:
            return on(DaskWorkers(address))

    return {
        "single": lambda: single_seconds(maps, out),
        "1": lambda: on(LocalWorkers(1)),
        "2": lambda: on(LocalWorkers(2)),
        "dask": lambda: on_cluster(local_cluster),
        "tcp": lambda: on_cluster(tcp_cluster),
        "kills": lambda: kills(folder, n_kills),
    }


TITLES = {
    "single": "single maps, one after the other",
    "1": "1 process",
    "2": "2 processes",
    "dask": "Dask, LocalCluster of 2",
    "tcp": "Dask, 2 workers over TCP",
}


def measured(
    n_maps: int, n_kills: int, chosen: Sequence[str] = (), folder: Path | None = None
) -> dict[str, Any]:
    """What the chosen stages found, all by default, and those that were run before."""
    folder = folder or Path(tempfile.gettempdir()) / f"pgm_places_batch_{n_maps}_{n_kills}"
    kept = folder / "found.json"
    if not kept.exists():
        shutil.rmtree(folder, ignore_errors=True)
        write_maps(folder / "maps", n_maps)
        kept.write_text("{}", encoding="utf-8")
    found: dict[str, Any] = json.loads(kept.read_text(encoding="utf-8"))
    for name, measure in stages(folder, n_kills).items():
        if name not in found and (not chosen or name in chosen):
            shutil.rmtree(folder / "out", ignore_errors=True)  # of a run that was broken off
            found[name] = measure()
            kept.write_text(json.dumps(found), encoding="utf-8")
            print(f"{name}: {found[name]}", flush=True)
    if len(found) == len(stages(folder, n_kills)):
        shutil.rmtree(folder)  # the next run measures anew
    return found


def rows_of(found: dict[str, Any], n_maps: int) -> list[dict[str, Any]]:
    """The rows of the tables."""
    taken = {name: Taken(*found[name]) for name in TITLES if name in found}
    alone, one = taken.get("single"), taken.get("1")
    rows: list[dict[str, Any]] = [
        {
            "maps": n_maps,
            "by": TITLES[name],
            "wall s": this.wall_s,
            "maps a second": n_maps / this.wall_s,
            "against 1 process": one and one.wall_s / this.wall_s,
            "against the sum of single maps": alone and alone.wall_s / this.wall_s,
            "processor s": this.processor_s,
        }
        for name, this in taken.items()
    ]
    return rows + ([found["kills"]] if "kills" in found else [])


def run(quick: bool) -> list[dict[str, Any]]:
    """The rows of the tables."""
    n_maps, n_kills = (N_MAPS_QUICK, N_KILLS_QUICK) if quick else (N_MAPS, N_KILLS)
    return rows_of(measured(n_maps, n_kills), n_maps)


def main() -> None:
    """Measure what is asked for."""
    from benchmarks.__main__ import markdown_tables

    known = [*TITLES, "kills"]
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--maps", type=int, default=N_MAPS, help=f"how many; {N_MAPS} by default")
    parser.add_argument("--kills", type=int, default=N_KILLS, help=f"{N_KILLS} by default")
    parser.add_argument("--stages", default="", help=f"some of {','.join(known)}; all by default")
    parser.add_argument("--folder", type=Path, help="where to keep what was measured")
    given = parser.parse_args()
    chosen = [name for name in given.stages.split(",") if name]
    unknown = [name for name in chosen if name not in known]
    if unknown:
        parser.error(f"no stage {unknown[0]}; there are {', '.join(known)}")
    found = measured(given.maps, given.kills, chosen, given.folder)
    print(markdown_tables(rows_of(found, given.maps)))


if __name__ == "__main__":
    main()
