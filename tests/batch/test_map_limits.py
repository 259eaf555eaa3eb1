"""Maps that take too much time or memory are given up; the others are labelled."""

import contextlib
import os
from pathlib import Path
from typing import Any

import pytest

from pgm_places.batch import map_task
from pgm_places.batch.limits import LEAST_MEMORY
from pgm_places.batch.local_workers import LocalWorkers
from tests.batch.shared import Batch, Hanging, failures


def test_a_map_that_takes_too_long_is_given_up(
    batch: Batch, maps: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def slow(*_: Any, **__: Any) -> None:
        while True:
            with contextlib.suppress(Exception):  # what catches every error must not stop it
                sum(range(1000))

    with monkeypatch.context() as changed:
        changed.setattr(map_task, "write_labelled", slow)
        batch(how={"limit_s": 0.2})
    failed = failures(maps.parent / "out")["floor1/map"]
    assert (failed["error"], failed["message"]) == (
        "TimeLimit",
        "time limit of 0.2 s exceeded; raise --time-limit",
    )
    assert not list((maps.parent / "out").rglob(".*.tmp"))
    assert batch(how={"limit_s": 600.0}).n_labelled == 2


@pytest.mark.skipif(not hasattr(os, "getuid"), reason="needs limits as on Unix")
def test_small_maps_are_labelled_with_the_least_memory(batch: Batch) -> None:
    assert batch(LocalWorkers(1, 1, LEAST_MEMORY)).n_labelled == 2


def test_a_model_that_does_not_fit_is_a_failure_of_the_map(
    batch: Batch, maps: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def too_large(*_: Any) -> None:
        raise MemoryError

    monkeypatch.setattr(map_task, "_ready", too_large)
    assert batch().n_failed == 3
    failed = failures(maps.parent / "out")["floor1/map"]
    assert failed["message"] == "out of memory; raise --memory, or use fewer jobs"


def test_the_process_of_a_map_that_hangs_is_killed_and_the_others_are_labelled(
    batch: Batch, maps: Path
) -> None:
    found = batch(Hanging(1, grace_s=1.0), how={"limit_s": 9.0})
    assert (found.n_labelled, found.n_failed) == (1, 2)
    failed = failures(maps.parent / "out")["floor1/map"]
    assert (failed["error"], failed["message"]) == (
        "TimeLimit",
        "time limit of 9 s exceeded; raise --time-limit",
    )
    assert batch().n_labelled == 1  # nobody holds the claim any more
    assert not failures(maps.parent / "out").keys() & {"floor1/map"}
