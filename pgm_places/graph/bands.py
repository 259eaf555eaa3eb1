"""Bands of rows: processing a huge raster a few million cells at a time."""

from collections.abc import Iterator

BAND_CELLS = 4_000_000


def bands_of_rows(shape: tuple[int, int], *, multiple: int = 1) -> Iterator[slice]:
    """Bands of rows, small enough that what is made of one takes little memory.

    Parameters
    ----------
    shape : (int, int)
        Rows and columns of the raster.
    multiple : int
        All bands but the last hold a multiple of this many rows.
    """
    high = multiple * max(1, BAND_CELLS // max(shape[1] * multiple, 1))
    for first in range(0, shape[0], high):
        yield slice(first, min(first + high, shape[0]))
