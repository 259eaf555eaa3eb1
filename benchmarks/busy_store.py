"""Small maps labelled on this machine, and by two Dask workers on a local S3 that is often busy.

The maps are those of `benchmarks.many_maps`, and all of them are labelled; `--outputs none` by
default, so that one takes a few hundredths of a second. The S3 (`busy_store.js`) answers `--busy`
of the requests with 503. On the way a table is printed: speed, processor time, memory and files.
In the end: whether all files are equal to the byte, with the address of the map and the seconds
left out where they stand. A run that was broken off goes on in its `--folder`.
Needs `pip install s3fs distributed`, and `npm install s3rver` in the folder that `--node` names.
"""

import argparse
import json
import os
import re
import shutil
import subprocess
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import psutil

from benchmarks.many_maps import write_maps, write_model
from pgm_places.io.output_set import RECORD_FILE
from pgm_places.io.places.result_folder import MANIFEST_FILE

STORE, SCHEDULER = 15666, 18790
THREADS = "4"
"""Of each worker: requests of one map are waited for while others are labelled."""
MARKS = (100, 1_000, 2_500, 5_000, 7_500, 10_000)
"""Numbers of maps at which a row of the table is printed; and at the end."""

ENDPOINT = f"http://127.0.0.1:{STORE}"
ENVIRONMENT = {
    **os.environ,
    "AWS_ACCESS_KEY_ID": "S3RVER",
    "AWS_SECRET_ACCESS_KEY": "S3RVER",
    "AWS_DEFAULT_REGION": "us-east-1",
    "AWS_ENDPOINT_URL": ENDPOINT,
    "AWS_REQUEST_CHECKSUM_CALCULATION": "when_required",  # newer than the store
    "PYTHONSAFEPATH": "1",
    "OMP_NUM_THREADS": "1",
    "OPENBLAS_NUM_THREADS": "1",
}
OBJECT = "._S3rver_object"
"""The end of the name of an object's file in the store."""


@contextmanager
def started(words: Sequence[str], **more: Any) -> Iterator[psutil.Process]:
    """A process that ends with the block."""
    quiet = subprocess.DEVNULL
    with subprocess.Popen(words, stdout=quiet, stderr=quiet, **more) as process:
        yield psutil.Process(process.pid)
        process.terminate()


def watched(
    words: list[str],
    n_maps: int,
    done: Callable[[], int],
    n_files: Callable[[], int],
    workers: Sequence[psutil.Process] = (),
) -> None:
    """Run a command to its end; prints rows of the table on the way."""
    print("| maps | maps/s | processor ms a map | client MB | largest worker MB | files |")
    start = last = time.monotonic()
    n_before, seconds_before, at_first = 0, 0.0, done()
    seen: dict[int, tuple[float, int]] = {}
    command = [sys.executable, "-m", "pgm_places", *words]
    with subprocess.Popen(command, env=ENVIRONMENT, stdout=subprocess.DEVNULL) as process:
        client = psutil.Process(process.pid)
        n_before = at_first
        marks = [n for n in MARKS if at_first < n < n_maps] + [n_maps]
        while marks:
            is_over = process.poll() is not None
            for item in () if is_over else (client, *client.children(recursive=True), *workers):
                try:
                    times = item.cpu_times()
                    seen[item.pid] = times.user + times.system, item.memory_info().rss
                except psutil.Error:  # it has just ended
                    continue
            n, now = done(), time.monotonic()
            if n >= marks[0] or is_over:
                marks = [] if is_over else [mark for mark in marks if mark > n]
                seconds = sum(used for used, _ in seen.values())
                each = 1000 * (seconds - seconds_before) / max(n - n_before, 1)
                others = [memory for pid, (_, memory) in seen.items() if pid != client.pid]
                rate = (n - n_before) / (now - last)
                memory = f"{seen[client.pid][1] / 1e6:.0f} | {max(others, default=0) / 1e6:.0f}"
                print(f"| {n:,} | {rate:.1f} | {each:.0f} | {memory} | {n_files():,} |", flush=True)
                n_before, last, seconds_before = n, now, seconds
            time.sleep(0.0 if is_over else 2.0)
    print(f"exit {process.returncode}, {time.monotonic() - start:.0f} s, {at_first:,} done before")


def files_below(folder: Path, end: str = "") -> Iterator[str]:
    """The files of results, relative, without the lists and what is beside the folders."""
    for path, _, names in os.walk(folder):
        below = os.path.relpath(path, folder)
        if not below.startswith("."):
            yield from (f"{below}/{n.removesuffix(end)}" for n in names if n.endswith(end))


def comparable(name: str, text: bytes) -> bytes:
    """The bytes of a file, without the map's address and the seconds that labelling took.

    They stand in two files, whose hashes stand in the record of files.
    """
    if name.endswith(RECORD_FILE):
        return re.sub(rb'"details/(manifest|summary)\.json": {[^}]*}', b"", text)
    if not name.endswith(("manifest.json", "summary.json")):
        return text
    return re.sub(rb'\n *"(map|seconds)": [^\n]*', b"", text)


