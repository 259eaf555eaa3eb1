"""Large arrays that wait in a file while others need the memory."""

import tempfile
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

__all__ = ["set_aside"]


def set_aside(array: NDArray[Any], folder: Path, *, at_least: int = 2**27) -> NDArray[Any]:
    """The same values, read-only, from a file without a name, which goes when they do.

    Arrays of fewer bytes than ``at_least`` stay in memory; so do those for which the folder has no
    room.

    Parameters
    ----------
    array : array
        Of any shape; whoever holds it must let it go for the memory to be free.
    folder : Path
        On the disk that the file is to lie on.
    at_least : int
    """
    if array.nbytes < max(at_least, 1):
        return array
    try:
        with tempfile.TemporaryFile(dir=folder) as file:
            array.tofile(file)
            file.flush()
            return np.memmap(file, array.dtype, "r", shape=array.shape)
    except OSError:
        return array
