"""Workers of a running Dask cluster."""

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

from pgm_places.batch.local_workers import Fault, Judge, run_in_subprocess
from pgm_places.errors import InputError, OutputError
from pgm_places.plugins import needed

Task = TypeVar("Task")

_AHEAD = 4
"""Submitted tasks per thread of the cluster: enough to keep it busy, few enough to lose."""

_JUDGED_AT_ONCE = 16
"""Threads that check results; each check looks for files."""

_QUERY_INTERVAL_S = 1.0
"""Seconds between queries of the cluster's workers, which join and leave during a batch."""


@dataclass(frozen=True)
class DaskWorkers:
    """A Dask cluster by the address of its scheduler, such as ``tcp://192.168.0.7:8786``.

    Workers need this version of the package and the same paths. With ``memory_bytes``, each task
    runs in a subprocess. The scheduler and a first worker must answer within ``patience_s``.
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
        """Run tasks: see :class:`pgm_places.batch.local_workers.Workers`."""
        memory = self.memory_bytes
        if limit_s is not None or memory is not None:
            function = partial(run_in_subprocess, function, limit_s=limit_s, memory_bytes=memory)
        with (
            self._client() as (distributed, client),
            closing(_Submissions(client, function, iter(tasks), judge)) as submissions,
        ):
            for task, ended in submissions.ended():
                yield task, _result(distributed, ended, self.address)

    @contextmanager
    def _client(self) -> Iterator[tuple[Any, Any]]:
        distributed = needed("distributed", extra="dask", purpose="--scheduler")
        # Errors are reported in one line, to which Dask would add tracebacks. Its threads log after
        # the client is closed, too, so the levels are not restored.
        for name in ("distributed", "distributed.client", "tornado"):  # loggers with own levels
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
"""Consecutive failures on tasks that other workers completed, before a worker is excluded."""

_MOST_TRIES = 3
"""Workers to try a task on before the task itself counts as failed."""


@dataclass
class _SubmittedTask:
    """A task on the cluster: ``tried`` maps faulty workers to results, ``only`` limits workers."""

    task: Any
    future: Any = None
    tried: dict[str, Any] = field(default_factory=dict)
    only: frozenset[str] = frozenset()


@dataclass(frozen=True)
class _Ended:
    """The result or error of a worker, and the worker's fault if there is one."""

    worker: str
    result: Any
    error: BaseException | None
    fault: Fault | None = None


class _Submissions:
    """Tasks on the cluster, a few per thread; tasks of faulty workers are submitted to others."""

    def __init__(
        self,
        client: Any,
        function: Callable[[Any], Any],
        tasks: Iterator[Any],
        judge: Judge | None,
    ) -> None:
        self._client, self._tasks, self._judge = client, tasks, judge
        self._function = partial(_on_worker, function)
        self._sent: dict[str, _SubmittedTask] = {}
        self._ended: queue.SimpleQueue[tuple[str, _Ended]] = queue.SimpleQueue()
        self._judging = ThreadPoolExecutor(_JUDGED_AT_ONCE)
        self._threads: dict[str, int] = {}
        self._asked_s = -_QUERY_INTERVAL_S
        self._faults: Counter[str] = Counter()
        self._excluded: set[str] = set()

    def close(self) -> None:
        """Stop checking results."""
        self._judging.shutdown(wait=False, cancel_futures=True)

    def ended(self) -> Iterator[tuple[Any, _Ended]]:
        """Each task with its outcome, in order of completion; submits further tasks."""
        while True:
            self._query_workers()
            self._fill()
            if not self._sent:
                return
            with suppress(queue.Empty):
                key, ended = self._ended.get(timeout=_QUERY_INTERVAL_S)
                sent = self._sent.pop(key, None)
                if sent is not None and not self._tried_elsewhere(sent, ended):
                    yield sent.task, ended
                    sent.future.release()

    def _fill(self) -> None:
        n_threads = sum(n for worker, n in self._threads.items() if worker not in self._excluded)
        room = _AHEAD * max(n_threads, 1) - len(self._sent)
        for _, task in zip(range(room), self._tasks, strict=False):
            self._send(_SubmittedTask(task))

    def _send(self, sent: _SubmittedTask) -> None:
        """Submit a task to workers that are not excluded and have not tried it."""
        able = self._threads.keys() - self._excluded - sent.tried.keys()
        sent.only = frozenset(able) if self._excluded or sent.tried else frozenset()
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
        except BaseException as error:  # noqa: BLE001  raised again by _result
            ended = _Ended("", None, error)
        self._ended.put((future.key, ended))

    def _tried_elsewhere(self, sent: _SubmittedTask, ended: _Ended) -> bool:
        """Submit a task of a faulty worker to another one; whether that was done."""
        if ended.fault is None:
            if ended.worker:
                self._faults[ended.worker] = 0
                for worker, result in sent.tried.items():
                    self._faults[worker] += 1
                    if self._faults[worker] >= _MOST_FAULTS:
                        self._exclude(worker, result)
            return False
        sent.tried[ended.worker] = ended.fault.result
        if ended.fault.is_certain:
            self._exclude(ended.worker, ended.fault.result)
        is_tried_enough = len(sent.tried.keys() - self._excluded) >= _MOST_TRIES
        if is_tried_enough or not self._threads.keys() - self._excluded - sent.tried.keys():
            return False
        self._send(sent)
        return True

    def _exclude(self, worker: str, result: object) -> None:
        """Exclude a worker from further tasks, unless it is the last one."""
        if self._threads.keys() - self._excluded - {worker} and worker not in self._excluded:
            self._excluded.add(worker)
            if self._judge is not None:
                self._judge.left_out(worker, result)

    def _query_workers(self) -> None:
        """Query the cluster's workers; tasks of lost workers are submitted to others."""
        if time.monotonic() - self._asked_s < _QUERY_INTERVAL_S:
            return
        with suppress(OSError, TimeoutError):  # a lost scheduler is reported by the futures
            self._threads = dict(self._client.nthreads())
            if not self._threads.keys() - self._excluded:
                self._excluded.clear()
            for key, sent in list(self._sent.items()):
                if sent.only and not sent.only & self._threads.keys():
                    del self._sent[key]
                    sent.future.cancel()
                    self._send(sent)
        self._asked_s = time.monotonic()


def _on_worker(
    function: Callable[[Any], Any], task: object
) -> tuple[str, Any, BaseException | None]:
    """The address of the worker, and the function's result and error."""
    from distributed import get_worker

    worker = str(get_worker().address)
    try:
        return worker, function(task), None
    except Exception as error:  # noqa: BLE001  judged by the client
        return worker, None, error


def _result(distributed: Any, ended: _Ended, address: str) -> Any:
    """The result of a task; None if Dask gave it up because its workers died."""
    if ended.fault is not None and not isinstance(ended.fault.result, BaseException):
        return ended.fault.result
    error = ended.error if ended.fault is None else ended.fault.result
    if error is None:
        return ended.result
    if isinstance(error, distributed.scheduler.KilledWorker):
        return None
    if isinstance(error, CancelledError):
        raise OutputError(
            f"lost the Dask scheduler at {address}; restart it and repeat the command: finished "
            "maps will be skipped"
        ) from None
    raise error
