"""Logs are tracked whole or while they grow, and what is wrong is said in one line."""

import csv
import io
import json
import sys
import time
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from pgm_places.features.object_counts import ObjectCounts
from pgm_places.io.logs.trajectories import read_trajectory, write_trajectory
from pgm_places.io.maps.map_server import save_map
from pgm_places.io.output_set import RECORD_FILE
from pgm_places.io.places.topology_files import load_topology
from pgm_places.labelers.place_labeler import PlaceLabeler
from pgm_places.labelers.trajectory_labeler import TrajectoryLabeler
from pgm_places.labelling.files import TRACK
from pgm_places.models.decision_list import DecisionListClassifier
from pgm_places.persistence.map_prior import read_labelled_map
from pgm_places.persistence.stored import load, save
from pgm_places.trajectories.trajectory import Trajectory
from tests.cli.conftest import Run
from tests.drives import building as made_building
from tests.drives import drive
from tests.io.files import write_counts
from tests.quick_labeler import places


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """A model, a map and a log."""
    save(places(), tmp_path / "model")
    save_map(made_building()[0].grid, tmp_path / "map")
    write_trajectory(tmp_path / "drive.log", drive(1)[:60])
    return tmp_path


def rows_of(path: Path) -> list[dict[str, str]]:
    return list(csv.DictReader(io.StringIO(path.read_text())))


def test_a_log_becomes_a_table_pictures_and_a_report(folder: Path, run: Run) -> None:
    out = folder / "out"
    code, text, _ = run(
        "track", folder / "drive.log", "--model", folder / "model", "--out", out, "-q"
    )
    assert code == 0
    assert "doorway" in text and "metres" in text
    names = {path.name for path in out.iterdir()}
    assert names == {RECORD_FILE, *TRACK}
    assert len(rows_of(out / "beliefs.csv")) == 60
    assert text.splitlines()[-2:] == ["Next:", f"  open {out / 'report.html'} in a browser"]


@pytest.mark.parametrize("mode", ["smooth", "viterbi"])
def test_a_known_map_and_other_modes(folder: Path, run: Run, mode: str) -> None:
    out = folder / "out"
    arguments: tuple[Any, ...] = ("--map", folder / "map.yaml", "--mode", mode, "--every", 0.3)
    code, _, err = run(
        "track", folder / "drive.log", "-m", folder / "model", "-o", out, *arguments, "-q"
    )
    assert code == 0
    assert "transitions" not in err  # they are those of the model, over three times the distance
    assert ("p_room" in rows_of(out / "beliefs.csv")[0]) == (mode == "smooth")


def test_following_prints_a_line_per_scan_with_the_beliefs_of_the_whole_log(
    folder: Path, run: Run, monkeypatch: pytest.MonkeyPatch
) -> None:
    class Pipe:
        buffer = io.BytesIO((folder / "drive.log").read_bytes())

    monkeypatch.setattr(sys, "stdin", Pipe())
    model, out = folder / "model", folder / "out"
    code, text, _ = run("track", "-", "--follow", "-m", model, "-o", out, "-q")
    assert code == 0
    lines = [line.split() for line in text.splitlines() if not line.startswith("wrote")]
    assert len(lines) == 60
    run("track", folder / "drive.log", "-m", model, "-o", folder / "whole", "-q")
    whole = rows_of(folder / "whole" / "beliefs.csv")
    assert [line[3] for line in lines] == [row["label"] for row in whole]
    assert rows_of(out / "beliefs.csv") == whole


def test_an_interrupt_ends_following_in_good_order(
    folder: Path, run: Run, monkeypatch: pytest.MonkeyPatch
) -> None:
    def interrupt(seconds: float) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(time, "sleep", interrupt)  # at the end of the file, for now
    out = folder / "out"
    log, model = folder / "drive.log", folder / "model"
    code, text, error = run("track", log, "--follow", "-m", model, "-o", out)
    assert code == 0
    assert "stopped after 60 scans" in error
    assert (out / "report.html").exists()
    assert len(text.splitlines()) == 64


