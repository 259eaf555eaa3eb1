"""The shipped models: they load, label, say how they were learned, and name no machine."""

import json
from pathlib import Path

import numpy as np
import pytest

from pgm_places import LabelledMap, PlaceLabeler, evaluate
from pgm_places.errors import ModelFileError
from pgm_places.inference.labeling import Status
from pgm_places.io.logs.trajectories import write_trajectory
from pgm_places.io.maps.map_server import load_map
from pgm_places.labelling.label import label_map
from pgm_places.persistence.stored import save
from pgm_places.simulation import generate_building
from pgm_places.simulation.simulated_robot import SimulatedRobot
from pgm_places.trained import NAMES, TRACKING, model_folder, trained_labeler, trained_tracker
from pgm_places.trajectories.scan import ScanGeometry
from tests.cli.conftest import Run
from tests.real_data import real_data_folder


@pytest.mark.parametrize("name", NAMES)
def test_labels_a_building_without_training(name: str) -> None:
    building = generate_building(9, size="small", resolution_m=0.05)
    labeler = trained_labeler(name)
    labeling = labeler.label(building.grid)
    truth = building.labels[building.grid.free]
    found = evaluate(truth, labeling.labels, building.label_names)
    assert found.balanced_accuracy > 0.75


@pytest.mark.parametrize("name", [*NAMES, TRACKING])
def test_says_how_it_was_learned_and_names_no_machine(name: str) -> None:
    folder = model_folder(name)
    text = (folder / "manifest.json").read_text(encoding="utf-8")
    record = json.loads(text)["content"]["record"]
    assert record["config"]["train"] and record["versions"]["numpy"]
    assert {len(digest) for digest in record["inputs"].values()} == {64}
    assert not any(Path(path).is_absolute() for path in record["inputs"])
    most = 6_000_000 if name == "default" else 200_000  # eight networks
    assert sum(path.stat().st_size for path in folder.iterdir()) < most


@pytest.mark.real_data
def test_the_field_settles_on_a_large_map() -> None:
    """Mean field needs 28 iterations on this map, more than the former limit of 20."""
    grid = load_map(real_data_folder("robots") / "hospital_aaf" / "map.yaml").grid
    labeling = label_map(trained_labeler(), grid).labeling
    assert labeling.status is Status.CONVERGED
    assert labeling.info["iterations"] > 20


@pytest.mark.parametrize(
    ("view_degrees", "n_beams", "reach_m"), [(90, 61, 80.0), (180, 181, 4.0), (360, 720, 12.0)]
)
def test_tracks_any_laser_without_training_or_map(
    view_degrees: float, n_beams: int, reach_m: float
) -> None:
    building = generate_building(109, size="small", resolution_m=0.05)
    geometry = ScanGeometry.ahead(n_beams, np.deg2rad(view_degrees), range_max_m=reach_m)
    path = SimulatedRobot(geometry, radius_m=0.2).explore(building.grid, max_length_m=20.0)
    path = path.labelled_by(LabelledMap(building.grid, building.labels), building.label_names)
    labeler = trained_tracker().with_options(method__mode="smooth")
    assert path.labels is not None
    found = evaluate(path.labels, labeler.label(path).labels, building.label_names)
    assert found.balanced_accuracy > 0.6


def test_track_needs_neither_model_nor_map(tmp_path: Path, run: Run) -> None:
    building = generate_building(109, size="small", resolution_m=0.05)
    path = SimulatedRobot(radius_m=0.2).explore(building.grid, max_length_m=10.0)
    write_trajectory(tmp_path / "drive.log", path)
    code, out, err = run("track", tmp_path / "drive.log", "--out", tmp_path / "tracked")
    assert code == 0, err
    assert "corridor" in out
    code, _, err = run("label", tmp_path / "map.yaml", "-m", TRACKING, "--out", tmp_path / "no")
    assert code == 2
    assert "trajectory-labeler" in err


def test_no_folder_stands_in_for_a_shipped_model(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    save(trained_labeler("generated"), tmp_path / "default")
    monkeypatch.chdir(tmp_path)
    assert model_folder("default").parent.name == "trained"
    assert model_folder("./default") == Path("default")
    assert isinstance(trained_labeler("./default"), PlaceLabeler)
    with pytest.raises(ModelFileError, match="Did you mean 'generated'"):
        model_folder("generatd")
