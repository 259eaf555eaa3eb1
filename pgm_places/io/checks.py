"""Fingerprints of input files, stored with every result for traceability."""

import hashlib
from pathlib import Path

from pgm_places.errors import InputError
from pgm_places.io.input_file import open_input

__all__ = ["sha256_of"]


def sha256_of(path: Path | str) -> str:
    """The SHA-256 of a file's bytes as 64 hexadecimal digits.

    Raises
    ------
    InputError
        Where the file cannot be read.
    """
    with open_input(Path(path), InputError, "an input of the run, to take its fingerprint") as file:
        try:
            return hashlib.file_digest(file, "sha256").hexdigest()
        except OSError as error:
            raise InputError(f"{path}: cannot be read: {error.strerror or error}") from None