@pytest.fixture
def labelled(folder: Path, run: Run) -> Path:
    """The map, labelled beforehand."""
    out = folder / "labelled"
    assert run("label", folder / "map.yaml", "-m", folder / "model", "-o", out, "-q")[0] == 0
    return out


def test_json_lines_name_the_region_and_the_labelled_map_counts(
    folder: Path, labelled: Path, run: Run, monkeypatch: pytest.MonkeyPatch
) -> None:
    class Pipe:
        buffer = io.BytesIO((folder / "drive.log").read_bytes())

    monkeypatch.setattr(sys, "stdin", Pipe())
    model = folder / "model"
    code, text, _ = run(
        *("track", "-", "--follow", "--jsonl", "--map-labels", labelled, "-m", model, "-q"),
        *("-o", folder / "followed"),
    )
    assert code == 0
    records = [json.loads(line) for line in text.splitlines()]
    places = load_topology(labelled)
    prior = read_labelled_map(labelled, places.label_names).prior
    path = drive(1)[:60]
    expected = load(model)
    assert isinstance(expected, PlaceLabeler)
    tracker = TrajectoryLabeler.from_places(expected)
    found = tracker.label(read_trajectory(folder / "drive.log").trajectory, map_prior=prior)
    assert found.beliefs is not None
    names = tracker.label_names_
    for t, record in enumerate(records):
        assert list(record["beliefs"]) == list(names)
        np.testing.assert_allclose(
            list(record["beliefs"].values()), found.beliefs[t], rtol=0, atol=1e-6
        )
        region = places.region_at(record["x_m"], record["y_m"])
        assert region is not None
        assert record["region"] == {"id": region.id, "name": region.name}
    assert len(records) == len(path)
    alone = tracker.label(read_trajectory(folder / "drive.log").trajectory).beliefs
    assert alone is not None and np.abs(alone - found.beliefs).max() > 0.01


def test_a_growing_table_of_poses_is_labelled_by_scans_cast_in_the_map(
    folder: Path, run: Run, monkeypatch: pytest.MonkeyPatch
) -> None:
    def interrupt(seconds: float) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(time, "sleep", interrupt)
    table, grid = folder / "poses.csv", folder / "map.yaml"
    write_trajectory(table, drive(1)[:20])
    model = folder / "model"
    code, text, _ = run("track", table, "--follow", "--map", grid, "-m", model, "-q")
    assert code == 0
    run("track", table, "--map", grid, "-m", model, "-o", folder / "whole", "-q")
    whole = rows_of(folder / "whole" / "beliefs.csv")
    assert [line.split()[3] for line in text.splitlines()] == [row["label"] for row in whole]


def test_following_goes_on_with_the_log_that_takes_its_place(
    folder: Path, run: Run, monkeypatch: pytest.MonkeyPatch
) -> None:
    log = folder / "drive.log"
    lines = log.read_bytes().splitlines(keepends=True)
    log.write_bytes(b"".join(lines[:-20]))
    steps = iter(["rotate", "truncate", "stop"])

    def wait(seconds: float) -> None:
        match next(steps):
            case "rotate":
                log.rename(folder / "drive.log.1")
                log.write_bytes(b"".join(lines[-20:-10]) + lines[-10][:40])
            case "truncate":
                log.write_bytes(b"".join(lines[-10:-5]))
            case _:
                raise KeyboardInterrupt

    monkeypatch.setattr(time, "sleep", wait)
    code, text, error = run("track", log, "--follow", "-m", folder / "model")
    assert code == 0
    assert error.count("reading it from its start") == 2
    assert len(text.splitlines()) == sum(line.startswith(b"FLASER") for line in lines[:-5])


def test_labels_are_compared_with_a_table_of_true_places(folder: Path, run: Run) -> None:
    log, out, truth = folder / "drive.log", folder / "out", folder / "truth.csv"
    write_trajectory(truth, drive(1)[:60])
    model = folder / "model"
    code, text, _ = run("track", log, "-m", model, "-o", out, "--truth", truth, "-q")
    assert code == 0
    right = sum(row["label"] == row["true_label"] for row in rows_of(out / "beliefs.csv"))
    assert f"{100 * right / 60:.1f} % of the labels are correct" in text
    write_trajectory(truth, drive(1)[:59])
    code, _, error = run("track", log, "-m", model, "-o", out, "--truth", truth, "-q")
    assert code == 2
    assert "59 rows" in error


