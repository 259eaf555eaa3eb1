"""Maps labelled in a second process: its answers are files, and its end is told."""

import os
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from pgm_places.errors import InputError
from pgm_places.io.places.place_ids_file import read_session
from pgm_places.live.live_map import LiveMap
from pgm_places.live.map_process import (
    MOST_STARTS,
    NICENESS,
    LabelledMapMessages,
    MapAnswer,
    MapLabeller,
    MapProcess,
)
from pgm_places.persistence.stored import save
from tests.drives import building
from tests.live.robot import raw_map
from tests.quick_labeler import places
from tests.real_data import ROOT

PATIENCE_S = 300.0


@pytest.fixture
def service(tmp_path: Path) -> Iterator[MapProcess]:
    save(places(), tmp_path / "model")
    found = MapProcess(str(tmp_path / "model"), n_threads=1)
    yield found
    found.close()


def answer_of(service: MapProcess) -> MapAnswer:
    end = time.monotonic() + PATIENCE_S
    while (found := service.answer()) is None:
        assert time.monotonic() < end, "no answer came"
        time.sleep(0.02)
    return found


def test_another_process_finds_what_this_one_would(service: MapProcess) -> None:
    grid = building()[0].grid
    alone = MapLabeller(LiveMap(places(), n_threads=1))
    for number, raw in enumerate((raw_map(grid), raw_map(grid, 5.0)), 1):
        assert service.is_idle
        service.submit(raw)
        assert not service.is_idle
        found, wanted = answer_of(service), alone.label(raw)
        assert isinstance(found, LabelledMapMessages)
        assert found.messages == wanted.messages
        assert found.view.map_seq == wanted.view.map_seq == number
        for name in ("number", "rows", "shares", "region"):
            np.testing.assert_array_equal(getattr(found.view, name), getattr(wanted.view, name))
        assert found.view.places == wanted.view.places
    service.submit(b"\0\1\0\0nonsense")
    problem = answer_of(service)
    assert isinstance(problem, str)
    assert problem.startswith(
        "the map is not labelled: a message of map cannot be read as nav_msgs/msg/OccupancyGrid"
    )
    assert service.is_idle


def test_a_process_that_ends_is_told(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    for name in ("json", "numpy"):  # neither is imported
        (tmp_path / f"{name}.py").write_text("raise SystemExit('a stranger ran')")
    service = MapProcess(str(tmp_path / "nothing"), n_threads=1)
    try:
        service.submit(raw_map(building()[0].grid))
        assert "no model at" in str(answer_of(service))
        if hasattr(os, "getpriority"):
            mine, its = (os.getpriority(os.PRIO_PROCESS, n) for n in (0, service._process.pid))
            assert its == min(mine + NICENESS, 19)
        service._process.kill()
        ended = "the process that labels maps has ended (exit code -9)"
        assert answer_of(service) == f"{ended}; it is started again, and places keep their ids"
        assert service.is_idle
        service.submit(raw_map(building()[0].grid))  # which the new one answers
        assert "no model at" in str(answer_of(service))
        for _ in range(MOST_STARTS):
            assert service.is_idle
            service._process.kill()
            assert ended in str(answer_of(service))
        service._process.kill()
    finally:
        service.close()


def test_a_node_that_is_killed_leaves_nothing_in_the_temporary_folder(tmp_path: Path) -> None:
    source = (
        "import os, signal, sys\n"
        "from pgm_places.live.map_process import MapProcess\n"
        "service = MapProcess('nothing', n_threads=1)\n"
        "assert os.listdir(os.environ['TMPDIR'])\n"
        "os.kill(os.getpid(), signal.SIGKILL)\n"
    )
    environment = {**os.environ, "TMPDIR": str(tmp_path), "PYTHONPATH": str(ROOT)}
    ended = subprocess.run([sys.executable, "-c", source], env=environment, check=False)
    assert ended.returncode == -signal.SIGKILL
    end = time.monotonic() + PATIENCE_S
    while any(tmp_path.iterdir()):
        assert time.monotonic() < end, "the folder is still there"
        time.sleep(0.05)


def test_a_process_that_is_killed_at_work_labels_the_map_and_places_keep_their_ids(
    service: MapProcess,
) -> None:
    grid = building()[0].grid
    half = grid.cells.copy()
    half[:, : grid.shape[1] // 2] = -1
    service.submit(raw_map(grid.with_cells(half)))
    first = answer_of(service)
    assert isinstance(first, LabelledMapMessages)
    os.kill(service._process.pid, signal.SIGSTOP)  # so that it is sure to be at work
    service.submit(raw_map(grid))
    service._process.kill()
    said = answer_of(service)
    assert isinstance(said, str)
    assert said.endswith("it is started again, and places keep their ids; the map is labelled now")
    second = answer_of(service)
    assert isinstance(second, LabelledMapMessages)
    assert service.is_idle
    assert (first.view.map_seq, second.view.map_seq) == (1, 2)
    stayed = [place for place in first.view.places.values() if place.id in second.view.places]
    assert len(stayed) >= 3
    alone = MapLabeller(LiveMap(places(), n_threads=1))
    alone.label(raw_map(grid.with_cells(half)))
    assert second.view.places == alone.label(raw_map(grid)).view.places


def test_ids_outlive_a_restart_with_the_file_of_the_session(tmp_path: Path) -> None:
    save(places(), tmp_path / "model")
    session, grid = tmp_path / "office.session", building()[0].grid
    found: list[LabelledMapMessages] = []
    mirrored = grid.with_cells(np.where(np.arange(grid.shape[1]) > 30, grid.cells, -1))
    for number, item in enumerate((mirrored, grid)):
        service = MapProcess(str(tmp_path / "model"), n_threads=1, session=session)
        try:
            service.submit(raw_map(item))
            answer = answer_of(service)
        finally:
            service.close()
        assert isinstance(answer, LabelledMapMessages)
        assert answer.view.map_seq == number + 1
        found.append(answer)
    memory = read_session(session)
    assert memory.n_maps == 2
    assert {place.name for place in found[1].view.places.values()} <= {*memory.names.values()}
    alone = MapLabeller(LiveMap(places(), n_threads=1))
    alone.label(raw_map(mirrored))
    assert found[1].view.places == alone.label(raw_map(grid)).view.places
    session.write_text("{}")
    with pytest.raises(InputError, match="does not hold a session of 'pgm-places live'"):
        MapProcess(str(tmp_path / "model"), session=session)
