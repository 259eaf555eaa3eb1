"""Inference obeys the limit of threads, as scoring does."""

from pathlib import Path
from typing import Any

import pytest

from pgm_places.kernels.threads import resolve_threads
from pgm_places.labelers import method, place_labeler
from pgm_places.labelers.method import infer
from tests.cli.conftest import Run, building, run
from tests.cli.test_track_joint import joint
from tests.drives import building as of_drives
from tests.drives import drive
from tests.quick_labeler import places

__all__ = ["building", "run"]


@pytest.fixture
def limits(monkeypatch: pytest.MonkeyPatch) -> list[int]:
    """The limit of threads at each inference."""
    found: list[int] = []

    def spied(*arguments: Any) -> Any:
        found.append(resolve_threads())
        return infer(*arguments)

    monkeypatch.setattr(place_labeler, "infer", spied)
    monkeypatch.setattr(method, "infer", spied)  # as labelers of drives call it
    return found


def test_maps_and_drives_are_labelled_with_as_many_threads_as_are_allowed(
    limits: list[int],
) -> None:
    places().label(of_drives()[0].grid, n_threads=3)
    joint().steps_.label(drive(1)[:20], n_threads=3)
    joint().label(of_drives()[0].grid, drive(1)[:20], n_threads=3)
    assert limits == [3] * 3


def test_comparisons_label_with_as_many_threads_as_are_allowed(
    limits: list[int], building: Path, run: Run
) -> None:
    arguments = (building / "config.toml", "-o", building / "out", "--threads", 3, "-q")
    code, _, error = run("compare", *arguments)
    assert code == 0, error
    assert set(limits) == {3}