def objects_along(path: Trajectory) -> NDArray[np.int64]:
    """Counts of monitors and persons that tell the places."""
    assert path.labels is not None
    found: NDArray[np.int64] = np.array([[0, 2], [1, 0], [0, 0]])[path.labels]
    return found


OBJECTS = ("monitor", "person")


@cache
def seeing_labeler() -> TrajectoryLabeler:
    learned = [drive(1), drive(2)]
    labeler = TrajectoryLabeler(
        made_building()[1],
        classifier=DecisionListClassifier(n_rounds=5, order="rarest-first"),
        n_folds=2,
        extra_names=OBJECTS,
    )
    return labeler.fit(trajectories=learned, extra=[objects_along(path) for path in learned])


@pytest.fixture
def seeing(folder: Path) -> Path:
    """Besides those, a model that learned with counts of objects, and the counts of the log."""
    save(seeing_labeler(), folder / "seeing")
    path = drive(1)[:60]
    counts = ObjectCounts(path.times_s, objects_along(path), OBJECTS)
    write_counts(folder / "counts.csv", counts)
    return folder


def test_counts_of_objects_go_into_a_model_that_learned_with_them(
    seeing: Path, run: Run, monkeypatch: pytest.MonkeyPatch
) -> None:
    log, counts = seeing / "drive.log", seeing / "counts.csv"
    code, _, error = run(
        "track", log, "-m", seeing / "seeing", "-o", seeing / "out", "--counts", counts, "-q"
    )
    assert (code, error) == (0, "")
    rows = rows_of(seeing / "out" / "beliefs.csv")
    labeler = load(seeing / "seeing")
    read = read_trajectory(log).trajectory
    expected = labeler.label(read, extra=objects_along(drive(1)[:60]))
    assert [row["label"] for row in rows] == [labeler.label_names_[k] for k in expected.labels]

    class Pipe:
        buffer = io.BytesIO(log.read_bytes())

    monkeypatch.setattr(sys, "stdin", Pipe())
    code, text, _ = run("track", "-", "-f", "-m", seeing / "seeing", "--counts", counts, "-q")
    assert code == 0
    assert [line.split()[3] for line in text.splitlines()] == [row["label"] for row in rows]


def test_counts_in_a_configuration_are_those_of_the_command_line(seeing: Path, run: Run) -> None:
    write_trajectory(seeing / "truth.csv", drive(1)[:60])
    source = 'log = "drive.log"\ntruth = "truth.csv"\ncounts = "counts.csv"\n'
    text = (
        f'nodes = "steps"\n[labels]\nnames = {json.dumps(list(made_building()[1]))}\n'
        f"[classifier]\nn_rounds = 5\nn_folds = 2\n[[train]]\n{source}[[test]]\n{source}"
        '[[methods]]\nname = "hmm"\n'
    )
    (seeing / "counted.toml").write_text(text)
    code, _, error = run("train", seeing / "counted.toml", "-o", seeing / "counted", "-q")
    assert (code, error) == (0, "")
    labeler = load(seeing / "counted")
    assert labeler.scan_model_.extra_names == ("monitor", "person")
    counts = ("--counts", seeing / "counts.csv", "--truth", seeing / "truth.csv")
    code, _, _ = run(
        "track", seeing / "drive.log", "-m", seeing / "counted", "-o", seeing / "out", *counts
    )
    assert code == 0
    rows = rows_of(seeing / "out" / "beliefs.csv")
    right = sum(row["label"] == row["true_label"] for row in rows)
    code, _, _ = run("compare", seeing / "counted.toml", "-o", seeing / "report", "-q")
    assert code == 0
    record = json.loads((seeing / "report" / "results.json").read_text())
    assert record["methods"]["hmm"]["accuracy"] == pytest.approx(right / 60)
    assert any(name.endswith("counts.csv") for name in record["inputs"])


