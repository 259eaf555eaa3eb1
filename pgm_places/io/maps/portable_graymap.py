"""Binary PGM files (P5), the usual image of a map, read row by row without a second copy."""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import IO

import numpy as np
from numpy.typing import NDArray

from pgm_places.errors import InputError

__all__ = ["MAGIC", "Graymap", "read_header"]

MAGIC = (b"P1", b"P2", b"P3", b"P4", b"P5", b"P6")
_WHITESPACE = b" \t\n\v\f\r"
_MAX_TOKEN = 10
_MAX_HEADER = 64 * 1024  # comments included


@dataclass
class Graymap:
    """The raster of a binary PGM: its place in the file and what its numbers mean."""

    shape: tuple[int, int]
    maximum: int
    _file: IO[bytes]
    _start: int

    @property
    def _bytes_per_pixel(self) -> int:
        return 1 if self.maximum < 256 else 2

    def rows(self, top: int, bottom: int) -> NDArray[np.uint8]:
        """(bottom - top, W) grey values, stretched from 0..maximum to 0..255 and rounded."""
        width = self.shape[1]
        row_bytes = width * self._bytes_per_pixel
        self._file.seek(self._start + top * row_bytes)
        data = self._file.read((bottom - top) * row_bytes)
        if len(data) != (bottom - top) * row_bytes:
            raise OSError("the file ended early")
        values = np.frombuffer(data, np.uint8 if self._bytes_per_pixel == 1 else ">u2")
        values = values.reshape(bottom - top, width)
        if self.maximum == 255:
            return values
        return _stretch_table(self.maximum)[values]


def _stretch_table(maximum: int) -> NDArray[np.uint8]:
    """Grey of 8 bits for each stored number; numbers above the maximum count as it."""
    stored = np.arange(256 if maximum < 256 else 65536).clip(0, maximum)
    return np.asarray((stored * 510 + maximum) // (2 * maximum), np.uint8)


def read_header(path: Path, file: IO[bytes], error: type[InputError]) -> Graymap | None:
    """The raster of a P5 file; None where the file is of another kind of the family (P1 .. P6).

    Raises
    ------
    error
        Where the header is not a PGM header or states more pixels than the file holds.
    """
    if file.read(2) != b"P5":
        file.seek(0)
        return None
    next_number = _number_reader(path, file, error)
    width, height = next_number("width"), next_number("height")
    maximum = next_number("maximum grey value")
    if not 0 < maximum < 65536:
        raise error(f"{path}: the PGM's maximum grey value must be 1 to 65535, got {maximum}")
    graymap = Graymap((height, width), maximum, file, file.tell())
    needed = graymap._start + height * width * graymap._bytes_per_pixel
    there = path.stat().st_size
    if there < needed:
        raise error(
            f"{path}: the header states {width} x {height} pixels, which take {needed} bytes with "
            f"the header, but the file has {there}; it is truncated or its header is wrong"
        )
    return graymap


def _number_reader(path: Path, file: IO[bytes], error: type[InputError]) -> Callable[[str], int]:
    def next_number(what: str) -> int:
        token = b""
        while file.tell() < _MAX_HEADER and len(token) <= _MAX_TOKEN:
            byte = file.read(1)
            if byte == b"#":
                file.readline(_MAX_HEADER)
            elif byte and byte not in _WHITESPACE:
                token += byte
                continue
            if token or not byte:
                break
        if not token.isdigit() or len(token) > _MAX_TOKEN:
            raise error(
                f"{path}: the PGM header's {what} must be a number of at most {_MAX_TOKEN} digits, "
                f"got {token[:20]!r}"
            )
        return int(token)

    return next_number
