"""Checks of arrays and names from callers: each returns the checked value or raises one error."""

from collections.abc import Iterable, Iterator, Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pgm_places.errors import InputError, LabelError, is_printable, quoted

LONGEST_NAME = 200
"""The longest name, in characters."""
FARTHEST_M = 1e7
"""The largest coordinate (or heading, in radians) of a robot's pose; larger ones are damage."""
ROWS_AT_ONCE = 262_144
"""Rows of huge arrays that are processed together, so that temporary arrays stay small."""


def row_blocks(n_rows: int, most: int | None = None) -> Iterator[slice]:
    """Slices of at most ``most`` rows, to bound the size of temporaries."""
    most = most or ROWS_AT_ONCE
    for first in range(0, n_rows, most):
        yield slice(first, min(first + most, n_rows))


def frozen_copy(array: NDArray[Any]) -> NDArray[Any]:
    """A contiguous read-only array with the same content; copied only if it is writeable."""
    if array.flags.writeable or not array.flags.c_contiguous:
        array = np.array(array, order="C", copy=True)
        array.setflags(write=False)
    return array


def set_frozen(item: Any, **values: Any) -> None:
    """Set fields of a frozen dataclass during its construction; arrays become read-only."""
    for name, value in values.items():
        object.__setattr__(
            item, name, frozen_copy(value) if isinstance(value, np.ndarray) else value
        )


def freeze(array: NDArray[Any]) -> NDArray[Any]:
    """The array itself, made read-only without a copy: for results without other references."""
    array.setflags(write=False)
    return frozen_copy(array)


def _shape_text(shape: tuple[int | str | None, ...]) -> str:
    sizes = ", ".join("any" if size is None else str(size) for size in shape)
    return f"({sizes},)" if len(shape) == 1 else f"({sizes})"


def _fits(got: tuple[int, ...], shape: tuple[int | str | None, ...]) -> bool:
    return len(got) == len(shape) and all(
        not isinstance(want, int) or want == size for want, size in zip(shape, got, strict=True)
    )


def require_shape(
    name: str,
    got: tuple[int, ...],
    shape: tuple[int | str | None, ...],
    error: type[InputError] = InputError,
    *,
    of: str = "",
) -> None:
    """Raise an error unless a shape fits; ``of`` names its owner, such as ``the map's``."""
    if not _fits(got, shape):
        hint = _shape_hint(name, got, shape)
        whose = f"{of} " if of else ""
        raise error(f"{name} must have {whose}shape {_shape_text(shape)}, got {got}{hint}")


def _shape_hint(name: str, got: tuple[int, ...], shape: tuple[int | str | None, ...]) -> str:
    """A hint for common mistakes: a single column, a transposed array."""
    if len(shape) != 2:
        return ""
    if len(got) == 1 and got[0] == shape[0] != shape[1]:
        return f"; a single column is {name}[:, np.newaxis]"
    return f"; transpose it: {name}.T" if _fits(got[::-1], shape) else ""


def require_type(name: str, value: object, kind: type, hint: str = "") -> None:
    """Raise InputError, with a hint, unless ``value`` is of the type ``kind``."""
    if not isinstance(value, kind):
        raise InputError(f"{name} must be a {kind.__name__}, got a {type(value).__name__}{hint}")


def require_at_least(name: str, value: float, low: float, unit: str = "") -> None:
    """Raise InputError unless a number, in a unit such as ``metres``, is at least ``low``."""
    if not value >= low:
        raise InputError(f"{name} must be at least {low}{unit and ' '}{unit}, got {value}")


def number_array(name: str, values: ArrayLike, dtype: Any = np.float64) -> NDArray[Any]:
    """``values`` as an array of real numbers of a type; None keeps their own type."""
    if hasattr(values, "toarray"):
        raise InputError(
            f"{name} must be an array of numbers, got a sparse one; give its toarray()"
        )
    if hasattr(values, "mask") and np.ma.is_masked(values):  # importing numpy.ma takes time
        raise InputError(f"{name} has masked values; fill them, or leave their rows out")
    try:
        array = np.asarray(values)
        if array.dtype.kind in "cSU":
            raise ValueError(f"its type is {array.dtype}")
        if dtype is None:  # their own type, unless it is Python objects
            return array.astype(np.float64) if array.dtype.kind == "O" else array
        return array.astype(dtype, copy=False)
    except (TypeError, ValueError) as error:
        raise InputError(f"{name} must be an array of numbers: {error}") from None


