from collections import Counter
from importlib import import_module
from pathlib import Path

import pytest

from experiments import feature_tables
from experiments.page_tables import (
    Mark,
    SideBySide,
    marks,
    parsed_tables,
    with_table,
    write_table,
)
from experiments.paper.section import Table

MARKS = list(marks())
PAGE = (
    "before\n<!-- table: times, by python -m benchmarks times -->\nold\n"
    "<!-- end of table -->\nafter\n"
)
LONG = Table(
    "",
    ("map", "method", "accuracy", "balanced"),
    (
        ("one", "list", "97.7", "87.3"),
        ("one", "potts", "98.4", "89.5"),
        ("two", "list", "95", "80"),
    ),
)


@pytest.mark.parametrize("mark", MARKS, ids=lambda mark: mark.name)
def test_the_command_of_every_table_exists_and_writes_it(mark: Mark) -> None:
    module = import_module(mark.module)
    if hasattr(module, "__path__"):
        module = import_module(f"{mark.module}.__main__")
    if module is not feature_tables:  # which takes no arguments
        module.parser().parse_args(mark.arguments)
    assert mark.name in module.TABLES


def test_every_table_has_its_place_once() -> None:
    written = Counter(mark.name for mark in MARKS)
    assert set(written.values()) == {1}
    modules = {mark.module for mark in MARKS}
    for name in modules:
        module = import_module(name)
        module = import_module(f"{name}.__main__") if hasattr(module, "__path__") else module
        assert set(module.TABLES) <= set(written)


def test_a_table_is_rewritten_between_its_marks_only() -> None:
    text = with_table(PAGE, "times", "| a |\n|---|\n| 1 |\n")
    assert text.startswith("before\n<!-- table: times, by python -m benchmarks times -->\n\n| a |")
    assert text.endswith("| 1 |\n\n<!-- end of table -->\nafter\n")
    assert with_table(text, "times", "| a |\n|---|\n| 1 |\n") == text


def test_a_page_without_marks_is_refused(tmp_path: Path) -> None:
    with pytest.raises(ValueError, match="lacks the marks '<!-- table: others, by"):
        with_table(PAGE, "others", "")
    with pytest.raises(ValueError, match="lacks the marks"):
        with_table(PAGE.replace("<!-- end of table -->", ""), "times", "")
    with pytest.raises(SystemExit, match=r"no page of .* has the mark"):
        write_table("others", "", tmp_path / "missing")


def test_the_page_that_has_the_mark_is_written(tmp_path: Path) -> None:
    (tmp_path / "a.md").write_text("no table\n")
    (tmp_path / "b.md").write_text(PAGE)
    assert write_table("times", "new", tmp_path) == tmp_path / "b.md"
    assert "new" in (tmp_path / "b.md").read_text()
    assert "old" not in (tmp_path / "b.md").read_text()


def test_columns_come_to_stand_side_by_side() -> None:
    found = SideBySide(("method",), "{map}", "{accuracy} / {balanced}").of(LONG)
    assert found.heading == ("method", "one", "two")
    assert found.rows == (("list", "97.7 / 87.3", "95 / 80"), ("potts", "98.4 / 89.5", "-"))


def test_an_entry_may_have_others_beside_it() -> None:
    found = SideBySide(("method",), "{map}", "{accuracy}", {"mean": "{balanced}"}).of(LONG)
    assert found.heading == ("method", "one", "one: mean", "two", "two: mean")
    assert found.rows[0] == ("list", "97.7", "87.3", "95", "80")
    assert found.rows[1] == ("potts", "98.4", "89.5", "-", "-")
    assert not SideBySide(("method",), "{map}", "{accuracy}", {"s": "{s}"}).fits(LONG.heading)


def test_a_table_without_the_columns_does_not_fit() -> None:
    assert SideBySide(("method",), "{map}", "{accuracy}").fits(LONG.heading)
    assert not SideBySide(("method",), "{map}", "{seconds}").fits(LONG.heading)


def test_tables_are_read_back() -> None:
    [first, second] = parsed_tables(
        "text\n\n| a | b |\n|---|---|\n| 1 | 2 |\n\n| c |\n|---|\n| 3 |\n"
    )
    assert (first.heading, first.rows) == (("a", "b"), (("1", "2"),))
    assert (second.heading, second.rows) == (("c",), (("3",),))
