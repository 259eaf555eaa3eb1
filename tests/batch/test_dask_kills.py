"""Clients, workers and schedulers of a cluster that grows and shrinks are killed; no map is lost.

``PGM_PLACES_KILLS=25`` kills so many times, at moments that ``PGM_PLACES_SEED`` draws.
"""

import os
import random
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any
from unittest.mock import patch

import pytest

from pgm_places.batch.append_only_csv import AppendOnlyCsv
from pgm_places.io.maps.map_server import save_map
from pgm_places.simulation import generate_building

distributed = pytest.importorskip("distributed")

pytestmark = pytest.mark.slow

N_MAPS, PATIENCE_S = 8, 400.0
KILLS = int(os.environ.get("PGM_PLACES_KILLS", "3"))
SEED = int(os.environ.get("PGM_PLACES_SEED", "0"))
VICTIMS = ("worker", "client", "scheduler")


class Cluster:
    """A scheduler and workers, each a process that may be killed and started again."""

    def __init__(self, port: int) -> None:
        self.address, self._port = f"tcp://127.0.0.1:{port}", port
        self.scheduler = self._start_scheduler()
        self.workers = [self._start_worker() for _ in range(2)]

    def kill(self, victim: str, rng: random.Random) -> None:
        """Kill the scheduler, whose workers end with it, or a worker, and start anew."""
        if victim == "scheduler":
            end(self.scheduler, *self.workers)
            self.scheduler = self._start_scheduler()
            self.workers = [self._start_worker() for _ in range(rng.randint(1, 3))]
        else:
            end(self.workers.pop(rng.randrange(len(self.workers))))
            self.workers += [self._start_worker() for _ in range(rng.randint(1, 2))]

    def wait(self) -> None:
        """Wait for a worker: processes start slowly where many do, and commands wait for 20 s."""
        with distributed.Client(self.address, timeout=PATIENCE_S, set_as_default=False) as client:
            client.wait_for_workers(1, timeout=PATIENCE_S)

    def clients(self) -> set[str]:
        """The clients that wait for results."""
        with distributed.Client(self.address, timeout=PATIENCE_S, set_as_default=False) as client:
            return set(client.run_on_scheduler(clients_at_work))

    def end(self) -> None:
        """Kill them all."""
        end(self.scheduler, *self.workers)

    def _start_scheduler(self) -> "subprocess.Popen[bytes]":
        return start("dask_scheduler", "--port", str(self._port), "--host", "127.0.0.1")

    def _start_worker(self) -> "subprocess.Popen[bytes]":
        return start("dask_worker", self.address, "--nthreads", "1", "--no-nanny")


def clients_at_work(dask_scheduler: Any) -> list[str]:
    return [name for name, client in dask_scheduler.clients.items() if client.wants_what]


def start(module: str, *words: str) -> "subprocess.Popen[bytes]":
    quiet = subprocess.DEVNULL
    command = [sys.executable, "-m", f"distributed.cli.{module}", *words, "--no-dashboard"]
    return subprocess.Popen(command, stdout=quiet, stderr=quiet)


def end(*processes: "subprocess.Popen[bytes]") -> None:
    for process in processes:
        process.kill()
        process.wait()


@pytest.fixture
def cluster(free_port: int) -> Iterator[Cluster]:
    with patch.dict(os.environ, PYTHONSAFEPATH="1", PYTHONPATH=os.pathsep.join(sys.path)):
        running = Cluster(free_port)
        yield running
        running.end()


@pytest.fixture
def free_port() -> int:
    import socket

    with socket.socket() as found:
        found.bind(("127.0.0.1", 0))
        return int(found.getsockname()[1])


def done(out: Path) -> dict[Path, int]:
    """The manifests that are there, and when each was written."""
    return {path: path.stat().st_mtime_ns for path in out.glob("*/details/manifest.json")}


def test_kills_lose_nothing_and_nothing_is_done_twice(
    cluster: Cluster, model: Path, tmp_path: Path
) -> None:
    for seed in range(1, N_MAPS + 1):
        save_map(
            generate_building(seed, size="small", resolution_m=0.2).grid, tmp_path / f"in/f{seed}"
        )
    label = ["label", "in", "-m", str(model), "-o", "out", "-q", "--scheduler", cluster.address]
    command = [sys.executable, "-m", "pgm_places", *label]
    out, rng, n_killed = tmp_path / "out", random.Random(SEED), 0
    earlier: dict[Path, int] = {}
    victim: str | None = VICTIMS[0]
    while victim is not None or len(earlier) < N_MAPS:  # the last run tidies up, and is not killed
        if n_killed < KILLS and len(earlier) >= N_MAPS - 2:  # so that there is work left
            for path in list(earlier)[: N_MAPS - 2]:
                path.unlink()
            earlier = done(out)
        cluster.wait()
        victim = VICTIMS[n_killed % len(VICTIMS)] if n_killed < KILLS else None
        before = cluster.clients()
        with subprocess.Popen(command, cwd=tmp_path, stderr=subprocess.PIPE, text=True) as client:
            given_up = time.monotonic() + PATIENCE_S
            # Workers may still finish a map of the client that was killed before: only when this
            # client has handed out maps, what becomes done is its own.
            while victim and client.poll() is None and not cluster.clients() - before:
                assert time.monotonic() < given_up
                time.sleep(0.02)
            wanted = len(done(out)) + rng.randint(1, 2)
            while victim and client.poll() is None and len(done(out)) < wanted:
                assert time.monotonic() < given_up
                time.sleep(0.02)
            was_alive = client.poll() is None
            if victim == "client":
                client.kill()
            elif victim is not None:
                cluster.kill(victim, rng)
            _, error = client.communicate(timeout=PATIENCE_S)
        n_killed += was_alive and victim is not None
        now = done(out)
        assert earlier.items() <= now.items(), "a map was lost, or done twice"
        earlier = now
        print(f"{n_killed} killed, the last one {victim}; {len(now)} maps done")  # noqa: T201
        assert "Traceback" not in error
        if victim == "scheduler" and was_alive and len(now) < N_MAPS:
            assert client.returncode == 2
            assert "finished maps will be skipped" in error
        elif victim not in ("client", "scheduler"):
            assert client.returncode == 0, error
    rows = AppendOnlyCsv(out / "summary.csv", ("name",)).rows()
    assert [row["name"] for row in rows] == [f"f{seed}" for seed in range(1, N_MAPS + 1)]
    assert not list(out.rglob(".*.tmp"))