def finite_array(
    name: str,
    values: ArrayLike,
    shape: tuple[int | str | None, ...],
    *,
    dtype: Any = np.float64,
    allow_minus_inf: bool = False,
) -> NDArray[Any]:
    """``values`` as a float array of the stated shape without NaN or infinity.

    In ``shape``, a string or None stands for any size. ``-inf`` passes with ``allow_minus_inf``.
    The type is float64; with ``dtype=None``, float32 stays float32.
    """
    if dtype is None:
        dtype = np.float32 if getattr(values, "dtype", None) == np.float32 else np.float64
    array = number_array(name, values, dtype)
    require_shape(name, array.shape, shape)
    if not _all_allowed(array, allow_minus_inf):
        bad = np.isnan(array) | (array == np.inf) if allow_minus_inf else ~np.isfinite(array)
        where = tuple(int(i) for i in np.argwhere(bad)[0])
        allowed = "finite numbers or -inf" if allow_minus_inf else "finite numbers"
        raise InputError(
            f"{name} must hold {allowed}, got {array[where]} at index {where}"
            f" ({int(bad.sum())} such values)"
        )
    return array


def pose_array(
    name: str, values: ArrayLike, shape: tuple[int | str | None, ...]
) -> NDArray[np.float64]:
    """``values`` as poses: x, y in metres and heading in radians, within :data:`FARTHEST_M`."""
    poses = finite_array(name, values, shape)
    far = np.abs(poses) > FARTHEST_M
    if far.any():
        where = tuple(int(i) for i in np.argwhere(far)[0])
        raise InputError(
            f"{name} must hold metres and radians up to {FARTHEST_M:g}, got {poses[where]} at "
            f"index {where}; leave that pose out"
        )
    return poses


def _all_allowed(array: NDArray[Any], allow_minus_inf: bool) -> bool:
    """Whether all values are allowed; in blocks, since a mask of a huge array is huge too."""
    if array.ndim == 0 or len(array) <= ROWS_AT_ONCE:
        return bool((array < np.inf if allow_minus_inf else np.isfinite(array)).all())
    return all(_all_allowed(array[some], allow_minus_inf) for some in row_blocks(len(array)))


def is_sparse(rows: object) -> bool:
    """Whether an array is a sparse SciPy array, without importing SciPy."""
    return hasattr(rows, "tocsr")


def feature_rows(name: str, values: Any, n_rows: int | str) -> NDArray[np.float64]:
    """(N, D) finite features, read-only: an array, or sparse rows (``scipy.sparse.csr_array``).

    Sparse rows have the type of dense arrays, as both have the same syntax for products and masks.
    """
    if not is_sparse(values):
        return frozen_copy(finite_array(name, values, (n_rows, "D")))
    from scipy.sparse import csr_array

    if getattr(values, "ndim", 2) != 2:
        raise InputError(f"{name} must have shape {_shape_text((n_rows, 'D'))}, got {values.shape}")
    require_shape(name, values.shape, (n_rows, "D"))
    finite_array(f"the values of {name}", values.tocsr().data, ("M",))
    is_ready = isinstance(values, csr_array) and values.dtype == np.float64
    if is_ready and not values.data.flags.writeable:
        return values
    rows: Any = csr_array(values, dtype=np.float64, copy=True)
    rows.sum_duplicates()
    for part in (rows.data, rows.indices, rows.indptr):
        part.setflags(write=False)
    return rows


def stacked_rows(parts: Sequence[NDArray[np.float64]]) -> NDArray[np.float64]:
    """The rows of several arrays below each other; sparse if any is."""
    if not any(is_sparse(part) for part in parts):
        return np.concatenate(parts)
    from scipy.sparse import csr_array, vstack

    rows: Any = vstack([csr_array(part) for part in parts], format="csr")
    return rows


def times_rows(rows: NDArray[np.float64], factors: NDArray[np.float64]) -> NDArray[np.float64]:
    """Rows (N, D), dense or sparse, each multiplied by its factor (N,)."""
    if not is_sparse(rows):
        return rows * factors[:, np.newaxis]
    scaled: Any = rows.multiply(factors[:, np.newaxis])  # type: ignore[attr-defined]
    return scaled.tocsr()


