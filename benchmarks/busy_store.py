"""Small maps labelled on this machine, and by two Dask workers on a local S3 that is often busy.

The maps are those of `benchmarks.many_maps`, and all of them are labelled. A server between the
workers and the store (`moto_server`) answers `--busy` of the requests with 503. Every quarter of
the way, maps per second and the memory of the largest process are printed; in the end, whether all
files are equal to the byte, with the address of the map and the seconds left out where they stand.
Needs `pip install "moto[server]" s3fs distributed`; `--moto` is the path of moto_server.
"""

import argparse
import http.client
import http.server
import json
import os
import random
import re
import socketserver
import subprocess
import sys
import tempfile
import threading
import time
from collections import Counter
from collections.abc import Callable
from pathlib import Path
from typing import Any, ClassVar

import fsspec
import psutil

from benchmarks.many_maps import write_maps, write_model

STORE, BUSY, SCHEDULER = 15666, 15667, 18790
BODY = b"<Error><Code>SlowDown</Code><Message>Please reduce your request rate.</Message></Error>"
ENVIRONMENT = {
    **os.environ,
    "AWS_ACCESS_KEY_ID": "test",
    "AWS_SECRET_ACCESS_KEY": "test",
    "AWS_DEFAULT_REGION": "us-east-1",
    "AWS_ENDPOINT_URL": f"http://127.0.0.1:{BUSY}",
    "PYTHONSAFEPATH": "1",
    "OMP_NUM_THREADS": "1",
    "OPENBLAS_NUM_THREADS": "1",
}


class Server(socketserver.ThreadingMixIn, http.server.HTTPServer):
    """Passes requests on to the store, but for a share of them."""

    daemon_threads, request_queue_size = True, 256
    share = 0.0
    chance = random.Random(0)
    counts: ClassVar[Counter[str]] = Counter()


class Handler(http.server.BaseHTTPRequestHandler):
    """One connection."""

    protocol_version = "HTTP/1.1"

    def log_message(self, *_: Any) -> None:
        """Say nothing."""

    def _body(self) -> bytes:
        if self.headers.get("Transfer-Encoding", "").lower() != "chunked":
            return self.rfile.read(int(self.headers.get("Content-Length") or 0))
        parts = []
        while size := int(self.rfile.readline().split(b";")[0], 16):
            parts.append(self.rfile.read(size))
            self.rfile.readline()
        self.rfile.readline()
        return b"".join(parts)

    def _pass_on(self) -> None:
        body = self._body()
        Server.counts["requests"] += 1
        if Server.chance.random() < Server.share:
            Server.counts["refused"] += 1
            self._answer(503, {"Content-Type": "application/xml"}, BODY)
            return
        store = http.client.HTTPConnection("127.0.0.1", STORE, timeout=60)
        kept = ("transfer-encoding", "connection", "expect")
        headers = {k: v for k, v in self.headers.items() if k.lower() not in kept}
        store.request(self.command, self.path, body, headers | {"Content-Length": str(len(body))})
        found = store.getresponse()
        if self.command == "PUT" and self.path.split("?")[0].endswith("/manifest.json"):
            Server.counts["done"] += 1
        left_out = ("transfer-encoding", "connection", "server", "date")
        self._answer(
            found.status,
            {k: v for k, v in found.getheaders() if k.lower() not in left_out},
            found.read(),
        )
        store.close()

    def _answer(self, status: int, headers: dict[str, str], body: bytes) -> None:
        self.send_response(status)
        for name, value in ({"Content-Length": str(len(body))} | headers).items():
            self.send_header(name, value)
        self.end_headers()
        if self.command != "HEAD":
            self.wfile.write(body)

    do_GET = do_PUT = do_POST = do_DELETE = do_HEAD = _pass_on  # noqa: N815  the library's names


def watched(words: list[str], n_maps: int, done: Callable[[], int]) -> float:
    """Run a command to its end; prints speed and memory on the way. The memory of it in MB."""
    start, quarter, most, largest, before = time.monotonic(), 1, 0.0, 0.0, 0
    last = start
    with subprocess.Popen([sys.executable, "-m", "pgm_places", *words], env=ENVIRONMENT) as process:
        while process.poll() is None:
            time.sleep(1.0)
            try:
                family = [psutil.Process(process.pid)]
                most = max(most, family[0].memory_info().rss / 1e6)
                family += family[0].children(recursive=True)
                largest = max(item.memory_info().rss for item in family) / 1e6
            except psutil.Error:
                continue
            n, now = done(), time.monotonic()
            if n >= quarter * n_maps / 4:
                speed = (n - before) / (now - last)
                print(f"{n:,} maps: {speed:.1f} maps/s, largest {largest:.0f} MB", flush=True)
                quarter, before, last = 4 * n // n_maps + 1, n, now
    print(f"exit {process.returncode}, {time.monotonic() - start:.0f} s; client {most:.0f} MB")
    return most


