"""YAML scalars as yaml-cpp reads them, and the refusals."""

import math
import re
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
import yaml

from pgm_places.errors import MapError
from pgm_places.io.strict_yaml import YamlFile, read_yaml


def read(folder: Path, text: str) -> YamlFile:
    path = folder / "x.yaml"
    path.write_text(text, encoding="utf-8")
    return read_yaml(path, MapError, "map description")


@pytest.mark.parametrize(
    ("text", "number"),
    [
        *(("5e-2", 0.05), ("0.050000", 0.05), ("'0.05'", 0.05), (".5", 0.5), ("1.", 1.0)),
        *(("010", 10.0), ("+1E1", 10.0), ("-46.575", -46.575), ("1   # metres", 1.0)),
    ],
)
def test_numbers(tmp_path: Path, text: str, number: float) -> None:
    assert read(tmp_path, f"key: {text}\n").number("key") == number


@pytest.mark.parametrize(
    ("text", "flag"),
    [
        *(("0", False), ("1", True), ("2", True), ("00", False), ("0x0", False), ("010", True)),
        *(("true", True), ("False", False), ("yes", True), ("no", False), ("on", True)),
    ],
)
def test_flags(tmp_path: Path, text: str, flag: bool) -> None:
    assert read(tmp_path, f"key: {text}\n").flag("key") is flag


@pytest.mark.parametrize("text", ["nan", "-nan", ".nan", ".NaN", "+NAN"])
def test_nan_is_read_where_it_is_allowed(tmp_path: Path, text: str) -> None:
    file = read(tmp_path, f"key: {text}\n")
    assert math.isnan(file.as_number(file.value("key"), "key", allow_nan=True))


VALUES: dict[str, Callable[[YamlFile], object]] = {
    "must be a finite decimal number such as 0.05": lambda file: file.number("key"),
    "must be 0, 1, true or false": lambda file: file.flag("key"),
    "key must be a whole number from 0 to 255, got": lambda file: file.as_integer(
        file.value("key"), "key", low=0, high=255
    ),
    "key 'key' must be non-empty text": lambda file: file.text("key"),
    "key 'kex' is missing. Did you mean 'key'?": lambda file: file.number("kex"),
}
REFUSED = (
    *("no|0x10|1_000|1:30|nan|.nan|.inf|1e999|1,5||[1]|5 m", "0.0|maybe|[0]|"),
    *("3.0|256|-1|0x1|[1]|1111111111111111111111111111111111111111", "", "1"),
)


@pytest.mark.parametrize(
    ("message", "text"),
    [(m, text) for m, texts in zip(VALUES, REFUSED, strict=True) for text in texts.split("|")],
)
def test_values_of_another_kind_are_refused(tmp_path: Path, message: str, text: str) -> None:
    file = read(tmp_path, f"key: {text}\n")
    with pytest.raises(MapError, match=re.escape(message)):
        VALUES[message](file)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("a: [1\n", "not a YAML file: while parsing"),
        ("- a\n- b\n", "the map description must be a mapping of keys to values"),
        ("", "the map description must be a mapping"),
        ("a: 1\nb: 2\na: 3\n", "key 'a' appears twice (line 3); keep one"),
        ("a: &x [1]\nb: *x\n", "anchors and aliases (& and *) are not supported"),
        ("a: " + "[" * 20 + "]" * 20, "nested deeper than 16 levels"),
        ("a: " + "[" * 1500 + "]" * 1500, "nested deeper than 16 levels"),
        ("? [a]\n: 1\n", "a key must be text, got ['a']"),
        ("a: 1\n--- \nb: 1\n", "a second document begins in line 2; keep one"),
        ("a: &x 1\nb: *x\n", "anchors and aliases (& and *) are not supported"),
        ("a: " + "x" * 300_000, "larger than 262144 bytes; expected the map description (YAML)"),
    ],
)
def test_bad_files_are_refused(tmp_path: Path, text: str, message: str) -> None:
    with pytest.raises(MapError) as caught:
        read(tmp_path, text)
    assert str(caught.value).startswith(f"{tmp_path / 'x.yaml'}: ")
    assert message in str(caught.value)


@pytest.mark.parametrize("parser", ["CBaseLoader", "BaseLoader"])
@pytest.mark.parametrize("text", ["[" * 100_000, "a: " + "{b: " * 50_000, "&x [*x," * 20_000])
def test_what_lies_behind_the_limits_is_not_parsed(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, text: str, parser: str
) -> None:
    events = yaml.parse(text, getattr(yaml, parser))
    parsed = []

    def counted(*_: object) -> Iterator[object]:
        for event in events:
            parsed.append(event)
            yield event

    monkeypatch.setattr(yaml, "parse", counted)
    with pytest.raises(MapError, match=r"nested deeper than 16 levels|anchors and aliases"):
        read(tmp_path, text)
    assert len(parsed) < 50


def test_the_parser_in_python_reads_the_same_and_obeys_no_tags(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    text = "a: [1, {b: 'x y', c: }]\n'd e': >\n  folded\n  text\nf: !!int '7'\n"
    text += "g: !!python/object/apply:os.system ['exit 1']\n"
    first = read(tmp_path, text).values
    monkeypatch.delattr(yaml, "CBaseLoader", raising=False)
    assert read(tmp_path, text).values == first
    assert first == {
        "a": ["1", {"b": "x y", "c": ""}],
        "d e": "folded text\n",
        "f": "7",
        "g": ["exit 1"],
    }
