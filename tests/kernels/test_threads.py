"""Tasks over threads: each done once, errors raised, bad counts refused."""

import os
import threading
import time
from collections.abc import Callable
from contextvars import ContextVar

import numpy as np
import pytest

from pgm_places.errors import InputError
from pgm_places.kernels.threads import ThreadTeam, _Worker, resolve_threads, run_tasks, thread_limit
from tests.refusals import refused


@pytest.mark.parametrize("n_threads", [1, 2, 5])
@pytest.mark.parametrize("n_tasks", [0, 1, 37])
def test_every_task_runs_once(n_tasks: int, n_threads: int) -> None:
    counts = np.zeros(n_tasks, np.int64)
    lock = threading.Lock()

    def work(task: int) -> None:
        with lock:
            counts[task] += 1

    run_tasks(work, n_tasks, n_threads=n_threads)
    assert (counts == 1).all()


@pytest.mark.parametrize("n_threads", [1, 3])
def test_tasks_run_in_the_context_of_the_caller(n_threads: int) -> None:
    """What is reported in a task reaches the caller's reporter, and threads do not multiply."""
    told: ContextVar[str] = ContextVar("told", default="nobody")
    told.set("the caller")
    together = threading.Barrier(n_threads, timeout=60)
    found = []

    def work(task: int) -> None:
        together.wait()
        found.append((told.get(), resolve_threads()))

    run_tasks(work, n_threads, n_threads=n_threads)
    with thread_limit(7):
        run_tasks(work, n_threads, n_threads=n_threads)
    inside = [resolve_threads(), 7] if n_threads == 1 else [1, 1]
    assert found == [("the caller", n) for n in inside for _ in range(n_threads)]


@pytest.mark.parametrize("n_threads", [1, 3])
def test_the_first_error_is_raised_and_stops_the_rest(n_threads: int) -> None:
    seen: list[int] = []

    def work(task: int) -> None:
        seen.append(task)
        if task == 2:
            raise RuntimeError("task 2")

    refused(RuntimeError, "task 2", run_tasks, work, 10_000, n_threads=n_threads)
    assert len(seen) < 10_000


def test_an_error_in_a_helper_stops_the_caller() -> None:
    caller, failed, seen = threading.current_thread(), threading.Event(), 0

    def work(_: int) -> None:
        nonlocal seen
        if threading.current_thread() is not caller:
            failed.set()
            raise RuntimeError("in a helper")
        failed.wait(60)
        time.sleep(0.001)
        seen += 1

    with pytest.raises(RuntimeError, match="in a helper"), ThreadTeam(2) as crew:
        crew.run(work, 5000)
    assert seen < 4999


def test_a_crew_stays_for_many_rounds() -> None:
    workers: set[int] = set()
    done = np.zeros(6, np.int64)
    meeting = threading.Barrier(3, timeout=60)

    def work(task: int) -> None:
        workers.add(threading.get_ident())
        done[task] += 1
        meeting.wait()

    with ThreadTeam(3) as crew:
        for _ in range(5):
            crew.run(work, 6)
    assert (done == 5).all()
    assert len(workers) == 3
    assert threading.get_ident() in workers


def test_an_error_in_a_helper_is_raised_and_the_crew_goes_on() -> None:
    caller, before = threading.get_ident(), set(threading.enumerate())
    both = threading.Barrier(2, timeout=60)

    def fail(_: int) -> None:
        both.wait()
        if threading.get_ident() != caller:
            raise RuntimeError("a helper")

    done: list[int] = []
    with ThreadTeam(2) as crew:
        for _ in range(3):
            refused(RuntimeError, "a helper", crew.run, fail, 2)
            crew.run(done.append, 3)
    assert sorted(done) == sorted([0, 1, 2] * 3)
    assert set(threading.enumerate()) <= before


def test_threads_come_from_the_environment(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("PGM_PLACES_NUM_THREADS", "3")
    assert resolve_threads() == 3
    assert resolve_threads(2) == 2
    monkeypatch.setenv("PGM_PLACES_NUM_THREADS", "many")
    refused(InputError, "whole number of threads, got 'many'", resolve_threads)
    refused(InputError, "from 1 to 1024, got 0", resolve_threads, 0)


def test_no_more_threads_than_the_process_may_use(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("PGM_PLACES_NUM_THREADS", raising=False)
    monkeypatch.setattr(os, "sched_getaffinity", lambda _: {0, 3, 5}, raising=False)
    monkeypatch.setattr(os, "cpu_count", lambda: 64)
    assert resolve_threads() == 3
    monkeypatch.delattr(os, "sched_getaffinity")
    assert resolve_threads() == 64


def test_an_interrupt_as_a_round_begins_leaves_no_thread(monkeypatch: pytest.MonkeyPatch) -> None:
    """The helper may not even have seen that a round has begun."""
    begin = _Worker.begin

    def interrupted(helper: _Worker, work: Callable[[], None]) -> None:
        begin(helper, work)
        raise KeyboardInterrupt

    monkeypatch.setattr(_Worker, "begin", interrupted)
    before = set(threading.enumerate())
    for _ in range(200):
        with pytest.raises(KeyboardInterrupt), ThreadTeam(2) as crew:
            crew.run(lambda _: None, 2)
    assert set(threading.enumerate()) <= before
