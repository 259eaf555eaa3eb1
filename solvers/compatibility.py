"""Compatibility of labels at neighbouring nodes, from counts of adjacent labels."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pgm_places._checks import finite_array, integer_array
from pgm_places._core import count_pairs
from pgm_places.errors import InputError

DIRECTIONS = ((-1, -1), (-1, 0), (-1, 1), (0, -1), (0, 1), (1, -1), (1, 0), (1, 1))
"""Row and column steps to the 8 neighbours; the opposite of direction ``d`` is ``7 - d``."""

LOWEST = np.iinfo(np.int64).min


def grid_pair_counts(labels: ArrayLike, n_labels: int) -> NDArray[np.int64]:
    """(8, L, L) ordered neighbour pairs: ``counts[d, l, m]`` cells ``l`` whose neighbour is ``m``.

    Cells (H, W) of negative label are unknown and form no pairs.

    Examples
    --------
    >>> counts = grid_pair_counts([[0, 0, 1]], 2)
    >>> counts[DIRECTIONS.index((0, 1))].tolist()
    [[1, 1], [0, 0]]
    """
    raster = np.asarray(labels)
    integer_array("labels", raster, ("H", "W"), low=LOWEST, high=n_labels)
    if not 1 <= n_labels <= np.iinfo(np.int16).max:
        raise InputError(f"n_labels must be from 1 to {np.iinfo(np.int16).max}, got {n_labels}")
    forward = np.zeros((4, n_labels, n_labels), np.int64)
    count_pairs(np.maximum(raster, -1).astype(np.int16), forward)
    backward = forward[::-1].transpose(0, 2, 1)
    return np.concatenate([backward, forward])


def edge_pair_counts(labels: ArrayLike, edges: ArrayLike, n_labels: int) -> NDArray[np.int64]:
    """(2, L, L) ordered pairs: [0] first node here and second there, [1] the other way round.

    Nodes (N,) of negative label are unknown and form no pairs.
    """
    chosen = np.asarray(labels)
    integer_array("labels", chosen, ("N",), low=LOWEST, high=n_labels)
    pairs = integer_array("edges", edges, ("E", 2), low=0, high=max(len(chosen), 1))
    first, second = chosen[pairs[:, 0]], chosen[pairs[:, 1]]
    known = (first >= 0) & (second >= 0)
    key = first[known].astype(np.int64) * n_labels + second[known]
    counts = np.bincount(key, minlength=n_labels * n_labels).reshape(n_labels, n_labels)
    return np.stack([counts, counts.T])


def yamamoto_coefficients(counts: ArrayLike, *, smoothing: float = 0.0) -> NDArray[np.float64]:
    """(..., L, L) compatibility ``r[l, m]`` of label ``l`` here with ``m`` there, in [-1, 1].

    With p(l) and p(l|m) from the same pairs (paper eq. 6, after Yamamoto)::

        r = (1 - p(l) / p(l|m)) / (1 - p(l))    where p(l) < p(l|m)
        r = p(l|m) / p(l) - 1                   otherwise

    0 is independence, 1 "always", -1 "never". A label that never occurs here or there, or that is
    the only one, carries no information: its coefficients are 0. ``smoothing`` is added to every
    pair of labels that both occur: without it two labels that never touched in training exclude
    each other.

    Examples
    --------
    >>> yamamoto_coefficients([[8, 2], [2, 8]]).round(3).tolist()
    [[0.75, -0.6], [-0.6, 0.75]]
    """
    table = np.asarray(counts, np.float64)
    if table.ndim < 2 or table.shape[-1] != table.shape[-2]:
        raise InputError(f"counts must have shape (..., L, L), got {table.shape}")
    table = finite_array("counts", table, tuple(table.shape))
    if (table < 0).any() or smoothing < 0:
        raise InputError("counts and smoothing must be at least 0")
    occurs = (table.sum(axis=-1) > 0)[..., :, None] & (table.sum(axis=-2) > 0)[..., None, :]
    table = np.where(occurs, table + smoothing, 0.0)
    total = table.sum(axis=(-2, -1), keepdims=True)
    here = table.sum(axis=-1, keepdims=True)
    there = table.sum(axis=-2, keepdims=True)
    informative = occurs & (here < total)
    # p(l|m) / p(l) from counts, so that equal ratios give exactly 0.
    joint, chance = table * total, here * there
    with np.errstate(divide="ignore", invalid="ignore"):
        attract = (1.0 - chance / joint) / (1.0 - here / total)
        repel = joint / chance - 1.0
    return np.where(informative, np.where(chance < joint, attract, repel), 0.0)
