import pytest

from experiments.feature_tables import DOCS, SPACES, TABLES, laser_table, updated_page
from pgm_places.features.laser import LASER_FEATURES


@pytest.mark.parametrize("name", TABLES)
def test_the_manuals_tables_are_up_to_date(name: str) -> None:
    text = (DOCS / name).read_text(encoding="utf-8")
    assert updated_page(name, text) == text, "run: python -m experiments.feature_tables"


def test_every_family_and_column_is_in_the_table() -> None:
    rows = [row.split(" | ") for row in laser_table().splitlines()[2:]]
    assert {row[1] for row in rows} == {spec.id for spec in LASER_FEATURES}
    spans = [[int(end) for end in row[0].removeprefix("| ").split("–")] for row in rows]
    covered = [column for span in spans for column in range(span[0], span[-1] + 1)]
    assert covered == list(range(321))


@pytest.mark.parametrize("table", SPACES)
def test_names_are_unique(table: str) -> None:
    ids = [spec.id for spec in SPACES[table]]
    assert len(set(ids)) == len(ids)


def test_a_page_is_rewritten_between_the_marks_only() -> None:
    page = "before\n<!-- table: laser -->\nold\n<!-- end of table -->\nafter\n"
    text = updated_page("features.md", page)
    assert text.startswith("before\n") and text.endswith("\nafter\n")
    assert "old" not in text and "f16" in text


def test_a_page_without_marks_is_refused() -> None:
    with pytest.raises(ValueError, match="must hold the marks"):
        updated_page("features.md", "nothing")
