"""Many maps: two processes against one, a cluster, and fifty kills.

Generated floors, and floors tiled side by side, labelled with the model that ships with the package
by `pgm-places label`. A single map is labelled in this process, one after the other with the model
and the kernels loaded: the sum of those is what a batch on one process is compared with, which also
starts a process and loads both. Each worker has one thread. The cluster is Dask's `LocalCluster` of
two processes, then a scheduler and two workers started by themselves that speak TCP on 127.0.0.1.
For the kills, a batch on two processes is begun again and again; each time, after a while drawn by
chance, the batch or one of its workers is killed (`kill -9`). A map is lost if it is not done in
the end, and done twice if it is written again after it was complete.
`python -m benchmarks.batch --maps 30` takes fewer maps than a thousand.
"""

import argparse
import random
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import psutil

from pgm_places.batch.dask_workers import DaskWorkers
from pgm_places.batch.found_maps import find_maps
from pgm_places.batch.label_batch import label_batch
from pgm_places.batch.label_options import LabelOptions
from pgm_places.batch.local_workers import LocalWorkers
from pgm_places.batch.map_task import MapTask, label_one
from pgm_places.batch.outcomes import LabelledRow
from pgm_places.batch.ready_model import ready_model
from pgm_places.batch.workers import Workers
from pgm_places.datasets import building_tiled, generate_building
from pgm_places.io.maps.map_server import save_map
from pgm_places.progress import Silent

N_MAPS, N_MAPS_QUICK = 1000, 12
N_KILLS, N_KILLS_QUICK = 50, 4
DIFFERENT, TILED_EVERY, TILED_CELLS = 20, 10, 400
OPTIONS = LabelOptions()


def write_maps(folder: Path, n_maps: int) -> None:
    """Maps as files: every tenth is tiled, the others are one small floor each."""
    for number in range(n_maps):
        seed = number % DIFFERENT
        if number % TILED_EVERY == TILED_EVERY - 1:
            made = building_tiled(TILED_CELLS, seed, resolution_m=0.1, floors=2)
        else:
            made = generate_building(seed, size="small", resolution_m=0.05)
        (folder / f"floor{number:04d}").mkdir(parents=True)
        save_map(made.grid, folder / f"floor{number:04d}" / "map")


def single_seconds(maps: Path, out: Path) -> float:
    """Wall seconds of all maps, one after the other in this process."""
    sha256 = ready_model(OPTIONS).sha256
    total = 0.0
    for first, found in enumerate(find_maps([str(maps)], out).maps):
        task = MapTask(found.name, found.path, out / found.name, OPTIONS, sha256)
        if not first:  # compiles
            label_one(MapTask("warm", found.path, out / "warm", OPTIONS, sha256))
        start = time.perf_counter()
        assert isinstance(label_one(task), LabelledRow)
        total += time.perf_counter() - start
    return total


def batch_seconds(maps: Path, out: Path, workers: Workers) -> float:
    """Wall seconds of a batch."""
    start = time.perf_counter()
    found = find_maps([str(maps)], out)
    done = label_batch(found.maps, out, OPTIONS, workers, progress=Silent())
    assert len(done.rows) == len(found.maps)
    return time.perf_counter() - start


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


def kills(maps: Path, out: Path, n_kills: int, seconds: float) -> dict[str, Any]:
    """What is lost and what is done twice where a batch is killed again and again."""
    rng = random.Random(0)
    command = [sys.executable, "-m", "pgm_places", "label", str(maps), "--out", str(out), "-j", "2"]
    n_maps, n_killed, n_begun, done_twice = len(list(maps.iterdir())), 0, 0, 0
    done: dict[Path, int] = {}
    while n_killed < n_kills:
        n_begun += 1
        if n_begun % 10 == 0:  # so that there is work left for the kills that follow
            for path in out.glob("floor*"):
                subprocess.run(["rm", "-r", str(path)], check=True)
            done = {}
        with subprocess.Popen([*command, "-q"], stdout=subprocess.DEVNULL) as batch:
            time.sleep(rng.uniform(0.0, seconds))
            children = psutil.Process(batch.pid).children() if batch.poll() is None else []
            victim = rng.choice([None, *children])
            if batch.poll() is None:
                n_killed += 1
                (batch if victim is None else victim).kill()
        now = {path: path.stat().st_mtime_ns for path in out.glob("*/manifest.json")}
        done_twice += sum(now.get(path) != written for path, written in done.items())
        done = now
    subprocess.run([*command, "-q"], check=True, stdout=subprocess.DEVNULL)
    lost = n_maps - len(list(out.glob("*/manifest.json")))
    left = len(list(out.glob(".*.tmp")))
    return {"kills": n_killed, "lost": lost, "done twice": done_twice, "left behind": left}


def run(quick: bool, n_maps: int | None = None, n_kills: int | None = None) -> list[dict[str, Any]]:
    """The rows of the tables."""
    n_maps = n_maps or (N_MAPS_QUICK if quick else N_MAPS)
    n_kills = (N_KILLS_QUICK if quick else N_KILLS) if n_kills is None else n_kills
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        write_maps(folder / "maps", n_maps)
        alone = single_seconds(folder / "maps", folder / "single")
        seconds = {"single maps, one after the other": alone}
        for n_jobs in (1, 2):
            title = f"{n_jobs} process{'es' if n_jobs > 1 else ''}"
            workers = LocalWorkers(n_jobs)
            seconds[title] = batch_seconds(folder / "maps", folder / f"local{n_jobs}", workers)
        for title, cluster in (
            ("Dask, LocalCluster of 2", local_cluster),
            ("Dask, 2 workers over TCP", tcp_cluster),
        ):
            with cluster() as address:
                out = folder / cluster.__name__
                seconds[title] = batch_seconds(folder / "maps", out, DaskWorkers(address))
        one = seconds["1 process"]
        rows: list[dict[str, Any]] = [
            {
                "maps": n_maps,
                "by": title,
                "wall s": taken,
                "maps a second": n_maps / taken,
                "against 1 process": one / taken,
                "against the sum of single maps": alone / taken,
            }
            for title, taken in seconds.items()
        ]
        if n_kills:
            longest = max(seconds["2 processes"], 10.0) / 2
            rows.append(kills(folder / "maps", folder / "killed", n_kills, longest))
    return rows


if __name__ == "__main__":
    from benchmarks.__main__ import markdown_table

    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--maps", type=int, help=f"how many; {N_MAPS} by default")
    parser.add_argument("--kills", type=int, help=f"how many; {N_KILLS} by default")
    parser.add_argument("--quick", action="store_true")
    chosen = parser.parse_args()
    print(markdown_table(run(chosen.quick, chosen.maps, chosen.kills)))
