"""How sure the labels of a piece are: the mean probability of its label over its cells."""

import numpy as np
from numpy.typing import ArrayLike

from pgm_places._checks import finite_array
from pgm_places.errors import InputError, LabelError
from pgm_places.graph.layout import GridLayout
from pgm_places.topology.components import Components, bands_of_rows

__all__ = ["mean_confidences"]


def mean_confidences(
    pieces: Components, beliefs: ArrayLike, layout: GridLayout | None, n_labels: int
) -> list[float | None]:
    """The mean probability of each piece's label, None for a piece without a known cell.

    Parameters
    ----------
    pieces : Components
    beliefs : (N, K) float
        Probabilities of the labels at the nodes of ``layout``.
    layout : GridLayout
        The cells behind ``beliefs``: of the map, or of the map coarsened by a whole factor.
    n_labels : int
        K.

    Raises
    ------
    InputError
        Beliefs without a layout.
    LabelError
        The layout is of another map.
    """
    if layout is None:
        raise InputError("beliefs need the layout of their nodes; pass layout as well")
    array = finite_array("beliefs", beliefs, (len(layout.cells_rc), n_labels), dtype=np.float32)
    shape = pieces.piece.shape
    factor = -(-shape[0] // layout.shape[0])
    if layout.shape != tuple(-(-side // factor) for side in shape):
        raise LabelError(
            f"the layout has {layout.shape} cells, which the labels' {shape} are no whole "
            "multiple of; pass the layout that the labels were made with"
        )
    counts, sums = np.zeros(pieces.count, np.int64), np.zeros(pieces.count)
    columns = np.arange(shape[1]) // factor
    for rows in bands_of_rows(shape):
        piece = pieces.piece[rows]
        part = np.arange(rows.start, rows.start + len(piece)) // factor
        node = layout.node_of_cell[part[:, None], columns]
        known = (piece >= 0) & (node >= 0)
        numbers = piece[known]
        counts += np.bincount(numbers, minlength=pieces.count)
        probability = array[node[known], pieces.label[numbers]]
        sums += np.bincount(numbers, probability, pieces.count)
    return [
        float(total / count) if count else None for total, count in zip(sums, counts, strict=True)
    ]
