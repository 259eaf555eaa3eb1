"""Workers of a Dask cluster that runs already."""

import logging
import queue
import time
from collections import Counter
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import CancelledError, ThreadPoolExecutor
from contextlib import closing, contextmanager, suppress
from dataclasses import dataclass, field, replace
from functools import partial
from typing import Any, TypeVar

from pgm_places._extras import needed
from pgm_places.batch.local_workers import Fault, Judge, run_in_subprocess
from pgm_places.errors import InputError, OutputError

Task = TypeVar("Task")

_AHEAD = 4
"""Tasks under way per thread of the cluster: enough to keep it busy, few enough to forget."""

_JUDGED_AT_ONCE = 16
"""Threads that judge results: each judgement looks for files."""

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
        judge: Judge | None = None,
    ) -> Iterator[tuple[Any, Any]]:
        """The tasks with their results: see :class:`pgm_places.batch.local_workers.Workers`."""
        memory = self.memory_bytes
        if limit_s is not None or memory is not None:
            function = partial(run_in_subprocess, function, limit_s=limit_s, memory_bytes=memory)
        with (
            self._client() as (distributed, client),
            closing(_UnderWay(client, function, iter(tasks), judge)) as under_way,
        ):
            for task, ended in under_way.ended():
                yield task, _result(distributed, ended, self.address)

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


_MOST_FAULTS = 3
"""Consecutive failures, on tasks that others have done, after which a worker is left out."""

_MOST_TRIES = 3
"""Workers that a task is tried on before the task itself is at fault."""


@dataclass
class _Sent:
    """A task that the cluster has, or had on some workers before.

    Parameters
    ----------
    task : object
    future : distributed.Future
    tried : dict of str to object
        Workers whose fault the result was, with the result.
    only : frozenset of str
        The workers that may do it; all, if it is empty.
    """

    task: Any
    future: Any = None
    tried: dict[str, Any] = field(default_factory=dict)
    only: frozenset[str] = frozenset()


@dataclass(frozen=True)
class _Ended:
    """What a worker returned or raised, and whether that is its fault."""

    worker: str
    result: Any
    error: BaseException | None
    fault: Fault | None = None


