"""Labels of a file to compare with."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True, eq=False)
class GivenLabels:
    """Labels of a file to compare with, such as the truth.

    Parameters
    ----------
    title : str
        What they are called in the browser.
    labels : (H, W) int16
        Index into ``names``; -1 for none.
    names : tuple of str
    """

    title: str
    labels: NDArray[np.int16]
    names: tuple[str, ...]

    def on(self, names: Sequence[str]) -> NDArray[np.int16]:
        """(H, W) the labels as indices into other names, which these are among."""
        table = [list(names).index(name) for name in self.names]
        return np.array([*table, -1], np.int16)[self.labels]  # the last entry serves -1
