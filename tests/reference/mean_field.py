"""Mean field, slow and obvious: one node after the other, its neighbours found one by one."""

import numpy as np
from numpy.typing import NDArray


def mean_field_in_order(
    unary: NDArray[np.float64],
    cells: list[tuple[int, int]],
    table: NDArray[np.float64],
    *,
    connectivity: int,
    damping: float,
    passes: int,
) -> NDArray[np.float64]:
    """(N, K) beliefs of the cells after some passes: rows of even number first, then the others."""
    order = sorted(range(len(cells)), key=lambda i: (cells[i][0] % 2, cells[i]))
    beliefs = np.exp(unary) / np.exp(unary).sum(axis=1, keepdims=True)
    for _ in range(passes):
        for i in order:
            field = unary[i].copy()
            for j, cell in enumerate(cells):
                steps = [abs(cell[0] - cells[i][0]), abs(cell[1] - cells[i][1])]
                if i == j or max(steps) > 1 or (connectivity == 4 and sum(steps) > 1):
                    continue
                pair = table if cells[i] < cell else table.T  # [label here, label there]
                for there in range(len(field)):
                    if beliefs[j, there] > 0:
                        field += beliefs[j, there] * pair[:, there]
            if field.max() > -np.inf:
                fresh = np.exp(field - field.max())
                beliefs[i] = (1 - damping) * fresh / fresh.sum() + damping * beliefs[i]
    return beliefs
