"""A table that names many maps becomes one per map, with its labels and its building."""

from pathlib import Path
from typing import Any

import pytest

from pgm_places.errors import ConfigError
from pgm_places.experiment.source_patterns import without_patterns


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    for name in ("north/a", "north/b", "south/c"):
        (tmp_path / "floors" / name).mkdir(parents=True)
        (tmp_path / "floors" / name / "map.yaml").touch()
    (tmp_path / "buildings.csv").write_text(
        "map,building\na,one\nfloors/north/b/map.yaml,one\nc,two\n"
    )
    return tmp_path


def train(folder: Path, **table: Any) -> list[dict[str, Any]]:
    return list(without_patterns({"train": [table]}, folder, "config.toml")["train"])


def test_labels_follow_the_map(folder: Path) -> None:
    found = train(folder, map="floors/*/*/map.yaml", labels="drawn/*-*.png", compat="ros1")
    assert found == [
        {"map": f"floors/{site}/{name}/map.yaml", "labels": f"drawn/{site}-{name}.png"}
        | {"compat": "ros1"}
        for site, name in (("north", "a"), ("north", "b"), ("south", "c"))
    ]


def test_any_depth(folder: Path) -> None:
    found = train(folder, map="floors/**/map.yaml", regions="floors/**/truth.geojson")
    assert [item["regions"] for item in found] == [
        f"floors/{name}/truth.geojson" for name in ("north/a", "north/b", "south/c")
    ]


def test_characters(folder: Path) -> None:
    found = train(folder, map="floors/north/[!a]/map.yaml", labels="floors/north/[!a]/labels.png")
    assert [item["labels"] for item in found] == ["floors/north/b/labels.png"]


@pytest.mark.parametrize("name", ["a[b.yaml", "a[!]b.yaml", "a[]b.yaml", "[", "]a["])
def test_a_bracket_that_is_not_closed_is_part_of_a_name(folder: Path, name: str) -> None:
    assert train(folder, map=name) == [{"map": name}]


@pytest.mark.parametrize(
    ("pattern", "matched"),
    [
        ("[\\\\]", "\\"),
        ("[^]", "^"),
        ("[[x]", "["),
        ("[a&&b]", "&"),
        ("[!0-9&[^~|\\\\]", "]"),
        ("*[z-a0]", None),
    ],
)
def test_any_character_may_stand_between_brackets(
    folder: Path, pattern: str, matched: str | None
) -> None:
    for name in "\\^[]&0":
        (folder / name).touch()
    if matched is None:
        with pytest.raises(ConfigError, match="cannot tell what the wildcards of"):
            train(folder, map=pattern, labels=pattern)
    else:
        assert train(folder, map=pattern, labels=f"drawn/{pattern}") == [
            {"map": matched, "labels": f"drawn/{matched}"}
        ]


def test_a_variable_names_the_folder(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("FLOORS", str(folder / "floors"))
    found = train(folder, map="$FLOORS/north/*/map.yaml", labels="$FLOORS/north/*/labels.png")
    assert [item["map"] for item in found] == [f"$FLOORS/north/{x}/map.yaml" for x in "ab"]


def test_buildings_are_looked_up_by_name_or_path(folder: Path) -> None:
    found = train(folder, map="floors/*/*/map.yaml", labels="*/*.png", buildings="buildings.csv")
    assert [item["building"] for item in found] == ["one", "one", "two"]
    assert not any("buildings" in item for item in found)
    [one] = train(folder, map="floors/south/c/map.yaml", buildings="buildings.csv")
    assert one["building"] == "two"


def test_other_tables_stay_as_they_are(folder: Path) -> None:
    content = {"train": [{"generated": 1}, {"map": "x.yaml"}, 5], "title": "t", "test": "no"}
    assert without_patterns(content, folder, "config.toml") == content


@pytest.mark.parametrize(
    ("table", "message"),
    [
        ({"map": "floors/*/none.yaml"}, r"train\[0\]: no file matches map = 'floors/\*/none.yaml'"),
        (
            {"map": "floors/*/*/map.yaml", "labels": "labels.png"},
            r"map has 2 wildcards .*, so labels must have the same number",
        ),
        ({"map": "floors/*/*/map.yaml", "name": "floor"}, "name is for one map"),
        (
            {"map": "floors/*/*/map.yaml", "buildings": "buildings.csv", "building": "x"},
            "building and buildings",
        ),
        ({"map": "floors/*/*/map.yaml", "buildings": "few.csv"}, "no building of .*/b/map.yaml"),
        ({"map": "floors/*/*/map.yaml", "buildings": "none.csv"}, "none.csv: no such file"),
        ({"map": "floors/*/*/map.yaml", "buildings": "other.csv"}, "expected the columns map and"),
        ({"map": "floors/*/*/map.yaml", "buildings": "twice.csv"}, "a is in two buildings"),
    ],
)
def test_what_does_not_fit_is_one_line(folder: Path, table: dict[str, str], message: str) -> None:
    (folder / "few.csv").write_text("name,building\na,one\nc,two\n")
    (folder / "other.csv").write_text("floor_name,house\na,one\n")
    (folder / "twice.csv").write_text("map,building\na,one\na,two\n")
    with pytest.raises(ConfigError, match=message):
        train(folder, **table)
