"""A model of cells and steps labels a drive with its map, either alone, and refuses the rest."""

from functools import lru_cache
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from pgm_places.io.logs.trajectories import read_trajectory, write_trajectory
from pgm_places.io.maps.label_image import load_labels
from pgm_places.io.maps.map_server import load_map, save_map
from pgm_places.io.output_set import RECORD_FILE
from pgm_places.io.staging import file_names
from pgm_places.labelers.joint_labeler import JointLabeler
from pgm_places.labelers.place_labeler import PlaceLabeler
from pgm_places.labelers.trajectory_labeler import TrajectoryLabeler
from pgm_places.labelling.files import TRACK, output_file_names
from pgm_places.labelling.label import label_map_and_drive
from pgm_places.maps.coarsening import refine
from pgm_places.maps.occupancy_grid import OccupancyGrid
from pgm_places.models.decision_list import DecisionListClassifier
from pgm_places.persistence.stored import save
from pgm_places.sensing.sensor import Sensor
from pgm_places.spaces.unentered import find_unentered
from pgm_places.trajectories.trajectory import MappedDrive
from tests.cli.conftest import Run
from tests.cli.test_track import rows_of
from tests.drives import building, drive


@lru_cache
def joint() -> JointLabeler:
    known, names = building()
    quick, sensor = DecisionListClassifier(n_rounds=5, order="heuristic"), Sensor(max_range_m=12.0)
    places = PlaceLabeler(names, sensor=sensor, classifier=quick, space=None, n_folds=2)
    steps = TrajectoryLabeler(names, "independent", 0.3, sensor=sensor, classifier=quick, n_folds=2)
    return JointLabeler(names, "potts", 4.0, places, steps).fit([MappedDrive(known, drive(0))])


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """The model, a map and a log."""
    save(joint(), tmp_path / "model")
    save_map(building()[0].grid, tmp_path / "map")
    write_trajectory(tmp_path / "drive.log", drive(1)[:60])
    return tmp_path


def _assert_only_reachable_space_has_labels(
    labels: NDArray[np.int16],
    unentered: NDArray[np.bool_],
    grid: OccupancyGrid,
    expected: NDArray[np.int64],
) -> None:
    reachable = grid.free & ~unentered
    assert (labels[~reachable] == -1).all() and (reachable != grid.free).any()
    np.testing.assert_array_equal(labels[reachable], expected[reachable[grid.free]])


def test_the_steps_and_the_cells_are_labelled_together(folder: Path, run: Run) -> None:
    log, out, yaml = folder / "drive.log", folder / "out", folder / "map.yaml"
    model = folder / "model"
    code, text, error = run("track", log, "--map", yaml, "-m", model, "-o", out, "-q")
    assert (code, error) == (0, "")
    names = building()[1]
    written = file_names(out)
    assert written >= {RECORD_FILE, *TRACK, "labels.png", "places.json", "details/summary.json"}
    assert written <= {RECORD_FILE, *TRACK, *output_file_names(names), "place_names.yaml"}
    assert "places: " in text and "potts: corridor" in text
    grid, path = load_map(yaml).grid, read_trajectory(log).trajectory
    expected = joint().label(grid, path)
    assert expected.cells is not None and expected.steps is not None
    assert [row["label"] for row in rows_of(out / "beliefs.csv")] == [
        names[k] for k in expected.steps.labels
    ]
    labels = load_labels(out / "labels.png", names, grid=grid)
    unentered = find_unentered(grid, 0.2)
    assert unentered is not None
    _assert_only_reachable_space_has_labels(labels, unentered.cells, grid, expected.cells.labels)


def test_a_drive_without_a_map_is_labelled_by_itself(folder: Path, run: Run) -> None:
    log, out, model = folder / "drive.log", folder / "out", folder / "model"
    code, _, error = run("track", log, "-m", model, "-o", out, "--every", 0.5, "-q")
    assert (code, error) == (0, "")
    assert {path.name for path in out.iterdir()} == {RECORD_FILE, *TRACK}
    path = read_trajectory(log).trajectory
    expected = joint().with_steps(every_m=0.5).label(drive=path).steps
    assert expected is not None
    assert [row["label"] for row in rows_of(out / "beliefs.csv")] == [
        building()[1][k] for k in expected.labels
    ]


def test_a_map_without_a_drive_is_labelled_by_label(folder: Path, run: Run) -> None:
    out, yaml = folder / "out", folder / "map.yaml"
    code, text, error = run("label", yaml, "-m", folder / "model", "-o", out, "-q", "--unentered")
    assert (code, error) == (0, "")
    assert "potts: corridor" in text
    grid = load_map(yaml).grid
    expected = joint().label(grid).cells
    assert expected is not None
    labels = load_labels(out / "labels.png", building()[1], grid=grid)
    np.testing.assert_array_equal(labels[grid.free], expected.labels)


def test_a_finer_map_is_labelled_at_the_resolution_of_the_model() -> None:
    grid, path = building()[0].grid, drive(1)[:60]
    found = label_map_and_drive(joint(), refine(grid, grid.resolution_m / 2), path)
    expected = joint().label(grid, path)
    assert expected.cells is not None and expected.steps is not None
    assert "resampled from" in found.map.warnings[0]
    unentered = found.map.unentered
    assert unentered is not None
    _assert_only_reachable_space_has_labels(
        found.map.labels[::2, ::2], unentered.cells[::2, ::2], grid, expected.cells.labels
    )
    np.testing.assert_array_equal(found.steps.labels, expected.steps.labels)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["--mode", "smooth"], "this model's method is PottsField, which labels complete drives"),
        (["--map-labels", "labelled"], "pass --map instead"),
        (["--counts", "counts.csv"], "this model uses the laser only"),
        (["--follow"], "labels a complete drive together with its map"),
        (["--every", "-1"], "--every"),
        (["--beams", "rear"], "--beams"),
    ],
)
def test_what_only_other_models_can_do_is_refused_in_a_line(
    folder: Path, run: Run, arguments: list[str], message: str
) -> None:
    out, model = folder / "out", folder / "model"
    code, text, error = run("track", folder / "drive.log", "-m", model, "-o", out, *arguments)
    assert (code, text) == (2, "")
    assert message in error
    assert not out.exists()
