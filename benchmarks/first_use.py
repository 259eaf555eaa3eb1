"""First use: waiting times of commands in fresh processes.

They run on the real map of building 79 at 5 cm if the data is available, otherwise on the generated
building. Processor seconds are those of all threads. Python's bytecode is there, as it is once a
package has been installed.
"""

import compileall
import os
import resource
import statistics
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

from benchmarks.labelling import map_files

ROOT = Path(__file__).resolve().parent.parent


def spent() -> float:
    """Processor seconds of all processes that were waited for."""
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime


def command_seconds(arguments: list[str]) -> tuple[float, float]:
    """Wall and processor seconds of a command."""
    environment = {**os.environ, "PYTHONPATH": str(ROOT)}
    environment.pop("PYTHONDONTWRITEBYTECODE", None)
    start, before = time.perf_counter(), spent()
    subprocess.run(
        [sys.executable, "-P", "-m", "pgm_places", *arguments, "--quiet"],
        check=True,
        env=environment,
        stdout=subprocess.DEVNULL,
    )
    return time.perf_counter() - start, spent() - before


def run(quick: bool) -> list[dict[str, Any]]:
    """The rows of the table."""
    for sources in ("pgm_places", "models", "solvers"):
        compileall.compile_dir(ROOT / sources, quiet=1)
    rows: list[dict[str, Any]] = []
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        _, map_yaml, _ = map_files(folder)
        out = ["--out", str(folder / "out")]
        commands = {"label": ["label", str(map_yaml), *out], "demo": ["demo", *out]}
        for command, words in commands.items():
            for n_threads in (1, os.cpu_count() or 1):
                with_threads = [*words, "--threads", str(n_threads)]
                found = [command_seconds(with_threads) for _ in range(1 if quick else 5)]
                rows.append(
                    {
                        "command": f"pgm-places {command}",
                        "threads": n_threads,
                        "runs": len(found),
                        "wall s": statistics.median(wall for wall, _ in found),
                        "processor s": statistics.median(processor for _, processor in found),
                    }
                )
    return rows
