"""The smaller of two integer types for rasters of numbers, which huge maps have many of."""

from typing import Any

import numpy as np

__all__ = ["number_type"]


def number_type(count: int) -> np.dtype[Any]:
    """The type that holds the numbers 0 to ``count`` and -1 for none.

    Examples
    --------
    >>> str(number_type(32_767)), str(number_type(32_768))
    ('int16', 'int32')
    """
    return np.dtype(np.int16 if count <= np.iinfo(np.int16).max else np.int32)
