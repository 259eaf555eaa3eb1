"""A clock for requests to a store in memory: how long they would take far away, and how many."""

from collections import Counter
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any
from unittest.mock import patch

from fsspec.implementations.memory import MemoryFileSystem

from pgm_places.io.remote_files import MOST_AT_ONCE, RemoteFolder

REQUEST_S, NAMES_AT_ONCE = 0.1, 1000
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
        timed: dict[str, Any] = {name: self._timed(name, each) for name, each in requests.items()}
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
