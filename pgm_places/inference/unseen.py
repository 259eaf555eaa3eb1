"""Nodes without observation: rows of NaN among log-probabilities."""

from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pgm_places._checks import finite_array, number_array, require_shape
from pgm_places.errors import InputError


def with_unseen_rows(
    name: str, values: ArrayLike, n_rows: int, n_columns: int, *, probable: bool = False
) -> tuple[NDArray[Any], NDArray[np.bool_] | None]:
    """An array with rows of NaN replaced by equal values, and a mask (N,) of these rows or None.

    The values are log-probabilities, or probabilities with ``probable``.

    Raises
    ------
    InputError
        A row is partly NaN, the shape is wrong, or a value is infinite.
    """
    dtype = np.float32 if getattr(values, "dtype", None) == np.float32 else np.float64
    array = number_array(name, values, dtype)
    require_shape(name, array.shape, (n_rows, n_columns))
    unseen = None
    if np.isnan(array.min(initial=0.0)):
        missing = np.isnan(array)
        unseen = missing.all(axis=1)
        partly = np.flatnonzero(missing.any(axis=1) & ~unseen)
        if len(partly):
            raise InputError(
                f"{name} must be numbers in all of a row, or NaN in all of it if nothing "
                f"was observed; row {int(partly[0])} is NaN in part"
            )
        equal = 1.0 / n_columns if probable else -np.log(n_columns)
        array = np.where(unseen[:, None], dtype(equal), array)
    array = finite_array(name, array, (n_rows, n_columns), dtype=None, allow_minus_inf=not probable)
    return array, unseen


def with_unseen_nodes(
    unary: ArrayLike, given: ArrayLike | None, n_nodes: int, n_labels: int
) -> tuple[NDArray[Any], NDArray[np.bool_] | None]:
    """:func:`with_unseen_rows` for a unary with an optional mask (N,) of further unseen nodes.

    Raises
    ------
    InputError
        As there; also if the nodes are not a mask.
    """
    array, unseen = with_unseen_rows("unary", unary, n_nodes, n_labels)
    if given is None:
        return array, unseen
    mask = np.asarray(given)
    if mask.dtype != np.bool_ or mask.shape != (n_nodes,):
        raise InputError(
            f"unseen must be a mask of shape ({n_nodes},), got {mask.dtype} of shape {mask.shape}"
        )
    mask = mask if unseen is None else mask | unseen
    if not mask.any():
        return array, None
    return np.where(mask[:, None], array.dtype.type(-np.log(n_labels)), array), mask
