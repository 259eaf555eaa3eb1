"""What ``label`` and ``doctor`` say of space that was never entered."""

import json
from pathlib import Path

import pytest

from pgm_places.cli.command import Command
from pgm_places.cli.label import label
from pgm_places.cli.places import export
from pgm_places.cli.simulate import simulate
from pgm_places.errors import InputError
from pgm_places.io.maps.map_server import load_map, save_map
from pgm_places.spaces.unentered import find_unentered
from tests.cli.conftest import Run
from tests.labelers.test_label_entered import rays


@pytest.fixture
def map_yaml(tmp_path: Path) -> Path:
    save_map(rays()[0], tmp_path / "map")
    return tmp_path / "map.yaml"


def test_label_and_doctor_say_so(map_yaml: Path, run: Run) -> None:
    grid = load_map(map_yaml).grid
    unentered = find_unentered(grid)
    out = map_yaml.parent / "out"
    code, text, _ = run("label", map_yaml, "--model", "generated", "--out", out)
    assert code == 0
    assert f"{unentered}; label it with --unentered" in text.splitlines()
    record = json.loads((out / "details/summary.json").read_text())
    assert record["unentered_m2"] == pytest.approx(unentered.area_m2)
    code, text, _ = run("doctor", map_yaml)
    assert f"note: {unentered}; 'label' gives it no label" in text
    assert text.endswith("no problems found\n")
    everything = map_yaml.parent / "all"
    code, text, _ = run(
        "label", map_yaml, "--model", "generated", "--unentered", "--out", everything
    )
    assert code == 0
    assert "cannot reach" not in text
    assert json.loads((everything / "details/summary.json").read_text())["unentered_m2"] == 0
    code, _, error = run("label", map_yaml, "--robot-radius", "-1", "--out", out)
    assert code == 2
    assert "--robot-radius must be a number of at least 0" in error


def test_a_robot_that_fits_nowhere_is_said_to(map_yaml: Path, run: Run) -> None:
    out = map_yaml.parent / "out"
    code, text, error = run(
        "label", map_yaml, "--model", "generated", "--robot-radius", 25, "--out", out
    )
    assert code == 0
    assert "places: 0 corridors" in text
    assert "warning: no place is left: a disc with a radius of 25 m fits into none" in error
    [warning] = json.loads((out / "details/summary.json").read_text())["warnings"]
    assert warning in error


@pytest.mark.parametrize(
    ("line", "former"), [("label map.yaml", "--disc-radius"), ("simulate map.yaml", "--radius")]
)
def test_former_names_of_the_robots_radius_are_read(
    line: str, former: str, capsys: pytest.CaptureFixture[str]
) -> None:
    name, map_name = line.split()
    words = [map_name, "--out", "out"]
    command = {"label": label, "simulate": simulate}[name]
    new = Command(name, command).values([*words, "--robot-radius", "0.3"])
    assert capsys.readouterr().err == ""
    assert Command(name, command).values([*words, f"{former}=0.3"]) == new
    [told] = capsys.readouterr().err.splitlines()
    assert told.startswith(f"{former} is now --robot-radius; ")
    with pytest.raises(InputError, match=r"there is no option --radius\."):
        Command("export", export).values(["places", "--to", "nav2", "--radius", "0.3"])
