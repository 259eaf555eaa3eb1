"""Commands warn about a drive that does not fit its map, and refuse one that fits it badly."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from pgm_places.io.logs.trajectories import write_trajectory
from pgm_places.io.maps.map_server import save_map
from pgm_places.persistence.stored import save
from pgm_places.trajectories.trajectory import Trajectory
from tests.cli.conftest import Run
from tests.drives import building, drive
from tests.io.logs.bag_files import BagFile
from tests.quick_labeler import places


def shifted(path: Trajectory, shift_m: float) -> Trajectory:
    """The drive in a frame that is shifted along x."""
    return replace(path, poses=path.poses + np.array([shift_m, 0.0, 0.0]))


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """A model, a map, and drives in its frame, almost in it, and in another one."""
    save(places(), tmp_path / "model")
    save_map(building()[0].grid, tmp_path / "map")
    path = drive(1)[:60]
    for name, shift_m in (("right", 0.0), ("near", 0.35), ("wrong", 40.0)):
        write_trajectory(tmp_path / f"{name}.log", shifted(path, shift_m))
    return tmp_path


Track = Callable[..., tuple[int, str, str]]


@pytest.fixture
def track(folder: Path, run: Run) -> Track:
    """Runs ``track`` of a log on the map with further arguments."""

    def tracked(log: str, *more: object) -> tuple[int, str, str]:
        model, grid = folder / "model", folder / "map.yaml"
        return run("track", folder / f"{log}.log", "-m", model, "--map", grid, *more)

    return tracked


def test_a_drive_in_another_frame_is_refused_in_one_line(folder: Path, track: Track) -> None:
    code, text, error = track("wrong", "-o", folder / "out", "-q")
    assert (code, text) == (2, "")
    [line] = error.splitlines()
    assert "wrong does not fit" in line and "0 % of its poses lie in free space" in line
    assert line.endswith("--force labels it anyway")
    assert not (folder / "out").exists()


def test_force_labels_it_and_the_report_says_so(folder: Path, track: Track) -> None:
    code, _, error = track("wrong", "-o", folder / "out", "--force")
    assert code == 0
    assert "wrong does not fit" in error
    assert "wrong does not fit" in (folder / "out" / "report.html").read_text()


def test_a_slight_misfit_is_a_warning(folder: Path, track: Track) -> None:
    code, _, error = track("near", "-o", folder / "out")
    assert code == 0
    assert "near does not fit" in error
    assert "does not fit" not in track("right", "-o", folder / "out")[2]


def test_following_stops_once_enough_scans_disagree(
    folder: Path, track: Track, monkeypatch: pytest.MonkeyPatch
) -> None:
    def interrupt(seconds: float) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr("time.sleep", interrupt)
    code, text, error = track("wrong", "--follow", "-q")
    assert code == 2
    assert len(text.splitlines()) == 49  # the 50th scan is the first to be compared
    assert "does not fit" in error
    assert track("right", "--follow", "-q")[0] == 0


def test_a_labelled_map_is_compared_too(folder: Path, run: Run) -> None:
    labelled, model = folder / "labelled", folder / "model"
    assert run("label", folder / "map.yaml", "-m", model, "-o", labelled, "-q")[0] == 0
    more = ("-m", model, "--map-labels", labelled, "-o", folder / "out", "-q")
    code, _, error = run("track", folder / "wrong.log", *more)
    assert code == 2
    assert f"does not fit {labelled}" in error


def test_a_replay_compares_its_last_map(folder: Path, run: Run) -> None:
    bag = BagFile()
    bag.drive(shifted(drive(1)[:30], 40.0))
    bag.map(4.1, building()[0].grid)
    bag.entries.sort(key=lambda entry: entry[2])
    log = bag.write(folder)
    arguments = ("live", "--replay", log, "--model", folder / "model", "-q")
    code, _, error = run(*arguments)
    assert code == 2
    assert "does not fit the map on map" in error
    assert run(*arguments, "--force")[0] == 0


def test_the_studio_refuses_a_drive_of_another_frame(folder: Path, run: Run) -> None:
    code, _, error = run("studio", folder / "map.yaml", "--drive", folder / "wrong.log")
    assert code == 2
    [line] = error.splitlines()
    assert line.endswith("omit --drive to open the map without it")