def comparable(path: Path, text: bytes) -> bytes:
    """The bytes of a file, without the map's address and the seconds that labelling took."""
    if path.name not in ("manifest.json", "summary.json"):
        return text
    return re.sub(rb'\n *"(map|seconds)": [^\n]*', b"", text)


def differing(near: Path, far: Path) -> tuple[int, list[str]]:
    """How many result files there are, and those that are not equal."""
    names = [
        {
            path.relative_to(folder).as_posix()
            for path in folder.rglob("*")
            if path.is_file() and path.parent != folder and ".pgm-places" not in str(path)
        }
        for folder in (near, far)
    ]
    unequal = names[0] ^ names[1]
    for name in names[0] & names[1]:
        one, other = (comparable(Path(name), (item / name).read_bytes()) for item in (near, far))
        unequal |= {name} if one != other else set()
    return len(names[0] | names[1]), sorted(unequal)


def main(n_near: int, n_far: int, busy: float, moto: str) -> None:
    """Label the maps twice, and compare."""
    folder = Path(tempfile.mkdtemp(prefix="pgm_places_store_"))
    model, maps, near = write_model(folder / "model"), folder / "maps", folder / "near"
    write_maps(maps, n_near)
    label = ["-m", str(model), "-q"]
    rows = near / "summary.csv"

    def n_rows() -> int:
        return max(rows.read_bytes().count(b"\n") - 1, 0) if rows.exists() else 0

    watched(["label", str(maps), "-o", str(near), "-j", "2", *label], n_near, n_rows)
    quiet = {"env": ENVIRONMENT, "stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL}
    command = [sys.executable, "-P", "-m", "distributed.cli"]
    started: list[subprocess.Popen[bytes]] = [
        subprocess.Popen([moto, "-H", "127.0.0.1", "-p", str(STORE)], **quiet)  # type: ignore[call-overload]
    ]
    server = Server(("127.0.0.1", BUSY), Handler)
    threading.Thread(target=server.serve_forever, daemon=True).start()
    time.sleep(8)
    address = f"http://127.0.0.1:{STORE}"
    store = fsspec.filesystem("s3", key="test", secret="test", endpoint_url=address)
    store.mkdir("fleet")
    for site in sorted(maps.iterdir())[: -(-n_far // 100)]:
        store.put(str(site), f"fleet/maps/{site.name}", recursive=True)
    address = f"tcp://127.0.0.1:{SCHEDULER}"
    listen = ["--host", "127.0.0.1", "--no-dashboard"]
    scheduler = [*command[:-1], "distributed.cli.dask_scheduler", "--port", str(SCHEDULER), *listen]
    started.append(subprocess.Popen(scheduler, **quiet))  # type: ignore[call-overload]
    time.sleep(5)
    for _ in range(2):
        worker = [*command[:-1], "distributed.cli.dask_worker", address, "--nthreads", "1"]
        worker += ["--no-nanny", *listen]
        started.append(subprocess.Popen(worker, **quiet))  # type: ignore[call-overload]
    Server.share = busy
    far = ["label", "s3://fleet/maps", "-o", "s3://fleet/out", "--scheduler", address, *label]
    watched(far, n_far, lambda: Server.counts["done"])
    print("workers", [psutil.Process(p.pid).memory_info().rss // 1_000_000 for p in started[2:]])
    print(json.dumps(Server.counts), flush=True)
    Server.share = 0.0
    store.get("fleet/out", str(folder / "far"), recursive=True)
    for process in reversed(started):
        process.terminate()
    kept = folder / "kept"
    kept.mkdir()
    for site in sorted(maps.iterdir())[: -(-n_far // 100)]:
        (near / site.name).rename(kept / site.name)
    n_files, unequal = differing(kept, folder / "far")
    print(f"{n_files:,} files, {len(unequal)} differ {unequal[:5]}; in {folder}")


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--near", type=int, default=10_000)
    parser.add_argument("--far", type=int, default=10_000)
    parser.add_argument("--busy", type=float, default=0.05)
    parser.add_argument("--moto", default="moto_server")
    given = parser.parse_args()
    main(given.near, given.far, given.busy, given.moto)
