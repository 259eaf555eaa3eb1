"""Simulated drives from the command line."""

from functools import partial
from pathlib import Path

import numpy as np
import pytest

import pgm_places.simulation.building
from pgm_places.io.logs.trajectories import read_trajectory
from pgm_places.io.output_set import RECORD_FILE
from pgm_places.simulation.building import generate_building
from tests.cli.conftest import Run

DRIVE = ("--length", 4, "--range", 8, "-q")


@pytest.mark.parametrize(
    ("view", "beams", "first_degrees"), [(180, 90, -90.0), (270, 28, -135.0), (360, 36, 0.0)]
)
def test_a_log_holds_the_drive_and_the_truth_stands_beside_it(
    building: Path, run: Run, view: int, beams: int, first_degrees: float
) -> None:
    out = building / "drives" / "one.log.gz"
    options = ("--labels", building / "labels.png", "--view", view, "--beams", beams)
    code, text, _ = run("simulate", building / "map.yaml", "--out", out, *options, *DRIVE)
    assert code == 0
    assert "scans of" in text and "corridor" in text
    assert {path.name for path in out.parent.iterdir()} == {
        "one.log.gz",
        "one.truth.csv",
        "one.png",
        RECORD_FILE,
    }
    log = read_trajectory(out).trajectory
    truth = read_trajectory(out.with_name("one.truth.csv")).trajectory
    assert log.geometry is not None and log.odometry is not None and truth.labels is not None
    assert log.geometry.n_beams == beams
    np.testing.assert_allclose(
        np.rad2deg(log.geometry.angles_rad[0]), first_degrees, rtol=0, atol=1e-6
    )
    assert (log.poses == truth.poses).all()
    assert (log.odometry != log.poses).any()
    np.testing.assert_allclose(log.path_length_m, 4.0, rtol=0, atol=0.3)


def test_a_log_of_wheels_only_does_not_know_the_true_poses(building: Path, run: Run) -> None:
    out = building / "one.log"
    assert run("simulate", building / "map.yaml", "-o", out, "--wheels-only", *DRIVE)[0] == 0
    log = read_trajectory(out).trajectory
    truth = read_trajectory(building / "one.truth.csv").trajectory
    assert log.odometry is None
    assert (log.poses[0] == truth.poses[0]).all()
    assert (log.poses[-1] != truth.poses[-1]).any()
    assert truth.labels is None


def test_the_demo_writes_its_building_too(
    tmp_path: Path, run: Run, monkeypatch: pytest.MonkeyPatch
) -> None:
    small = partial(generate_building, size="small")
    monkeypatch.setattr(pgm_places.simulation.building, "generate_building", small)
    code, text, _ = run("simulate", "--demo", "--out", tmp_path / "a.csv", *DRIVE)
    assert code == 0
    names = {path.name for path in tmp_path.iterdir()}
    maps = {"a_map.yaml", "a_map.png", "a_labels.png", "a_labels.yaml"}
    assert names == {RECORD_FILE, "a.csv", "a.png", *maps}
    again = (*DRIVE, "--labels", tmp_path / "a_labels.png")
    code, same, _ = run("simulate", tmp_path / "a_map.yaml", "--out", tmp_path / "b.csv", *again)
    assert code == 0
    assert same.splitlines()[:6] == text.splitlines()[:6]
    assert (tmp_path / "b.csv").read_bytes() == (tmp_path / "a.csv").read_bytes()


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["map.yaml", "--out", "a.txt"], "a trajectory can be written as .log"),
        (["--out", "a.log"], "needs a map, or --demo"),
        (["map.yaml", "--demo", "--out", "a.log"], "needs a map, or --demo"),
        (["none.yaml", "--out", "a.log"], "none.yaml"),
        (["map.yaml", "--robot-radius", "9", "--out", "a.log"], "fits nowhere on this map"),
        (["map.yaml", "--labels", "none.png", "--out", "a.log"], "none.png"),
        (["map.yaml", "--out", "labels.png/a.log"], "a file of that name is in the way"),
    ],
)
def test_bad_input_is_one_line_and_writes_nothing(
    building: Path, run: Run, monkeypatch: pytest.MonkeyPatch, arguments: list[str], message: str
) -> None:
    monkeypatch.chdir(building)
    before = sorted(building.iterdir())
    code, _, errors = run("simulate", *arguments, "-q")
    assert code == 2
    assert message in errors
    assert len(errors.strip().splitlines()) == 1
    assert sorted(building.iterdir()) == before
