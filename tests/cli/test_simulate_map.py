"""Robot-like maps of a plan from the command line, and in configurations."""

from pathlib import Path

import pytest

from pgm_places.experiment.config import parse_config
from pgm_places.experiment.experiment import Experiment
from pgm_places.experiment.sources import load_maps
from pgm_places.io.maps.label_image import load_labels
from pgm_places.io.maps.map_server import load_map
from pgm_places.maps.labelled_map import LabelledMap
from pgm_places.simulation import MapSimulation, simulate_map
from tests.cli.conftest import Run

NAMES = ("corridor", "room", "doorway")


def test_a_plan_becomes_maps_with_labels(building: Path, run: Run, tmp_path: Path) -> None:
    options = ("--seed", 4, "--copies", 2, "--furniture", "0.5,0.8", "-q")
    plan = building / "map.yaml"
    labels = building / "labels.png"
    code, text, _ = run("simulate-map", plan, "--labels", labels, "-o", tmp_path / "x", *options)
    assert code == 0
    assert "map_4.yaml" in text and "map_5_labels.png" in text
    grid = load_map(plan).grid
    drawn = LabelledMap(grid, load_labels(labels, NAMES, grid=grid))
    for seed in (4, 5):
        written = load_map(tmp_path / "x" / f"map_{seed}.yaml").grid
        made = simulate_map(drawn, NAMES, seed=seed, options=MapSimulation(furniture=(0.5, 0.8)))
        assert (written.cells == made.grid.cells).all()
        found = load_labels(tmp_path / "x" / f"map_{seed}_labels.png", NAMES, grid=written)
        assert (found == made.labels).all()


def test_a_bad_range_is_one_line(building: Path, run: Run, tmp_path: Path) -> None:
    plan = ("simulate-map", building / "map.yaml", "--labels", building / "labels.png")
    code, _, text = run(*plan, "-o", tmp_path, "--scale", "1.2,0.9")
    assert code == 2
    assert "--scale must not end before it begins, got [1.2, 0.9]" in text


def test_a_configuration_takes_simulated_maps(building: Path) -> None:
    plan = {"map": str(building / "map.yaml"), "labels": str(building / "labels.png")}
    config = parse_config(
        {
            "labels": {"names": list(NAMES)},
            "train": [
                {**plan, "building": "one"},
                {**plan, "building": "one", "simulated": 7, "name": "robot"},
                {**plan, "simulated": 7, "simulation": {"oblique": 0.0, "scale": [1.0, 1.0]}},
            ],
            "methods": [{"name": "independent"}],
        }
    )
    drawn, robot, upright = load_maps(Experiment(config, building), "train")
    expected = simulate_map(drawn, NAMES, seed=7)
    assert (robot.name, robot.building) == ("robot", "one")
    assert (robot.grid.cells == expected.grid.cells).all()
    assert upright.building == str(building / "map.yaml")


def test_simulated_maps_have_the_cells_of_the_configuration(building: Path) -> None:
    plan = {"map": str(building / "map.yaml"), "labels": str(building / "labels.png")}
    config = parse_config(
        {
            "resolution_m": 0.23,
            "labels": {"names": list(NAMES)},
            "train": [plan, {**plan, "simulated": 1}, {**plan, "simulated": 2}],
            "methods": [{"name": "independent"}],
        }
    )
    maps = load_maps(Experiment(config, building), "train")
    assert [item.grid.resolution_m for item in maps] == pytest.approx([0.23] * 3)
