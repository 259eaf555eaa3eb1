"""Fingerprints of input files, stored with every result for traceability."""

import hashlib
from pathlib import Path

from pgm_places.errors import InputError

__all__ = ["sha256_of"]


def sha256_of(path: Path | str) -> str:
    """The SHA-256 of a file's bytes as 64 hexadecimal digits.

    Raises
    ------
    InputError
        Where the file cannot be read.
    """
    try:
        with Path(path).open("rb") as file:
            return hashlib.file_digest(file, "sha256").hexdigest()
    except OSError as error:
        raise InputError(
            f"cannot read {path} to take its fingerprint: {error.strerror or error}; check the path"
        ) from None
