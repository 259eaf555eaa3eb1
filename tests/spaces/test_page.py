from pathlib import Path

import pytest

from pgm_places.errors import InputError
from pgm_places.spaces.page import TABLES, main, updated_page

PAGE = Path(__file__).resolve().parents[2] / "docs" / "spaces.md"


def test_the_manuals_tables_are_up_to_date() -> None:
    text = PAGE.read_text(encoding="utf-8")
    assert updated_page(text) == text, "run: python -m pgm_places.spaces.page docs/spaces.md"


@pytest.mark.parametrize("table", TABLES)
def test_names_are_unique(table: str) -> None:
    ids = [spec.id for spec in TABLES[table]]
    assert len(set(ids)) == len(ids)


def test_a_page_without_marks_is_refused() -> None:
    with pytest.raises(InputError, match="marks"):
        updated_page("nothing")


def test_a_page_must_be_named() -> None:
    with pytest.raises(InputError, match="one page"):
        main([])
