"""What a batch says of a map after one of its places has a new name, or its origin was edited."""

import csv
import json
from pathlib import Path

import pytest

from pgm_places.batch.found_maps import find_maps
from pgm_places.batch.label_batch import label_batch
from pgm_places.cli.places import rename
from pgm_places.labelling.options import LabelOptions
from pgm_places.progress import Silent
from tests.batch.shared import InProcessWorkers


def label(maps: Path, model: Path) -> Path:
    """The maps as a batch labels them: the folder of one of them."""
    out = maps.parent / "out"
    options = LabelOptions(model=str(model))
    label_batch(find_maps([str(maps)], out), out, options, InProcessWorkers(), progress=Silent())
    return out / "floor1" / "map"


def row_of(folder: Path) -> dict[str, str]:
    with (folder.parent.parent / "summary.csv").open(newline="") as file:
        return next(row for row in csv.DictReader(file) if row["name"] == "floor1/map")


def test_the_index_names_the_place_to_check_first_by_its_new_name(maps: Path, model: Path) -> None:
    folder = label(maps, model)
    before, others = row_of(folder), (folder.parent.parent / "failures.csv").read_text()
    first = before["check_first"]
    assert first
    rename(folder, first, "workshop")
    after = row_of(folder)
    assert after == before | {"check_first": "workshop", "time": after["time"]}
    page = (folder.parent.parent / "index.html").read_text()
    assert "workshop" in page
    assert (folder.parent.parent / "failures.csv").read_text() == others
    rename(folder, "workshop", "lab")
    assert row_of(folder)["check_first"] == "lab"


def test_a_list_that_cannot_be_written_is_said_and_the_name_stays_new(
    maps: Path, model: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    folder = label(maps, model)
    first = row_of(folder)["check_first"]
    (folder.parent.parent / "summary.csv").write_text("a,b\n1,2\n")
    rename(folder, first, "workshop")
    assert "summary.csv: not a table of labelled maps" in capsys.readouterr().err
    assert "workshop" in (folder / "places.json").read_text()


def test_the_record_of_a_map_holds_the_line_about_its_edited_origin(
    maps: Path, model: Path
) -> None:
    folder = label(maps, model)
    path = maps / "floor1" / "map.yaml"
    lines = path.read_text().splitlines()
    path.write_text(
        "\n".join("origin: [50, -7, 0]" if line.startswith("origin") else line for line in lines)
    )
    label(maps, model)
    record = json.loads((folder / "details" / "summary.json").read_text())
    assert any("(50, -7) m" in line and "keep their ids" in line for line in record["warnings"])
