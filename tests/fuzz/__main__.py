"""``python -m tests.fuzz [READER ...] --count N``: spoil every reader's files N times."""

import argparse
import sys
import tempfile
import time
from pathlib import Path

from tests.fuzz.loop import MOST_BYTES, peak_bytes, run
from tests.fuzz.readers import READERS
from tests.fuzz.seeds import remember_definitions, seeds

PIECE = 100
"""Inputs of one seed."""
MEMORY = Path("/dev/shm")
"""Files in memory are written a hundred times as fast as on a disk."""


def main() -> None:
    """Run the readers in turn; a line for each, and the inputs that found something as files."""
    parser = argparse.ArgumentParser(prog="python -m tests.fuzz", description=__doc__)
    parser.add_argument("readers", nargs="*", help=f"of {', '.join(READERS)}; all by default")
    parser.add_argument("--count", type=int, default=10_000, help="inputs for each reader")
    parser.add_argument("--seconds", type=float, default=float("inf"), help="at most, for each")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--findings", type=Path, default=Path("fuzz-findings"))
    options = parser.parse_args()
    remember_definitions()
    failed = 0
    for name in options.readers or READERS:
        with tempfile.TemporaryDirectory(dir=MEMORY if MEMORY.is_dir() else None) as folder:
            seeds(Path(folder))
            failed += _fuzz(name, Path(folder), options)
    sys.exit(failed > 0)


def _fuzz(name: str, folder: Path, options: argparse.Namespace) -> int:
    start, done, read, bad, peak = time.monotonic(), 0, 0, 0, peak_bytes()
    while done < options.count and time.monotonic() - start < options.seconds:
        piece = min(PIECE, options.count - done)
        found = run(READERS[name], folder, options.seed * 1_000_000 + done // PIECE, piece)
        done, read = done + piece, read + found.n_read
        for problem, data in found.bad:
            bad += 1
            options.findings.mkdir(exist_ok=True)
            target = options.findings / f"{name.replace('/', '-')}-{bad}"
            target.write_bytes(data)
            print(f"{name}: {problem}\n  kept as {target}", flush=True)  # noqa: T201
    seconds = time.monotonic() - start
    grown = peak_bytes() - peak
    if grown > 2 * MOST_BYTES:  # a little lost with every input is no finding of any of them
        bad += 1
        print(f"{name}: memory grew by {grown >> 20} MB in all", flush=True)  # noqa: T201
    line = f"{name}: {done} inputs, {read} read, {done - read - bad} refused, {bad} findings"
    print(f"{line}, {seconds:.0f} s, {grown >> 20} MB", flush=True)  # noqa: T201
    return bad


if __name__ == "__main__":
    main()
