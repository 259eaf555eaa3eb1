"""Processes of this machine: results of every task, whatever dies; what is raised ends the rest."""

import os
import time
from pathlib import Path

import pytest

from pgm_places.batch.local_workers import TIMED_OUT, LocalWorkers, run_in_subprocess
from tests.batch.tasks import die_always, die_often, hang, refuse


def take_a_gigabyte(_: int) -> str:
    import numpy as np

    try:
        np.ones(1 << 30, np.uint8)
    except MemoryError:
        return "refused"
    return "taken"


def own_id(_: int) -> int:
    time.sleep(0.2)  # so that both processes get something to do
    return os.getpid()


def test_one_process_stays_for_many_tasks() -> None:
    ids = {result for _, result in LocalWorkers(2).run(own_id, range(6))}
    assert len(ids) <= 2
    assert os.getpid() not in ids


def test_a_task_that_kills_every_process_is_given_up_and_no_other() -> None:
    found = dict(LocalWorkers(2).run(die_always, range(4)))
    assert found == {0: 0, 1: None, 2: 2, 3: 3}


def test_a_task_may_kill_two_processes_and_is_given_up_with_the_third(tmp_path: Path) -> None:
    tasks = [tmp_path / "2", tmp_path / "9"]
    found = {task.name: result for task, result in LocalWorkers(2).run(die_often, tasks)}
    assert found == {"2": "2", "9": None}
    assert [task.stat().st_size for task in tasks] == [3, 3]


def test_what_the_function_raises_is_raised_here_and_ends_the_rest() -> None:
    begun = iter(range(1000))
    with pytest.raises(ValueError, match="no"):
        list(LocalWorkers(1).run(refuse, begun))
    assert next(begun) == 4


def test_a_task_that_hangs_outside_python_is_killed_at_its_limit() -> None:
    started = time.monotonic()
    found = dict(LocalWorkers(2, grace_s=0.5).run(hang, range(4), limit_s=1.0))
    assert found == {0: 0, 1: TIMED_OUT, 2: 2, 3: TIMED_OUT}
    assert time.monotonic() - started < 60


def impatient(_: int) -> None:
    raise TimeoutError("the server of maps does not answer")


def test_an_error_of_the_same_name_is_not_taken_for_the_limit() -> None:
    with pytest.raises(TimeoutError, match="server of maps"):
        list(LocalWorkers(1).run(impatient, [0], limit_s=60.0))


@pytest.mark.skipif(not hasattr(os, "getuid"), reason="needs limits as on Unix")
def test_memory_is_limited() -> None:
    limited = LocalWorkers(1, memory_bytes=600_000_000)
    assert [result for _, result in limited.run(take_a_gigabyte, [0])] == ["refused"]
    assert [result for _, result in LocalWorkers(1).run(take_a_gigabyte, [0])] == ["taken"]


def data_limit(_: int) -> int:
    import resource

    return resource.getrlimit(resource.RLIMIT_DATA)[0]


@pytest.mark.skipif(not hasattr(os, "getuid"), reason="needs limits as on Unix")
def test_a_limit_of_memory_does_not_stick_to_a_worker_of_others() -> None:
    none = data_limit(0)
    for limit in (3_000_000_000, None, 1_000_000_000):
        found = run_in_subprocess(data_limit, 0, limit_s=60.0, memory_bytes=limit)
        assert found == (none if limit is None else limit)


def test_processes_end_when_the_results_are_not_wanted_any_more() -> None:
    run = LocalWorkers(2).run(own_id, iter(range(1000)))
    process = next(run)[1]
    run.close()
    for _ in range(100):
        try:
            os.kill(process, 0)
        except ProcessLookupError:
            return
        time.sleep(0.1)
    pytest.fail("the process is still there")
