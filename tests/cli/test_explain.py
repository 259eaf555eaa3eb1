"""``pgm-places explain``: what it says agrees with ``label``, and what it refuses."""

import json
import re
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from pgm_places.io.maps.label_image import load_labels
from pgm_places.io.maps.map_server import load_map
from pgm_places.teaching.paint import Paint
from tests.cli.conftest import Run

NAMES = ("corridor", "room", "doorway")
HOLDS = "space between gates that holds most of"
NUMBER = r"[+-]\d+\.\d\d"


def test_the_label_its_parts_and_its_place_are_those_that_label_gives(
    tmp_path: Path, run: Run, building: Path
) -> None:
    grid = load_map(building / "map.yaml").grid
    code, _, err = run("label", building / "map.yaml", "--out", tmp_path / "out", "--quiet")
    assert code == 0, err
    labels = load_labels(tmp_path / "out" / "labels.png", NAMES, grid=grid)
    regions = json.loads((tmp_path / "out" / "places.json").read_text())["regions"]
    for name in NAMES:
        place = next(item for item in regions if item["label"] == name)
        x, y = place["anchor_m"]
        [[row, column]] = grid.cells_at_m(np.array([[x, y]])).tolist()
        picture = tmp_path / f"{name}.png"
        code, out, err = run("explain", building / "map.yaml", x, y, "--out", picture, "--quiet")
        assert code == 0, err
        first, after, before, *rest = out.splitlines()
        at, _, what = first.partition("), ")
        assert what.startswith(f"{place['name']}: {name}")
        cell = [float(number) for number in at.removeprefix("(").split(", ")]
        assert cell == pytest.approx([x, y], abs=0.035)  # the centre of a cell of the model
        assert NAMES[labels[row, column]] == name
        assert max(shares(after), key=shares(after).__getitem__) == name
        for line in (after, before):
            assert sum(shares(line).values()) == pytest.approx(100, abs=0.2)
        assert after.startswith("after the graph: ") and before.startswith("before the graph: ")
        for line in [line for line in rest if "? log-odds " in line]:
            whole, *parts = [float(number) for number in re.findall(NUMBER, line)]
            assert whole == pytest.approx(sum(parts), abs=0.021)  # each is rounded
        assert any(line.startswith(f"{HOLDS} {place['name']}: ") for line in rest)
        assert any("log-odds" in line for line in rest)
        assert rest[-1] == f"wrote {picture}"
        with Image.open(picture) as image:
            assert image.format == "PNG" and image.width > 1000


def shares(line: str) -> dict[str, float]:
    """The percentages of a line by label."""
    found = re.findall(r"(\w+) (\d+\.\d) %", line)
    assert sorted(name for name, _ in found) == sorted(NAMES)
    return {name: float(value) for name, value in found}


def test_paint_is_explained_as_such(tmp_path: Path, run: Run, building: Path) -> None:
    grid = load_map(building / "map.yaml").grid
    cells = np.argwhere(grid.free)[:40]
    path = (
        Paint.blank(grid.shape, NAMES)
        .with_cells(cells, "doorway")
        .save(tmp_path / "paint.png", grid)
    )
    [[x, y]] = grid.cell_centres_m(cells[:1]).tolist()
    code, out, err = run("explain", building / "map.yaml", x, y, "--corrections", path, "--quiet")
    assert code == 0, err
    assert ": doorway (painted)" in out.splitlines()[0]
    assert shares(out.splitlines()[1]) == {"corridor": 0.0, "room": 0.0, "doorway": 100.0}


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("nan", 1), "X must be a finite number, got nan"),
        ((-1000, -1000), "there is no free cell at (-1000, -1000)"),
        ((1, 1, "--method", "amn"), "no method 'amn'"),
        ((1, 1, "--model", "nowhere"), "no model at nowhere"),
    ],
)
def test_what_cannot_be_explained_is_refused_in_one_line(
    arguments: tuple[object, ...], message: str, tmp_path: Path, run: Run, building: Path
) -> None:
    picture = tmp_path / "why.png"
    command = ("explain", building / "map.yaml", *arguments, "--out", picture, "--quiet")
    code, out, err = run(*command)
    assert (code, out) == (2, "")
    *before, refused = err.strip().splitlines()
    assert message in refused and all(line.startswith("warning: ") for line in before)
    assert not picture.exists()
