from pathlib import Path

import pytest

from pgm_places.errors import InputError
from pgm_places.features.laser import LASER_FEATURES
from pgm_places.features.page import END, START, feature_table, main, updated_page

PAGE = Path(__file__).resolve().parents[2] / "docs" / "features.md"


def test_the_manuals_table_is_up_to_date() -> None:
    text = PAGE.read_text(encoding="utf-8")
    assert updated_page(text) == text, "run: python -m pgm_places.features.page docs/features.md"


def test_every_family_and_column_is_in_the_table() -> None:
    rows = [row.split(" | ") for row in feature_table().splitlines()[2:]]
    assert {row[1] for row in rows} == {spec.id for spec in LASER_FEATURES}
    spans = [[int(end) for end in row[0].removeprefix("| ").split("–")] for row in rows]
    covered = [column for span in spans for column in range(span[0], span[-1] + 1)]
    assert covered == list(range(321))


def test_a_page_is_rewritten_between_the_marks_only(tmp_path: Path) -> None:
    page = tmp_path / "page.md"
    page.write_text(f"before\n{START}\nold\n{END}\nafter\n", encoding="utf-8")
    main([str(page)])
    text = page.read_text(encoding="utf-8")
    assert text.startswith("before\n") and text.endswith("\nafter\n")
    assert "old" not in text and "f16" in text


def test_a_page_without_marks_is_refused() -> None:
    with pytest.raises(InputError, match="marks"):
        updated_page("nothing")


def test_a_page_must_be_named() -> None:
    with pytest.raises(InputError, match="one page"):
        main([])
