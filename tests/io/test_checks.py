"""Fingerprints of files."""

from pathlib import Path

import pytest

from pgm_places.errors import InputError
from pgm_places.io.input_file import sha256_of


def test_the_fingerprint_is_that_of_the_standard(tmp_path: Path) -> None:
    (tmp_path / "abc").write_bytes(b"abc")  # FIPS 180-2, appendix B.1
    expected = "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad"
    assert sha256_of(tmp_path / "abc") == expected


def test_a_missing_file_is_named(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="absent: no such file; expected an input"):
        sha256_of(tmp_path / "absent")
