"""``label --corrections``, and corrections of training maps in configurations."""

import json
from pathlib import Path

import numpy as np

from pgm_places.experiment.config import load_config
from pgm_places.experiment.experiment import Experiment
from pgm_places.experiment.sources import load_maps
from pgm_places.io.maps.label_image import load_labels
from pgm_places.io.maps.map_server import load_map
from pgm_places.teaching.paint import Paint
from tests.cli.conftest import Run

NAMES = ("corridor", "room", "doorway")


def test_painted_cells_are_kept_whatever_the_file(tmp_path: Path, run: Run, building: Path) -> None:
    grid = load_map(building / "map.yaml").grid
    rows, columns = np.nonzero(grid.free)
    half = np.stack([rows, columns], axis=1)[len(rows) // 2 :: 3]
    paint = Paint.blank(grid.shape, NAMES).with_cells(half, "doorway")
    for name in ("paint.png", "paint.geojson"):
        path, out = paint.save(tmp_path / name, grid), tmp_path / name.replace(".", "_")
        code, _, err = run("label", building / "map.yaml", "--corrections", path, "--out", out)
        assert code == 0, err
        found = load_labels(out / "labels.png", NAMES, grid=grid)
        assert (found[paint.painted & grid.free] == 2).all()


def test_corrections_that_do_not_fit_are_refused_in_one_line(
    tmp_path: Path, run: Run, building: Path
) -> None:
    path, out = tmp_path / "kitchen.geojson", tmp_path / "out"
    ring = [[0, 0], [1, 0], [1, 1], [0, 0]]
    geometry = {"type": "Polygon", "coordinates": [ring]}
    feature = {"type": "Feature", "geometry": geometry, "properties": {"class": "kitchen"}}
    path.write_text(json.dumps(feature))
    code, _, err = run("label", building / "map.yaml", "--corrections", path, "--out", out)
    assert code == 2
    assert "kitchen" in err and "Known: corridor, doorway, room" in err
    assert len(err.strip().splitlines()) == 2  # the stage "map", and the message
    assert not out.exists()


def test_a_configuration_corrects_its_training_maps(building: Path) -> None:
    grid = load_map(building / "map.yaml").grid
    truth = load_labels(building / "labels.png", NAMES, grid=grid)
    some = np.argwhere(grid.free)[:50]
    Paint.blank(grid.shape, NAMES).with_cells(some, "doorway").save(building / "fix.geojson", grid)
    config = building / "config.toml"
    line = 'labels = "labels.png"'
    config.write_text(config.read_text().replace(line, f'{line}\ncorrections = "fix.geojson"', 1))
    experiment = Experiment(load_config(config), building)
    [found], [test] = (load_maps(experiment, part) for part in ("train", "test"))
    assert (found.labels[tuple(some.T)] == 2).all()
    others = np.ones(grid.shape, np.bool_)
    others[tuple(some.T)] = False
    np.testing.assert_array_equal(found.labels[others], truth[others])
    np.testing.assert_array_equal(test.labels, truth)
