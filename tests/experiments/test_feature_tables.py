import pytest

from experiments.feature_tables import SPACES, TABLES, laser_table
from experiments.page_tables import marks, with_table
from pgm_places.features.laser import LASER_FEATURES


@pytest.mark.parametrize("name", TABLES)
def test_the_manuals_tables_are_up_to_date(name: str) -> None:
    [page] = [mark.page for mark in marks() if mark.name == name]
    text = page.read_text(encoding="utf-8")
    assert with_table(text, name, TABLES[name]()) == text, (
        "run: python -m experiments.feature_tables"
    )


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
