"""Tables of strangers: what a field, a line and a table may hold."""

from pathlib import Path

import pytest

from pgm_places.errors import LogError
from pgm_places.io.csv_table import open_table


def read(tmp_path: Path, text: str, **limit: int) -> tuple[list[list[float]], list[list[str]]]:
    (tmp_path / "a.csv").write_bytes(text.encode())
    with open_table(tmp_path / "a.csv", LogError, "a table", max_bytes=10_000_000) as table:
        numbers, texts = table.read([1, 0], [2], **limit)
    return numbers.tolist(), texts


@pytest.mark.parametrize("end", ["\n", "\r\n", "\r"])
def test_columns_are_taken_in_the_wanted_order(tmp_path: Path, end: str) -> None:
    rows = ["\ufeff a , b,c", "1,-2e-1,x", "", '3,+.5,"y, z"', "5,6,x"]
    numbers, texts = read(tmp_path, end.join(rows))
    assert numbers == [[-0.2, 1], [0.5, 3], [6, 5]]
    assert texts == [["x", "y, z", "x"]]


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "is empty"),
        ("a,b,a\n", "the column 'a' appears twice"),
        (",".join(map(str, range(100_000))), "has 100000 columns, more than the 10000 allowed"),
        ("a,b," + "c" * 5000, "a column name of 5000 characters, more than the 200 allowed"),
        ("a,b,c\n" + "1" * 200_000 + ",2,3\n", "field larger than field limit"),
        ("a,b,c\n" + "1" * 2_000_000, "a line of more than"),
        ("a,b,c\n1,2\n", "row 1 after the header: 2 fields, but there are 3 columns"),
        ("a,b,c\n1,2,3\n1_000,2,3\n", "row 2 after the header: a must be a finite number"),
        ("a,b,c\n1,1e400,3\n", "b must be a finite number, got '1e400'"),
        ("a,b,c\n1,\u0661,3\n", "b must be a finite number"),
        ("a,b,c\n1,\0,3\n", "b must be a finite number"),
        ('a,b,c\n1,2,"3\n', "is not a table of comma-separated values"),
    ],
)
def test_the_rest_is_one_message(tmp_path: Path, text: str, message: str) -> None:
    with pytest.raises(LogError) as caught:
        read(tmp_path, text)
    assert message in str(caught.value)
    assert len(str(caught.value)) < 400


def test_the_number_of_values_is_limited(tmp_path: Path) -> None:
    assert len(read(tmp_path, "a,b,c\n" + "1,2,3\n" * 2, _max_values=6)[0]) == 2
    with pytest.raises(LogError, match="row 3 after the header: more than 6 values; split"):
        read(tmp_path, "a,b,c\n" + "1,2,3\n" * 3, _max_values=6)
