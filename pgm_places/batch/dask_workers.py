"""Workers of a Dask cluster that runs already."""

import logging
import queue
import time
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import CancelledError
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from functools import partial
from typing import Any, TypeVar

from pgm_places._extras import needed
from pgm_places.batch.local_workers import done_beside
from pgm_places.errors import InputError, OutputError

Task = TypeVar("Task")

_AHEAD = 4
"""Tasks under way per thread of the cluster: enough to keep it busy, few enough to forget."""

_ASK_AGAIN_S = 1.0
"""How old the number of threads may be: workers come and go while tasks run for minutes."""


@dataclass(frozen=True)
class DaskWorkers:
    """A Dask cluster, by the address of its scheduler.

    Its workers have this package installed, in this version, and see the maps, the model and the
    folder of the results under the same paths.

    Parameters
    ----------
    address : str
        Such as ``tcp://192.168.0.7:8786``.
    memory_bytes : int, optional
        What each task may take; it is done in a process beside the worker, which has this limit.
    patience_s : float
        How long to wait for the scheduler and for a first worker.
    """

    address: str
    memory_bytes: int | None = None
    patience_s: float = 20.0

    def run(
        self,
        function: Callable[[Task], Any],
        tasks: Iterable[Task],
        *,
        limit_s: float | None = None,
    ) -> Iterator[tuple[Any, Any]]:
        """The tasks with their results: see :class:`pgm_places.batch.local_workers.Workers`."""
        memory = self.memory_bytes
        if limit_s is not None or memory is not None:
            function = partial(done_beside, function, limit_s=limit_s, memory_bytes=memory)
        with self._client() as (distributed, client):
            under_way = _UnderWay(client, function, iter(tasks))
            for task, future in under_way.ended():
                yield task, _result(distributed, future, self.address)

    @contextmanager
    def _client(self) -> Iterator[tuple[Any, Any]]:
        distributed = needed("distributed", extra="dask", purpose="--scheduler")
        # What ends a batch is said in one line, to which Dask would add tracebacks. It goes on
        # logging while its threads end, after the client is closed, so this stays.
        for name in ("distributed", "distributed.client", "tornado"):  # those it gives levels
            logging.getLogger(name).setLevel(logging.CRITICAL)
        try:
            client = distributed.Client(self.address, timeout=self.patience_s, set_as_default=False)
        except (OSError, ValueError, TypeError) as error:
            raise InputError(
                f"no Dask scheduler answers at {self.address!r} ({error}); expected an address "
                "such as tcp://192.168.0.7:8786"
            ) from None
        with client:
            try:
                client.wait_for_workers(1, timeout=self.patience_s)
            except TimeoutError:
                raise InputError(
                    f"the Dask scheduler at {self.address} has no workers; start some: dask worker "
                    f"{self.address}"
                ) from None
            yield distributed, client


class _UnderWay:
    """The tasks that the cluster has: some for each of its threads, however many it has by now."""

    def __init__(self, client: Any, function: Callable[[Any], Any], tasks: Iterator[Any]) -> None:
        self._client, self._function, self._tasks = client, function, tasks
        self._futures: dict[str, tuple[Any, Any]] = {}
        self._ended: queue.SimpleQueue[str] = queue.SimpleQueue()
        self._n_threads, self._asked_s = 1, -_ASK_AGAIN_S

    def ended(self) -> Iterator[tuple[Any, Any]]:
        """Each task with its future, once that has ended; new ones take the places."""
        while True:
            self._fill()
            if not self._futures:
                return
            with suppress(queue.Empty):
                task, future = self._futures.pop(self._ended.get(timeout=_ASK_AGAIN_S))
                yield task, future
                future.release()

    def _fill(self) -> None:
        room = _AHEAD * self._threads() - len(self._futures)
        for _, task in zip(range(room), self._tasks, strict=False):
            future = self._client.submit(self._function, task, pure=False)
            self._futures[future.key] = task, future
            future.add_done_callback(lambda ended: self._ended.put(ended.key))

    def _threads(self) -> int:
        if time.monotonic() - self._asked_s >= _ASK_AGAIN_S:
            with suppress(OSError, TimeoutError):  # what became of a lost scheduler, futures tell
                self._n_threads = max(sum(self._client.nthreads().values()), 1)
            self._asked_s = time.monotonic()
        return self._n_threads


def _result(distributed: Any, future: Any, address: str) -> Any:
    """What the task returned; None where Dask gave it up because its workers died."""
    try:
        return future.result()
    except distributed.scheduler.KilledWorker:
        return None
    except CancelledError:
        raise OutputError(
            f"the Dask scheduler at {address} is gone; what is done is kept, so start it and run "
            "the same command again"
        ) from None
