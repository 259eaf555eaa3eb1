"""A Dask cluster over TCP does what processes of this machine do."""

import os
import time
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path
from unittest.mock import patch

import pytest

from pgm_places.batch.dask_workers import DaskWorkers, _Submissions
from pgm_places.batch.local_workers import TIMED_OUT, Fault
from pgm_places.errors import InputError
from tests.batch.tasks import die_always, die_once, double, hang, refuse, rest

distributed = pytest.importorskip("distributed")

pytestmark = [
    pytest.mark.slow,
    # What the cluster's own threads say when a worker is killed is not ours to judge.
    pytest.mark.filterwarnings("ignore"),
]


@pytest.fixture
def address() -> Iterator[str]:
    # One for each test: a worker that was killed in one may never come back for the next.
    with patch.dict(os.environ):  # it sets numbers of threads for its workers, and here
        cluster = distributed.LocalCluster(
            n_workers=2, threads_per_worker=1, dashboard_address=None, silence_logs=50
        )
        yield cluster.scheduler_address
        # Closing may wait for ever for a worker that is being restarted, or join it too early.
        with suppress(TimeoutError, AssertionError):
            cluster.close(timeout=30)


def patient(address: str, memory_bytes: int | None = None) -> DaskWorkers:
    """Workers that may start anew first, which takes long where the machine is busy."""
    return DaskWorkers(address, memory_bytes, patience_s=120.0)


def memory_limit(_: int) -> int:
    import resource

    return resource.getrlimit(resource.RLIMIT_DATA)[0]


def test_every_task_comes_back_with_its_result(address: str) -> None:
    found = dict(patient(address).run(double, iter(range(30))))
    assert found == {number: 2 * number for number in range(30)}


def test_workers_that_come_later_get_tasks_at_once() -> None:
    with (
        patch.dict(os.environ),
        distributed.LocalCluster(
            n_workers=1,
            threads_per_worker=1,
            processes=False,
            dashboard_address=None,
            silence_logs=50,
        ) as cluster,
    ):
        started = time.monotonic()
        run = patient(cluster.scheduler_address).run(rest, [1.0] * 40)
        assert next(run)[1] == 1.0
        cluster.scale(10)
        assert len(list(run)) == 39
        # Alone, one worker takes 40 s; with four tasks at a time, as many as it had at first, 10 s.
        assert time.monotonic() - started < 9.0


def test_a_killed_worker_loses_no_task(address: str, tmp_path: Path) -> None:
    tasks = [tmp_path / str(number) for number in range(2)]
    found = dict(patient(address).run(die_once, tasks))
    assert found == {task: task.name for task in tasks}


def worker_and_own_process(number: int) -> tuple[int, int]:
    hang(number)
    return os.getppid(), os.getpid()


def test_a_task_that_hangs_is_killed_and_no_worker_with_it(address: str) -> None:
    workers = patient(address)
    before = set(distributed.Client(address, set_as_default=False).run(os.getpid).values())
    found = dict(workers.run(worker_and_own_process, range(3), limit_s=1.0))
    assert found[1] is TIMED_OUT
    parents = {found[number][0] for number in (0, 2)}
    assert parents <= before  # labelled beside a worker, which is as it was
    assert set(distributed.Client(address, set_as_default=False).run(os.getpid).values()) == before


def test_a_task_that_kills_every_worker_is_given_up(address: str) -> None:
    assert dict(patient(address).run(die_always, [1])) == {1: None}


def test_what_the_function_raises_is_raised_here(address: str) -> None:
    with pytest.raises(ValueError, match="no"):
        list(patient(address).run(refuse, range(6)))


def test_a_limit_of_memory_is_that_of_its_run_alone(address: str) -> None:
    resource = pytest.importorskip("resource")
    none = resource.getrlimit(resource.RLIMIT_DATA)[0]
    before = set(distributed.Client(address, set_as_default=False).run(os.getpid).values())
    for limit in (3_000_000_000, None, 1_000_000_000, None):
        for seconds in (None, 60.0):
            run = patient(address, limit).run(memory_limit, range(8), limit_s=seconds)
            assert {result for _, result in run} == {none if limit is None else limit}
    assert set(distributed.Client(address, set_as_default=False).run(os.getpid).values()) == before


class Strict:
    """A judge for whom what the tasks call bad is the fault of the worker."""

    def __init__(self) -> None:
        self.out: list[str] = []

    def fault(self, task: int, result: object, worker: str) -> Fault | None:
        if isinstance(result, ValueError):
            return Fault(result, is_certain=True)
        return Fault(f"bad at {task}") if result == "bad" else None

    def left_out(self, worker: str, result: object) -> None:
        self.out.append(worker)


def bad_on_first(number: int) -> str:
    """Bad at once on one worker, good after a while on the others; bad anywhere for some."""
    name = distributed.get_worker().name
    if name == 0 or number % 50 == 7:
        return "bad"
    time.sleep(0.02)
    return f"{name}"


def refused_on_first(_: int) -> int:
    name = int(distributed.get_worker().name)
    if name == 0:
        raise ValueError("another version")
    return name


def bad_everywhere(_: int) -> str:
    return "bad"


def refused_everywhere(_: int) -> int:
    raise ValueError("another version")


def test_one_bad_worker_costs_no_task_and_is_left_out(address: str) -> None:
    judge = Strict()
    found = dict(patient(address).run(bad_on_first, range(60), judge=judge))
    good = {number: "1" for number in range(60) if number % 50 != 7}
    assert found == good | {7: "bad at 7", 57: "bad at 57"}
    [first] = judge.out
    workers = distributed.Client(address, set_as_default=False).scheduler_info()["workers"]
    assert workers[first]["name"] == 0


def test_a_worker_that_is_certainly_wrong_is_left_out_at_once(address: str) -> None:
    judge = Strict()
    found = dict(patient(address).run(refused_on_first, range(20), judge=judge))
    assert found == dict.fromkeys(range(20), 1)
    assert len(judge.out) == 1


def test_tasks_that_are_bad_everywhere_leave_no_worker_out(address: str) -> None:
    judge = Strict()
    found = dict(patient(address).run(bad_everywhere, range(20), judge=judge))
    assert found == {number: f"bad at {number}" for number in range(20)}
    assert judge.out == []
    with pytest.raises(ValueError, match="another version"):
        list(patient(address).run(refused_everywhere, range(20), judge=judge))


def test_results_that_come_after_the_end_are_let_go() -> None:
    """A lost scheduler cancels its tasks while the batch ends with one line."""
    submissions = _Submissions(None, double, iter(()), None)
    submissions.close()
    submissions._judge_later(1, None)


def test_no_scheduler_is_one_line() -> None:
    with pytest.raises(InputError, match=r"no Dask scheduler answers at 'tcp://127.0.0.1:9'"):
        list(DaskWorkers("tcp://127.0.0.1:9", patience_s=1.0).run(double, [1]))