def differing(near: Path, far: Path) -> tuple[int, int, list[str]]:
    """Maps that are done in both folders, their files, and those that are not equal."""
    names, far_names = set(files_below(near)), set(files_below(far, OBJECT))
    end = f"/{MANIFEST_FILE}"
    done = {name.removesuffix(end) for name in names & far_names if name.endswith(end)}
    every = {name for name in names | far_names if "/".join(name.split("/")[:2]) in done}
    unequal = every - (names & far_names)
    for name in every - unequal:
        one, other = (near / name).read_bytes(), (far / f"{name}{OBJECT}").read_bytes()
        if comparable(name, one) != comparable(name, other):
            unequal.add(name)
    return len(done), len(every), sorted(unequal)


def label_near(folder: Path, n_maps: int, label: list[str]) -> None:
    """Label the maps on this machine."""
    near = folder / "near"
    rows = near / "summary.csv"

    def n_rows() -> int:
        return max(rows.read_bytes().count(b"\n") - 1, 0) if rows.exists() else 0

    watched(
        ["label", str(folder / "maps"), "-o", str(near), "-j", "2", *label],
        n_maps,
        n_rows,
        lambda: sum(1 for _ in files_below(near)),
    )


def label_far(folder: Path, n_maps: int, label: list[str], busy: float, node: Path) -> None:
    """Label the maps of the store."""
    store, counts = folder / "store", folder / "counts"
    words = [
        "node",
        "--openssl-legacy-provider",
        str(Path(__file__).with_suffix(".js")),
        str(store),
        str(STORE),
    ]
    found = {"env": {**ENVIRONMENT, "NODE_PATH": str(node / "node_modules")}}
    for source in sorted((folder / "maps").glob("*/*")):
        target = store / "fleet" / source.relative_to(folder).with_name(f"{source.name}{OBJECT}")
        if not target.exists():
            target.parent.mkdir(parents=True, exist_ok=True)
            shutil.copyfile(source, target)
    out = store / "fleet" / "out"
    before = sum(1 for _ in out.glob(f"*/*/details/manifest.json{OBJECT}"))
    shutil.rmtree(counts, ignore_errors=True)
    counts.mkdir()

    def counted() -> Counter[str]:
        found = (json.loads(path.read_text(encoding="utf-8")) for path in counts.glob("*.json"))
        return sum(map(Counter, found), Counter[str]())

    address = f"tcp://127.0.0.1:{SCHEDULER}"
    dask = [sys.executable, "-P", "-m", "distributed.cli.dask_"]
    listen = ["--host", "127.0.0.1", "--no-dashboard"]
    scheduler = [*dask[:-1], f"{dask[-1]}scheduler", "--port", str(SCHEDULER), *listen]
    worker = [
        *dask[:-1],
        f"{dask[-1]}worker",
        address,
        "--nthreads",
        THREADS,
        "--no-nanny",
        *listen,
    ]
    with (
        started([*words, str(busy), str(counts)], **found),
        started(scheduler, env=ENVIRONMENT),
        started(worker, env=ENVIRONMENT) as one,
        started(worker, env=ENVIRONMENT) as other,
    ):
        time.sleep(5)
        watched(
            ["label", "s3://fleet/maps", "-o", "s3://fleet/out", "--scheduler", address, *label],
            n_maps,
            lambda: before + counted()["done"],
            lambda: sum(1 for _ in files_below(out, OBJECT)),
            (one, other),
        )
        time.sleep(2)
    print(dict(counted()), flush=True)


def main() -> None:
    """Label the maps twice, and compare."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--maps", type=int, default=10_000)
    parser.add_argument("--busy", type=float, default=0.05)
    parser.add_argument("--outputs", default="none")
    parser.add_argument("--node", type=Path, default=Path())
    parser.add_argument("--folder", type=Path)
    parser.add_argument("--parts", default="near,far,compare")
    given = parser.parse_args()
    folder = given.folder or Path(tempfile.mkdtemp(prefix="pgm_places_store_"))
    print(folder)
    if not (folder / "made").exists():
        write_model(folder / "model")
        write_maps(folder / "maps", given.maps)
        (folder / "made").touch()
    label = ["-m", str(folder / "model"), "-q", "--outputs", given.outputs]
    if "near" in given.parts:
        label_near(folder, given.maps, label)
    if "far" in given.parts:
        label_far(folder, given.maps, label, given.busy, given.node.absolute())
    if "compare" in given.parts:
        n_done, n_files, unequal = differing(folder / "near", folder / "store" / "fleet" / "out")
        print(f"{n_done:,} maps, {n_files:,} files, {len(unequal)} differ {unequal[:5]}")


if __name__ == "__main__":
    main()