def integer_array(
    name: str,
    values: ArrayLike,
    shape: tuple[int | str | None, ...],
    *,
    low: int,
    high: int,
    narrow: bool = False,
) -> NDArray[np.int64]:
    """An int64 array of a shape with ``low <= value < high``; ``narrow`` leaves int32 as it is."""
    array = number_array(name, values, None)
    if array.size and not np.issubdtype(array.dtype, np.integer):
        raise InputError(f"{name} must hold integers, got dtype {array.dtype}")
    require_shape(name, array.shape, shape)
    if array.size and (array.min() < low or array.max() >= high):
        bad = (array < low) | (array >= high)
        where = tuple(int(i) for i in np.argwhere(bad)[0])
        raise InputError(
            f"{name} must hold integers from {low} to {high - 1}, "
            f"got {array[where]} at index {where}"
        )
    if narrow and array.dtype == np.int32:
        return array
    return array.astype(np.int64, copy=False)


def learned_number(name: str, values: NDArray[Any], at: int, most: int, *, low: int = 0) -> int:
    """An integer from ``low`` to below ``most`` in a learned array; files may be damaged."""
    value = values[at] if at < len(values) else -1
    if not low <= value < most:
        raise InputError(f"{name} must hold {low} to {most - 1} at index {at}, got {quoted(value)}")
    return int(value)


def node_mask(nodes: ArrayLike, n_nodes: int) -> NDArray[np.bool_]:
    """A mask (N,) of nodes; node numbers are refused, as NumPy would read them as a mask."""
    mask = np.asarray(nodes)
    if mask.dtype != np.bool_:
        raise InputError(
            f"nodes must be a mask of True and False, got {mask.dtype}; of node numbers it is "
            "np.isin(np.arange(n_nodes), numbers)"
        )
    require_shape("the mask of nodes", mask.shape, (n_nodes,))
    return mask


def cell_list(cells_rc: ArrayLike) -> NDArray[Any]:
    """Cells (n, 2), row and column, inside or outside the map."""
    cells = np.asarray(cells_rc)
    if cells.ndim != 2 or cells.shape[1] != 2 or cells.dtype.kind not in "iu":
        raise InputError(
            f"cells_rc must be integers of shape (n, 2), row and column, got {cells.dtype} of "
            f"shape {cells.shape}"
        )
    return cells


def plain_names(what: str, names: Any, error: type[InputError] = LabelError) -> tuple[str, ...]:
    """Names of labels, places or columns that can be written to every file and terminal.

    ``error`` unless they are distinct texts of 1 to 200 characters without control characters.
    """
    if isinstance(names, str) or not isinstance(names, Iterable):
        raise error(f"{what} must be a list of names, got {quoted(names)}")
    unique: dict[str, None] = {}
    for name in names:
        if not isinstance(name, str) or not 1 <= len(name) <= LONGEST_NAME:
            raise error(
                f"{what} must be strings of 1 to {LONGEST_NAME} characters, got {quoted(name)}"
            )
        if not is_printable(name):
            raise error(f"{what} must not hold control characters, got {quoted(name)}")
        if name in unique:
            raise error(f"{what} must differ, got {quoted(name)} twice")
        unique[name] = None
    return tuple(unique)


def require_names(where: str, labels: NDArray[Any], names: Sequence[str]) -> None:
    """Raise LabelError unless every label of a map, -1 for none, has a name."""
    highest = labels.max(initial=-1)
    if highest >= len(names):
        raise LabelError(
            f"{where}: label index {highest} but there are only {len(names)} labels: "
            f"{', '.join(names)}"
        )


def label_raster(
    name: str, values: ArrayLike, shape: tuple[int | str | None, ...], n_labels: int | None = None
) -> NDArray[np.int16]:
    """``values`` as labels per cell, -1 for none; at most two bytes a cell are allocated."""
    array = np.asarray(values)
    if not np.issubdtype(array.dtype, np.integer):
        raise LabelError(f"{name} must hold integers, got dtype {array.dtype}")
    require_shape(name, array.shape, shape, LabelError)
    high = np.iinfo(np.int16).max if n_labels is None else n_labels - 1
    if array.size and (array.min() < -1 or array.max() > high):
        raise LabelError(
            f"{name} must hold labels from 0 to {high}, or -1 for none, got values from "
            f"{array.min()} to {array.max()}"
        )
    return array.astype(np.int16, copy=False)
