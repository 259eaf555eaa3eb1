"""What a far folder costs where each request takes 100 ms: a plan, and a batch that is all done.

The store is in memory, and the clock is simulated: of requests, as many run at once as there are
threads, and a listing takes one for each thousand names. The maps, in folders of a hundred, and
their results are copies of one that is labelled: a result belongs to the content of its map.
"""

import argparse
import tempfile
from collections import Counter
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any
from unittest.mock import patch

from fsspec.implementations.memory import MemoryFileSystem

from benchmarks.many_maps import TOGETHER, write_maps, write_model
from pgm_places.batch.batch_folder import recorded_root
from pgm_places.batch.found_maps import FoundMaps, find_maps
from pgm_places.batch.label_batch import LabelledBatch, Plan, label_batch, plan
from pgm_places.io.remote_files import MOST_AT_ONCE, RemoteFolder
from pgm_places.labelling.options import LabelOptions, Outputs
from pgm_places.progress import Silent
from tests.batch.shared import Here

REQUEST_S, NAMES_AT_ONCE = 0.1, 1000
OUT = Path("memory://out")
_OTHERS = ("exists", "isdir", "modified", "put_file", "cat_file", "rm_file")


class Clock:
    """How long the requests of the store in memory take, and how many there were."""

    def __init__(self) -> None:
        self.now_s, self.requests = 0.0, Counter[str]()

    @contextmanager
    def running(self) -> Iterator[None]:
        """Count the requests of the block."""
        ours = {"find": _find, "get_file": _get_file}
        requests = ours | {name: getattr(MemoryFileSystem, name) for name in _OTHERS}
        timed = {name: self._timed(name, request) for name, request in requests.items()}
        at_once = patch.object(RemoteFolder, "at_once", self._at_once)
        with patch.multiple(MemoryFileSystem, **timed), at_once:
            yield

    def _timed(self, name: str, request: Callable[..., Any]) -> Callable[..., Any]:
        def timed(*given: Any, **named: Any) -> Any:
            before, counted, n = self.now_s, self.requests.copy(), 1
            try:
                found = request(*given, **named)
                if name == "find":
                    n += max(len(found) - 1, 0) // NAMES_AT_ONCE
            finally:  # a refused request takes its time, too; the memory's own requests take none
                self.now_s, self.requests = before + n * REQUEST_S, counted
                self.requests[name] += n
            return found

        return timed

    def _at_once(self, function: Callable[[Any], Any], items: Iterable[Any]) -> list[Any]:
        """Waves of requests, each as long as the longest one."""
        start, longest, found = self.now_s, 0.0, []
        for item in items:
            self.now_s = start
            found.append(function(item))
            longest = max(longest, self.now_s - start)
        self.now_s = start + -(-len(found) // MOST_AT_ONCE) * longest
        return found


def _find(system: Any, path: str, **_: Any) -> dict[str, Any]:
    """All files below a folder; the library looks through the store once for each folder."""
    inside = f"{system._strip_protocol(path)}/"
    return {
        name: {"name": name, "created": file.created}
        for name, file in system.store.items()
        if name.startswith(inside)
    }


def _get_file(system: Any, path: str, local: str, **_: Any) -> None:
    """Copy a file, without a look through all of the store before."""
    file = system.store.get(system._strip_protocol(path))
    if file is None:
        raise FileNotFoundError(path)
    Path(local).write_bytes(file.getvalue())


def fill(system: Any, n_maps: int, model: Path) -> None:
    """Label a map from `memory://maps` to `memory://out`, and copy it and its result."""
    with tempfile.TemporaryDirectory() as folder:
        write_maps(Path(folder), 1)
        system.put(folder, "/maps", recursive=True)
    labelled(model)
    first = "site0000/floor00"
    files = {name: file for name, file in system.store.items() if first in name}
    for number in range(1, n_maps):
        name = f"site{number // TOGETHER:04d}/floor{number % TOGETHER:02d}"
        system.store.update({path.replace(first, name): file for path, file in files.items()})
    with Clock().running():
        labelled(model)  # lists them


def labelled(model: Path) -> LabelledBatch:
    """All maps labelled."""
    return label_batch(_found(), OUT, _options(model), Here(), progress=Silent())


def planned(model: Path) -> Plan:
    """What labelling all maps would do."""
    return plan(_found(), OUT, _options(model))


def _options(model: Path) -> LabelOptions:
    return LabelOptions(model=str(model), outputs=Outputs.named("none"))


def _found() -> FoundMaps:
    return find_maps(["memory://maps"], OUT, root=recorded_root(OUT))


def main() -> None:
    """Print a row for each command and number of maps."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--maps", type=int, nargs="+", default=[120, 10_000])
    print("| maps | command | said | requests | simulated s |\n|---|---|---|---|---|")
    for n_maps in parser.parse_args().maps:
        system = MemoryFileSystem()
        with tempfile.TemporaryDirectory() as folder:
            model = write_model(Path(folder) / "model")
            fill(system, n_maps, model)
            for name, run in (("label --dry-run", planned), ("label", labelled)):
                clock = Clock()
                with clock.running():
                    said = run(model).summary()
                n = clock.requests.total()
                print(f"| {n_maps:,} | {name} | {said} | {n:,} | {clock.now_s:.1f} |", flush=True)
        system.rm("/", recursive=True)


if __name__ == "__main__":
    main()
