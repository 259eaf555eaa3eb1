"""Workers of a Dask cluster that runs already."""

from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import CancelledError
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from itertools import islice
from typing import Any, TypeVar

from pgm_places._extras import needed
from pgm_places.batch.workers import Done
from pgm_places.errors import InputError, OutputError

__all__ = ["DaskWorkers"]

Task = TypeVar("Task")

_AHEAD = 4
"""Tasks under way per thread of the cluster: enough to keep it busy, few enough to forget."""


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
        What each worker may take; while the batch lasts, Dask pauses and restarts workers by it.
    patience_s : float
        How long to wait for the scheduler and for a first worker.
    """

    address: str
    memory_bytes: int | None = None
    patience_s: float = 20.0

    def run(self, function: Callable[[Task], Any], tasks: Iterable[Task]) -> Iterator[Done]:
        """The tasks with their results: see :class:`pgm_places.batch.workers.Workers`."""
        with self._client() as (distributed, client):
            waiting = iter(tasks)
            under_way: dict[str, Any] = {}

            def submit(n: int) -> list[Any]:
                made = []
                for task in islice(waiting, n):
                    future = client.submit(function, task, pure=False)
                    under_way[future.key] = task
                    made.append(future)
                return made

            first = submit(_AHEAD * _n_threads(client))
            ends = distributed.as_completed(first, loop=client.loop)
            for future in ends:
                yield Done(under_way.pop(future.key), _result(distributed, future, self.address))
                future.release()
                for new in submit(1):
                    ends.add(new)

    @contextmanager
    def _client(self) -> Iterator[tuple[Any, Any]]:
        distributed = needed("distributed", extra="dask", purpose="--scheduler")
        try:
            client = distributed.Client(self.address, timeout=self.patience_s, set_as_default=False)
        except (OSError, ValueError, TypeError) as error:
            raise InputError(
                f"no Dask scheduler answers at {self.address!r} ({error}); expected an address "
                "such as tcp://192.168.0.7:8786"
            ) from None
        with client:
            _wait_for_workers(client, self.address, self.patience_s)
            plugins = _memory_plugins(distributed, self.memory_bytes)
            for plugin in plugins:
                client.register_plugin(plugin)
            try:
                yield distributed, client
            finally:
                for plugin in plugins:
                    _unregister(client, plugin)


def _wait_for_workers(client: Any, address: str, seconds: float) -> None:
    try:
        client.wait_for_workers(1, timeout=seconds)
    except TimeoutError:
        raise InputError(
            f"the Dask scheduler at {address} has no workers; start some: dask worker {address}"
        ) from None


def _n_threads(client: Any) -> int:
    return max(sum(client.nthreads().values()), 1)


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


def _memory_plugins(distributed: Any, n_bytes: int | None) -> list[Any]:
    """What tells workers and their nannies of the limit; each puts its own back afterwards."""
    if n_bytes is None:
        return []

    class _OfWorker(distributed.WorkerPlugin):  # type: ignore[misc]  # it is imported when needed
        name, nanny = "pgm-places-memory", False

        def setup(self, worker: Any) -> None:
            self.before = worker.memory_manager.memory_limit
            worker.memory_manager.memory_limit = n_bytes

        def teardown(self, worker: Any) -> None:
            worker.memory_manager.memory_limit = self.before

    class _OfNanny(distributed.NannyPlugin):  # type: ignore[misc]
        name, nanny = "pgm-places-memory-of-nanny", True

        def setup(self, nanny: Any) -> None:
            self.before = nanny.memory_manager.memory_limit
            nanny.memory_manager.memory_limit = n_bytes

        def teardown(self, nanny: Any) -> None:
            nanny.memory_manager.memory_limit = self.before

    return [_OfWorker(), _OfNanny()]


def _unregister(client: Any, plugin: Any) -> None:
    # One that was starting a worker anew when the others were told does not know of the plugin.
    with suppress(KeyError):
        client.unregister_worker_plugin(plugin.name, nanny=plugin.nanny)
