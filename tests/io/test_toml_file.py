"""TOML of strangers: deep keys and long integers are refused before they cost anything."""

from pathlib import Path

import pytest

from pgm_places.errors import ConfigError
from pgm_places.io.input_file import MAX_BYTES, read_toml


def read(tmp_path: Path, text: str) -> dict[str, object]:
    (tmp_path / "a.toml").write_text(text)
    return read_toml(tmp_path / "a.toml", ConfigError, "a configuration")


def test_a_byte_order_mark_is_no_key(tmp_path: Path) -> None:
    assert read(tmp_path, "\ufefftitle = 'x'") == {"title": "x"}


@pytest.mark.parametrize(
    "text",
    [
        'a = "one.two.three.four.five.six.seven"',
        "a = [0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9, 1.0]",
        "a = 9223372036854775807",
        '[select.options]\n"methods.amn.C" = [10.0]',
        "# a sentence. Another one. And so on. It ends. Or not. Perhaps. Who knows. Nobody.",
    ],
)
def test_what_people_write_is_read(tmp_path: Path, text: str) -> None:
    read(tmp_path, text)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("x = 1\n" + ".".join("a" * 9) + " = 1", "line 2 has a key of more than 8 parts"),
        ("[" + " . ".join(["'a'"] * 9) + "]", "line 1 has a key of more than 8 parts"),
        ("a = { " + ".".join(['"a"'] * 50_00) + " = 1 }", "a key of more than 8 parts"),
        ("[[train]]\ngenerated = 1" + 30 * "0", "generated: an integer has more than 64 bits"),
        ("a = [[1, [99999999999999999999]]]", "a: an integer has more than 64 bits"),
        ("a = 1" + 5000 * "0", "an integer has more than 64 bits"),
        ("a = " + 5000 * "[", "nested too deep"),
        ("a = " + 3000 * "{a=", "nested too deep"),
        ("a = ", "is not valid TOML"),
        ("[[train]]\n" + 5000 * "a" + " = 1", "a key has 5000 characters; at most 200 are read"),
        ("#" * (MAX_BYTES + 1), f"larger than {MAX_BYTES} bytes; expected a configuration"),
    ],
)
def test_the_rest_is_one_message(tmp_path: Path, text: str, message: str) -> None:
    with pytest.raises(ConfigError) as caught:
        read(tmp_path, text)
    assert message in str(caught.value)
    assert len(str(caught.value)) < 300
