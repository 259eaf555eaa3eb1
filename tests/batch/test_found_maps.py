"""Arguments name files, folders and patterns; every map is found once, under a name of its own."""

from pathlib import Path

import pytest

from pgm_places.batch.found_maps import find_maps
from pgm_places.errors import MapError


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    for name in (
        "floors/a/map.yaml",
        "floors/b/map.yaml",
        "floors/b/annex.yaml",
        "floors/deep/er/hall.yml",
        "floors/.hidden/map.yaml",
        "results/a/keepout.yaml",
    ):
        path = tmp_path / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text("image: map.png\n")
    (tmp_path / "floors" / "b" / "labels.yaml").write_text("values: {image: 1}\n")
    return tmp_path


def names(folder: Path, *arguments: str) -> list[str]:
    found = find_maps([str(folder / item) for item in arguments], folder / "results")
    assert all(item.path.is_absolute() and item.path.exists() for item in found.maps)
    return [item.name for item in found.maps]


def test_a_folder_is_looked_through(folder: Path) -> None:
    found = find_maps([str(folder)], folder / "results")
    assert [item.name for item in found.maps] == ["a", "annex", "b", "hall"]
    assert found.n_passed_over == 1


def test_a_pattern_is_filled_in(folder: Path) -> None:
    assert names(folder, "floors/*/map.yaml") == ["a", "b"]
    assert names(folder, "floors/**/*.y*ml") == ["a", "annex", "b", "hall"]


def test_a_file_is_taken_as_it_is_and_each_map_once(folder: Path) -> None:
    assert names(folder, "floors/b/labels.yaml", "floors/b", "floors/b/map.yaml") == [
        "annex",
        "b",
        "labels",
    ]


def test_maps_of_one_name_are_told_apart_by_their_folders(tmp_path: Path) -> None:
    paths = [
        tmp_path / name
        for name in ("north/one/map.yaml", "south/ONE.yaml", "two/map.yaml", "two.yaml")
    ]
    for path in paths:
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text("image: map.png\n")
    found = find_maps([str(path) for path in paths], tmp_path / "out")
    assert {item.name: item.path for item in found.maps} == {
        "north-one": paths[0],
        "south-ONE": paths[1],
        "two": paths[2],
        "two-2": paths[3],
    }


@pytest.mark.parametrize("argument", ["empty", "floors/*/none.yaml"])
def test_nothing_found_is_an_error(folder: Path, argument: str) -> None:
    (folder / "empty").mkdir()
    with pytest.raises(MapError, match="no map in it: none of 0 YAML files has a key 'image'"):
        names(folder, argument)
