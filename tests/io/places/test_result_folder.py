"""Folders of a labelled map that earlier versions wrote are read, and completed, like new ones."""

import json
import shutil
from pathlib import Path

import numpy as np
import pytest

from pgm_places.batch.map_task import labelled_row
from pgm_places.io.maps.map_server import save_map
from pgm_places.io.output_set import is_as_written, written_names
from pgm_places.io.places.place_settings import load_settings
from pgm_places.io.places.topology_files import load_topology
from pgm_places.labelling.files import labelled_map
from pgm_places.persistence.map_prior import read_labelled_map
from pgm_places.persistence.stored import save
from pgm_places.simulation import generate_building
from tests.cli.conftest import Run, run
from tests.drives import building
from tests.quick_labeler import places

__all__ = ["run"]


def as_before(folder: Path) -> None:
    """The folder as earlier versions left it: all files side by side, under the earlier names."""
    record = json.loads((folder / ".pgm-places.json").read_text())
    files = record["files"]
    moves = {"places.json": "topology.json", "details/settings.json": "places.json"}
    moves |= {name: name.removeprefix("details/") for name in files if name.startswith("details/")}
    moves["details/settings.json"] = "places.json"
    for old, new in moves.items():
        (folder / old).rename(folder / new)
    record["files"] = {moves.get(name, name): entry for name, entry in files.items()}
    (folder / ".pgm-places.json").write_text(json.dumps(record))
    (folder / "details").rmdir()


@pytest.fixture
def new(tmp_path: Path, run: Run) -> Path:
    save_map(generate_building(5, size="small", resolution_m=0.1).grid, tmp_path / "map")
    save(places(), tmp_path / "model")
    words = ("label", tmp_path / "map.yaml", "-m", tmp_path / "model", "--jobs", 1, "-q")
    code, _, error = run(*words, "-o", tmp_path / "out")
    assert code == 0, error
    return tmp_path / "out" / "map"


@pytest.fixture
def old(new: Path) -> Path:
    folder = shutil.copytree(new.parent, new.parent.with_name("before")) / "map"
    as_before(folder)
    return folder


def test_an_earlier_folder_is_read_like_a_new_one(new: Path, old: Path, run: Run) -> None:
    before, after = load_topology(new), load_topology(old)
    np.testing.assert_array_equal(after.region, before.region)
    assert [place.name for place in after.regions] == [place.name for place in before.regions]
    first, second = load_settings(new), load_settings(old)
    assert first is not None and second is not None and first.rules == second.rules
    assert (first.doorways is None) == (second.doorways is None)
    assert labelled_map(old) is not None and labelled_map(old) == labelled_map(new)
    assert labelled_row(old, "map") is not None
    assert labelled_row(old, "map") == labelled_row(new, "map")
    _, names = building()
    positions = [place.anchor_m for place in before.regions]
    shares = read_labelled_map(new, names).prior.at(positions)
    assert (shares != 0.9).any()  # the images are read, not labels alone
    np.testing.assert_array_equal(read_labelled_map(old, names).prior.at(positions), shares)
    assert run("index", old.parent, "-q")[0] == 0
    assert 'src="map/thumbnail.png"' in (old.parent / "index.html").read_text()
    assert run("index", new.parent, "-q")[0] == 0
    assert 'src="map/details/thumbnail.png"' in (new.parent / "index.html").read_text()


def test_a_change_by_hand_brings_an_earlier_folder_to_the_new_names(old: Path, run: Run) -> None:
    settings = load_settings(old)
    first = next(item for item in load_topology(old).connections)
    assert run("merge", old, first.first, first.second)[0] == 0
    assert not (old / "topology.json").exists() and is_as_written(old / "places.json")
    kept = load_settings(old)
    assert kept is not None and settings is not None and kept.rules == settings.rules
    assert "topology.json" not in written_names(old)


def test_labels_in_an_earlier_folder_give_the_same_places_there(
    new: Path, old: Path, run: Run
) -> None:
    before = load_topology(new)
    map_yaml = labelled_map(old)
    assert run("topology", old / "labels.png", map_yaml, "-o", old, "-q")[0] == 0
    after = load_topology(old)
    np.testing.assert_array_equal(after.region, before.region)
    assert {path.name for path in old.iterdir()}.isdisjoint({"topology.json", "gate_places.png"})