class _UnderWay:
    """The tasks that the cluster has: some for each of its threads, however many it has by now.

    A task whose result is the fault of a worker goes to another one. A worker that fails several
    times in a row on what others can do gets no more tasks.
    """

    def __init__(
        self,
        client: Any,
        function: Callable[[Any], Any],
        tasks: Iterator[Any],
        judge: Judge | None,
    ) -> None:
        self._client, self._tasks, self._judge = client, tasks, judge
        self._function = partial(_on_worker, function)
        self._sent: dict[str, _Sent] = {}
        self._ended: queue.SimpleQueue[tuple[str, _Ended]] = queue.SimpleQueue()
        self._judging = ThreadPoolExecutor(_JUDGED_AT_ONCE)
        self._threads: dict[str, int] = {}
        self._asked_s = -_ASK_AGAIN_S
        self._faults: Counter[str] = Counter()
        self._left_out: set[str] = set()

    def close(self) -> None:
        """Judge no more results."""
        self._judging.shutdown(wait=False, cancel_futures=True)

    def ended(self) -> Iterator[tuple[Any, _Ended]]:
        """Each task with what became of it; new ones take the places."""
        while True:
            self._look()
            self._fill()
            if not self._sent:
                return
            with suppress(queue.Empty):
                key, ended = self._ended.get(timeout=_ASK_AGAIN_S)
                sent = self._sent.pop(key, None)
                if sent is not None and not self._tried_elsewhere(sent, ended):
                    yield sent.task, ended
                    sent.future.release()

    def _fill(self) -> None:
        n_threads = sum(n for worker, n in self._threads.items() if worker not in self._left_out)
        room = _AHEAD * max(n_threads, 1) - len(self._sent)
        for _, task in zip(range(room), self._tasks, strict=False):
            self._send(_Sent(task))

    def _send(self, sent: _Sent) -> None:
        """Give a task to the workers that are neither left out nor have tried it."""
        able = self._threads.keys() - self._left_out - sent.tried.keys()
        sent.only = frozenset(able) if self._left_out or sent.tried else frozenset()
        sent.future = self._client.submit(
            self._function, sent.task, pure=False, workers=sorted(sent.only) or None
        )
        self._sent[sent.future.key] = sent
        sent.future.add_done_callback(partial(self._judge_later, sent.task))

    def _judge_later(self, task: object, future: object) -> None:
        with suppress(RuntimeError):  # closed: no caller waits for the result
            self._judging.submit(self._judged, task, future)

    def _judged(self, task: Any, future: Any) -> None:
        try:
            ended = _Ended(*future.result())
            if self._judge is not None:
                what = ended.result if ended.error is None else ended.error
                ended = replace(ended, fault=self._judge.fault(task, what, ended.worker))
        except BaseException as error:  # noqa: BLE001  it is raised where the results are read
            ended = _Ended("", None, error)
        self._ended.put((future.key, ended))

    def _tried_elsewhere(self, sent: _Sent, ended: _Ended) -> bool:
        """Whether a task goes to another worker, because this one was at fault."""
        if ended.fault is None:
            if ended.worker:
                self._faults[ended.worker] = 0
                for worker, result in sent.tried.items():
                    self._faults[worker] += 1
                    if self._faults[worker] >= _MOST_FAULTS:
                        self._leave_out(worker, result)
            return False
        sent.tried[ended.worker] = ended.fault.result
        if ended.fault.is_certain:
            self._leave_out(ended.worker, ended.fault.result)
        is_tried_enough = len(sent.tried.keys() - self._left_out) >= _MOST_TRIES
        if is_tried_enough or not self._threads.keys() - self._left_out - sent.tried.keys():
            return False
        self._send(sent)
        return True

    def _leave_out(self, worker: str, result: object) -> None:
        """Give a worker no more tasks, unless it is the last one."""
        if self._threads.keys() - self._left_out - {worker} and worker not in self._left_out:
            self._left_out.add(worker)
            if self._judge is not None:
                self._judge.left_out(worker, result)

    def _look(self) -> None:
        """Ask which workers there are; tasks whose workers are gone are given to others."""
        if time.monotonic() - self._asked_s < _ASK_AGAIN_S:
            return
        with suppress(OSError, TimeoutError):  # what became of a lost scheduler, futures tell
            self._threads = dict(self._client.nthreads())
            if not self._threads.keys() - self._left_out:
                self._left_out.clear()
            for key, sent in list(self._sent.items()):
                if sent.only and not sent.only & self._threads.keys():
                    del self._sent[key]
                    sent.future.cancel()
                    self._send(sent)
        self._asked_s = time.monotonic()


def _on_worker(
    function: Callable[[Any], Any], task: object
) -> tuple[str, Any, BaseException | None]:
    """The address of the worker, and what the function returned or raised."""
    from distributed import get_worker

    worker = str(get_worker().address)
    try:
        return worker, function(task), None
    except Exception as error:  # noqa: BLE001  it is judged where the results are read
        return worker, None, error


def _result(distributed: Any, ended: _Ended, address: str) -> Any:
    """What the task returned; None where Dask gave it up because its workers died."""
    if ended.fault is not None and not isinstance(ended.fault.result, BaseException):
        return ended.fault.result
    error = ended.error if ended.fault is None else ended.fault.result
    if error is None:
        return ended.result
    if isinstance(error, distributed.scheduler.KilledWorker):
        return None
    if isinstance(error, CancelledError):
        raise OutputError(
            f"the Dask scheduler at {address} is gone; what is done is kept, so start it and run "
            "the same command again"
        ) from None
    raise error
