"""JSON of strangers: numbers that fit, and no depth that ends in a traceback."""

from pathlib import Path

import pytest

from pgm_places.errors import LogError
from pgm_places.io.input_file import read_json


def test_plain_data_come_as_they_are(tmp_path: Path) -> None:
    (tmp_path / "a.json").write_text('\ufeff{"a": [1, -2.5e3, true, null, "x"]}')
    found = read_json(tmp_path / "a.json", LogError, "data", max_bytes=100)
    assert found == {"a": [1, -2500.0, True, None, "x"]}


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("{", "not a JSON file"),
        ("1" + 400 * "0", "an integer has 401 digits; at most 18 are read"),
        ("-" + 5000 * "1", "an integer has 5001 digits"),
        ("1e400", "1e400 is out of range"),
        ("NaN", "NaN is not a JSON number"),
        ("[" * 100_000, "nested too deep"),
        ('{"a":' * 100_000, "nested too deep"),
    ],
)
def test_the_rest_is_one_message(tmp_path: Path, text: str, message: str) -> None:
    (tmp_path / "a.json").write_text(text)
    with pytest.raises(LogError) as caught:
        read_json(tmp_path / "a.json", LogError, "data", max_bytes=1_000_000)
    assert message in str(caught.value)
    assert len(str(caught.value)) < 400
