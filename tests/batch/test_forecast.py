"""The time that maps are expected to take: in proportion to the work, by the speed measured."""

import time
from collections.abc import Iterator
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from pgm_places.batch.map_task import Failure, MapTask, label_one
from pgm_places.cli import doctor_maps
from pgm_places.cli.doctor_maps import Forecast, seconds_per_cell
from pgm_places.errors import InputError
from pgm_places.io.maps.map_server import load_map
from pgm_places.labelling.options import LabelOptions
from pgm_places.simulation import generate_building

OPTIONS = LabelOptions(model="generated")


def clock(*seconds: float) -> Iterator[float]:
    """The processor time at the start and the end of runs that take so long."""
    now = 0.0
    for taken in seconds:
        yield now
        now += taken
        yield now


def test_the_speed_is_that_of_the_faster_run_once_kernels_are_loaded(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    folders, cells = set(), []

    def labelled(task: MapTask) -> Any:
        grid = load_map(task.map).grid
        cells.append((grid.cells.size, int(grid.free.sum())))
        folders.add(task.folder)

    times = clock(30.0, 0.9, 0.6, 0.8)
    monkeypatch.setattr(doctor_maps, "label_one", labelled)
    monkeypatch.setattr(time, "process_time", lambda: next(times))
    speed = seconds_per_cell(OPTIONS)
    assert len(folders) == 4  # one that is done would take no time
    assert len(set(cells)) == 1
    assert speed * Forecast(*cells[0]).work == pytest.approx(0.6)
    assert not any(Path(folder).exists() for folder in folders)
    twice = Forecast(2 * cells[0][0], 2 * cells[0][1])
    assert 0.6 < speed * twice.work < 1.2  # some of the time goes to begin with a map


def test_a_floor_that_cannot_be_labelled_is_said(monkeypatch: pytest.MonkeyPatch) -> None:
    def failed(task: MapTask) -> Failure:
        return task.failure(MemoryError())

    monkeypatch.setattr(doctor_maps, "label_one", failed)
    with pytest.raises(InputError, match="speed of this machine could not be measured: out of mem"):
        seconds_per_cell(OPTIONS)


def test_a_floor_is_really_labelled(monkeypatch: pytest.MonkeyPatch) -> None:
    made = generate_building(1, size="small", resolution_m=0.1)
    corner = made.grid.with_cells(made.grid.cells[:40, :50])
    monkeypatch.setattr(
        doctor_maps, "generate_building", lambda *_, **__: SimpleNamespace(grid=corner)
    )
    written = []

    def label(task: MapTask) -> Any:
        outcome = label_one(task)
        written.append((Path(task.folder) / "places.json").exists())
        return outcome

    monkeypatch.setattr(doctor_maps, "label_one", label)
    assert seconds_per_cell(OPTIONS) > 0
    assert written == [True] * 4, "the time of finding places counts"
