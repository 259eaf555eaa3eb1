"""Convolutions cell by cell, for the floor network."""

import numpy as np
from numpy.typing import NDArray


def convolved(
    x: NDArray[np.float32],
    kernel: NDArray[np.float32],
    bias: NDArray[np.float32],
    *,
    stride: int = 1,
    dilation: int = 1,
) -> NDArray[np.float64]:
    """(h / stride, w / stride, outputs) sums over the kernel around every cell, zeros outside."""
    height, width, _ = x.shape
    side = kernel.shape[0]
    middle = side // 2
    found = np.zeros((height // stride, width // stride, kernel.shape[3]))
    for r in range(found.shape[0]):
        for c in range(found.shape[1]):
            for i in range(side):
                for j in range(side):
                    at = r * stride + (i - middle) * dilation, c * stride + (j - middle) * dilation
                    if 0 <= at[0] < height and 0 <= at[1] < width:
                        found[r, c] += x[at].astype(np.float64) @ kernel[i, j]
    return found + bias
