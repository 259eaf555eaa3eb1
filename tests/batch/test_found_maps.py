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
    assert [item.name for item in found.maps] == [
        "floors/a/map",
        "floors/b/annex",
        "floors/b/map",
        "floors/deep/er/hall.yml",
    ]
    assert found.root == folder
    assert found.n_passed_over == 1


@pytest.mark.parametrize(
    ("arguments", "found"),
    [
        (["floors/*/map.yaml"], ["a/map", "b/map"]),
        (["floors/**/*.y*ml"], ["a/map", "b/annex", "b/map", "deep/er/hall.yml"]),
        (["floors/b/labels.yaml", "floors/b", "floors/b/map.yaml"], ["annex", "labels", "map"]),
    ],
)
def test_patterns_are_filled_in_files_taken_as_they_are_and_each_map_once(
    folder: Path, arguments: list[str], found: list[str]
) -> None:
    assert names(folder, *arguments) == found


def test_adding_a_map_renames_none(tmp_path: Path) -> None:
    def found() -> dict[str, Path]:
        return {item.name: item.path for item in find_maps([str(tmp_path)]).maps}

    before: dict[str, Path] = {}
    for name in ("north/one/map.yaml", "south/ONE.yaml", "two/map.yaml", "two.yaml", "two.yml"):
        path = tmp_path / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text("image: map.png\n")
        now = found()
        assert len(now) == len(before) + 1
        assert before.items() < now.items()
        before = now
    assert set(now) == {"north/one/map", "south/ONE", "two/map", "two", "two.yml"}


def test_names_start_from_the_root_that_is_given(folder: Path) -> None:
    found = find_maps([str(folder / "floors" / "b")], root=folder)
    assert [item.name for item in found.maps] == ["floors/b/annex", "floors/b/map"]
    with pytest.raises(MapError, match=r"map.yaml: outside .*floors/b, .*use another --out"):
        find_maps([str(folder / "floors")], root=folder / "floors" / "b")


def test_names_do_not_hide_nor_leave_the_folder(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    for name in (".site/.map.yaml", "hall.yaml"):
        (tmp_path / name).parent.mkdir(exist_ok=True)
        (tmp_path / name).write_text("image: map.png\n")
    monkeypatch.chdir(tmp_path / ".site")
    found = find_maps([".map.yaml", "../hall.yaml"])
    assert [item.name for item in found.maps] == ["-.site/-.map", "hall"]


@pytest.mark.parametrize("argument", ["empty", "floors/*/none.yaml"])
def test_nothing_found_is_an_error(folder: Path, argument: str) -> None:
    (folder / "empty").mkdir()
    with pytest.raises(MapError, match="no map found: none of 0 YAML files has a key 'image'"):
        names(folder, argument)