@pytest.mark.parametrize(
    ("model", "counts", "code", "messages"),
    [
        ("seeing", None, 2, ["also uses counts of monitor, person", "--counts"]),
        ("model", "t_s,person\n0.0,1\n", 2, ["uses the laser only"]),
        ("seeing", "t_s,lamp\n0.0,1\n", 2, ["none of the objects", "lamp"]),
        ("seeing", "t_s,person\n90000.0,1\n", 0, ["has no monitor", "use the same clock?"]),
    ],
)
def test_counts_that_do_not_fit_are_named(
    model: str, counts: str | None, code: int, messages: list[str], seeing: Path, run: Run
) -> None:
    path, arguments = seeing / "other.csv", ("-m", seeing / model, "-o", seeing / "out")
    path.write_text(counts or "")
    more = () if counts is None else ("--counts", path)
    found, _, error = run("track", seeing / "drive.log", *arguments, *more)
    assert found == code
    assert all(message in error for message in messages)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["drive.log"], "--out"),
        (["-", "--out", "out"], "--follow"),
        (["nowhere.log", "--out", "out"], "no such file"),
        (["drive.log", "--out", "out", "--mode", "smoothly"], "mode"),
        (["drive.log", "--out", "out", "--beams", "rear"], "local-map"),
        (["drive.log", "--out", "out", "--beams", "known-map"], "no map is given"),
        (["drive.log", "--out", "out", "--map", "nowhere.yaml"], "nowhere.yaml"),
        (["drive.log", "--follow", "--mode", "smooth"], "filter"),
        (["nowhere.log", "--follow"], "no such file"),
        (["drive.mcap", "--follow"], "drive.mcap is a bag, whose index is written when recording"),
        (["drive.csv", "--follow"], "drive.csv has poses but no scans; pass the map to cast"),
        (["drive.log", "--follow", "--truth", "truth.csv"], "--truth scores complete logs"),
        (["drive.log", "--out", "out", "--jsonl"], "--jsonl requires --follow"),
        (["drive.log", "--out", "out", "--map-labels", "model"], "places.json"),
        (["/dev/null", "--follow"], "is a device or a pipe"),
        (["a\x1b[2Jb.log", "--out", "out"], r"a\x1b[2Jb.log: no such file"),
        (["drive.log.gz", "--follow"], "compressed"),
    ],
)
def test_what_is_wrong_is_said_in_one_line(
    folder: Path, run: Run, monkeypatch: pytest.MonkeyPatch, arguments: list[str], message: str
) -> None:
    monkeypatch.chdir(folder)
    code, _, error = run("track", *arguments, "--model", "model", "-q")
    assert code == 2
    assert message in error
    assert len(error.strip().splitlines()) == 1
    assert not list(folder.glob("out/*"))


DRIVES = """
nodes = "steps"
[labels]
names = ["corridor", "room", "doorway"]
[classifier]
n_rounds = 3
[steps]
every_m = 0.3
beams = { missing = "mirror" }
[[train]]
log = "train.log"
truth = "train.csv"
[[methods]]
name = "hmm"
mode = "smooth"
"""


def test_a_model_of_drives_is_trained_from_a_configuration_and_tracks(
    folder: Path, run: Run
) -> None:
    for suffix in ("log", "csv"):
        write_trajectory(folder / f"train.{suffix}", drive(0))
    config = folder / "drives.toml"
    config.write_text(DRIVES)
    code, out, err = run("train", config, "--out", folder / "tracker", "--quiet")
    assert code == 0, err
    assert "method: hmm" in out
    labeler = load(folder / "tracker")
    assert isinstance(labeler, TrajectoryLabeler)
    options = (labeler.every_m, labeler.beams.missing, labeler.method_.mode)
    assert options == (0.3, "mirror", "smooth")
    code, out, err = run(
        "track", folder / "drive.log", "--model", folder / "tracker", "--out", folder / "tracked"
    )
    assert code == 0, err
    assert len(rows_of(folder / "tracked" / "beliefs.csv")) == 60

    config.write_text(DRIVES + '[[methods]]\nname = "relaxation"\n')
    code, out, err = run("train", config, "--out", folder / "another", "--quiet")
    assert code == 2
    assert "a model of drives has one method, but the configuration has hmm, relaxation" in err
    assert not (folder / "another").exists()
