"""First use: waiting times before anything has been compiled.

The commands run in fresh processes on the real map of building 79 at 5 cm if the data is available,
otherwise on the generated building; ``cold`` starts with an empty cache of compiled kernels,
``warm`` with one that a previous run has filled: it links the machine code that it finds there and
never imports numba. A cold run compiles later stages in a second process unless it is limited to
one thread. Processor seconds include both processes. The second table compiles each stage
separately, in a fresh process: imports, then all kernels of the stage, in processor seconds.
Python's bytecode is there in all of them, as it is once a package has been installed; without it a
warm run takes 1.3 times the processor time. Linking the kernels of a warm run takes 0.05 s of it.
"""

import compileall
import json
import os
import resource
import statistics
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parent.parent
STAGES = ("casting", "features", "segments", "space", "relaxation", "topology")
MEASURE = "--measure"


def spent() -> float:
    """Processor seconds of all processes that were waited for."""
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime


def command_seconds(arguments: list[str], cache: Path) -> tuple[float, float]:
    """Wall and processor seconds of a command, with a folder for kernels."""
    changes = {"PGM_PLACES_CACHE_DIR": str(cache), "PYTHONPATH": str(ROOT)}
    environment = {**os.environ, **changes}
    environment.pop("PYTHONDONTWRITEBYTECODE", None)
    start, before = time.perf_counter(), spent()
    subprocess.run(
        [sys.executable, "-P", "-m", "pgm_places", *arguments, "--quiet"],
        check=True,
        env=environment,
        stdout=subprocess.DEVNULL,
    )
    return time.perf_counter() - start, spent() - before


def command_rows(
    name: str, arguments: list[str], folder: Path, repeats: int
) -> list[dict[str, Any]]:
    """Rows of one command: cold, on one thread, warm; taken in turn."""
    found: dict[str, list[tuple[float, float]]] = {}
    for _ in range(repeats):
        for kind in ("cold", "cold, one thread", "warm"):
            words = [*arguments, *(["--threads", "1"] if "one thread" in kind else [])]
            with tempfile.TemporaryDirectory(dir=folder) as cache:
                if kind == "warm":
                    command_seconds(words, Path(cache))
                seconds = command_seconds(words, Path(cache))
                found.setdefault(kind, []).append(seconds)
    return [
        {
            "command": f"pgm-places {name}",
            "kernels": kind,
            "runs": repeats,
            "wall s": statistics.median(wall for wall, _ in values),
            "processor s": statistics.median(processor for _, processor in values),
        }
        for kind, values in found.items()
    ]


def stage_row(stage: str) -> dict[str, Any]:
    """What compiling a stage takes, measured in a process of its own."""
    with tempfile.TemporaryDirectory() as cache:
        done = subprocess.run(
            [sys.executable, "-m", "benchmarks.first_use", MEASURE, stage],
            check=True,
            env={**os.environ, "PGM_PLACES_CACHE_DIR": cache},
            capture_output=True,
            text=True,
        )
    row: dict[str, Any] = json.loads(done.stdout)
    return row


def measure(stage: str) -> dict[str, Any]:
    """Import numba and go through a stage on a tiny map, in this process."""
    start = time.process_time()
    from numba.core import event

    imported = time.process_time() - start
    begun: list[float] = []
    outermost: list[float] = []

    class Listener(event.Listener):  # type: ignore[misc]
        def on_start(self, _: Any) -> None:
            begun.append(time.process_time())

        def on_end(self, _: Any) -> None:
            seconds = time.process_time() - begun.pop()
            if not begun:  # what a kernel calls is compiled within it
                outermost.append(seconds)

    event.register("numba:compile", Listener())
    if stage == "casting":
        cast_a_room()
    else:
        from pgm_places.cli.warm_up import STAGES

        STAGES[stage]()
    return {
        "stage": stage,
        "kernels": len(outermost),
        "compiling s": sum(outermost),
        "importing numba s": imported,
        "all s": time.process_time() - start,
    }


def cast_a_room() -> None:
    """Cast the scans of a room with a pillar."""
    import numpy as np

    from pgm_places.maps.occupancy_grid import OccupancyGrid
    from pgm_places.sensing.ray_casting import cast_cells
    from pgm_places.sensing.sensor import Sensor

    cells = np.full((30, 30), 100, np.int8)
    cells[5:25, 5:25] = 0
    cells[12, 12] = 100
    cast_cells(OccupancyGrid(cells, 0.1), Sensor(), n_threads=1)


def run(quick: bool) -> list[dict[str, Any]]:
    """The rows of both tables."""
    from benchmarks.labelling import map_files  # it imports numba: measured processes do not

    for sources in ("pgm_places", "models", "solvers"):
        compileall.compile_dir(ROOT / sources, quiet=1)
    repeats = 1 if quick else 5
    rows: list[dict[str, Any]] = []
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        _, map_yaml, _ = map_files(folder)
        out = ["--out", str(folder / "out")]
        rows += command_rows("label", ["label", str(map_yaml), *out], folder, repeats)
        if not quick:
            rows += command_rows("demo", ["demo", *out], folder, 3)
    return [*rows, *(stage_row(stage) for stage in STAGES)]


if __name__ == "__main__":
    if MEASURE in sys.argv:
        print(json.dumps(measure(sys.argv[-1])))
    else:
        from benchmarks.__main__ import markdown_tables

        print(markdown_tables(run("--quick" in sys.argv)))
