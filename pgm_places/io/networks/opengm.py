"""Factor graphs as OpenGM's HDF5 files."""

import math
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pgm_places._extras import needed
from pgm_places.errors import InputError
from pgm_places.inference.factor_graph import MOST_NODES, FactorGraph
from pgm_places.io.atomic import atomic_file
from pgm_places.io.input_file import open_input

MAX_BYTES = 1 << 32
MOST_NUMBERS = 1 << 26
"""In a part of a file, and in all tables together: compressed or not stored, they take no room."""
_WHAT = "a factor graph (OpenGM's HDF5)"
_VERSION, _EXPLICIT, _DOUBLE = (2, 0), 16000, 1
_PURPOSE = "reading and writing OpenGM's HDF5 files"

Array = NDArray[np.float64]


def read_opengm(path: Path | str, *, dataset: str = "gm") -> FactorGraph:
    """The factors of a file whose energies are minimised: log-potentials are minus these.

    Explicit tables and the functions of label distance (Potts, absolute and squared difference,
    plain and truncated) are read.

    Parameters
    ----------
    path : Path
    dataset : str
        The name of the model within the file.

    Raises
    ------
    InputError
        h5py is not installed; or the file is missing or damaged, or holds other functions.
    """
    path = Path(path)
    h5py = needed("h5py", extra="networks", purpose=_PURPOSE)
    with open_input(path, InputError, _WHAT, max_bytes=MAX_BYTES) as raw:
        try:
            with h5py.File(raw, "r") as file:
                group = file[dataset]
                header, states = _wholes(group, "header"), _wholes(group, "numbers-of-states")
                kinds = header[5 : 5 + 2 * header[4] : 2]
                counts = header[6 : 6 + 2 * header[4] : 2]
                room = _Room()
                functions = [
                    _functions(group[f"function-id-{kind}"], kind, count, room) if count else []
                    for kind, count in zip(kinds, counts, strict=True)
                ]
                factors = _wholes(group, "factors") if header[3] else []
            scopes, tables = _read_factors(factors, functions, header[3])
            return FactorGraph.of(np.array(states, np.int64), scopes, tables)
        except _UnknownFunctionError as problem:
            raise InputError(f"{path}: {problem}") from None
        except InputError as problem:
            raise InputError(f"{path}: not {_WHAT} named {dataset!r} ({problem})") from None
        except (OSError, KeyError, ValueError, IndexError, TypeError, AttributeError) as problem:
            reason = str(problem).splitlines()[0] if str(problem) else type(problem).__name__
            raise InputError(f"{path}: not {_WHAT} named {dataset!r} ({reason})") from None


def write_opengm(path: Path | str, graph: FactorGraph, *, dataset: str = "gm") -> Path:
    """The path, once the file holds the factors as explicit tables of energies (float64).

    Raises
    ------
    InputError
        h5py is not installed.
    OutputError
        The file cannot be written.
    """
    h5py = needed("h5py", extra="networks", purpose=_PURPOSE)
    count = len(graph.scopes)
    header = [*_VERSION, graph.n_nodes, count, 1, _EXPLICIT, count, _DOUBLE]
    indices = [n for table in graph.tables for n in (table.ndim, *table.shape)]
    values = [-table.ravel(order="F") for table in graph.tables]
    factors = [n for k, scope in enumerate(graph.scopes) for n in (k, 0, len(scope), *scope)]
    with atomic_file(path) as temporary, h5py.File(temporary, "w") as file:
        group = file.create_group(dataset)
        group["header"] = np.array(header, np.uint64)
        group["numbers-of-states"] = graph.n_labels.astype(np.uint64)
        if count:
            inner = group.create_group(f"function-id-{_EXPLICIT}")
            inner["indices"] = np.array(indices, np.uint64)
            inner["values"] = np.concatenate(values)
            group["factors"] = np.array(factors, np.uint64)
    return Path(path)


class _UnknownFunctionError(Exception):
    """A function that is not read here."""


class _Room:
    """How many numbers the tables of a file may still hold."""

    left = MOST_NUMBERS

    def take(self, shape: Sequence[int]) -> int:
        """The size of a table of that shape, where there is room for it."""
        size = math.prod(shape)
        if size > self.left or len(shape) > MOST_NODES:
            raise ValueError(f"a table of {size} numbers and order {len(shape)} is too large")
        self.left -= size
        return size


def _numbers(group: Any, name: str) -> NDArray[Any]:
    """What a part of the file holds, which says how much that is before it is read."""
    part = group[name]
    if part.ndim != 1 or part.size > MOST_NUMBERS:
        raise ValueError(f"{name!r} must be a list of at most {MOST_NUMBERS} numbers")
    found: NDArray[Any] = part[()]
    return found


def _wholes(group: Any, name: str) -> list[int]:
    """The same of whole numbers from 0."""
    values = _numbers(group, name)
    is_whole = values.dtype.kind in "iu"
    if not is_whole or (len(values) and not 0 <= values.min() <= values.max() < 2**62):
        raise ValueError(f"{name!r} must hold whole numbers from 0")
    found: list[int] = values.tolist()
    return found


def _explicit(indices: list[int], values: Array, room: _Room) -> tuple[Array, int, int]:
    order = indices[0]
    shape = indices[1 : 1 + order]
    size = room.take(shape)
    return values[:size].reshape(shape, order="F"), 1 + order, size


def _by_distance(
    n_values: int, energy: Callable[..., Array]
) -> Callable[[list[int], Array, _Room], tuple[Array, int, int]]:
    def read(indices: list[int], values: Array, room: _Room) -> tuple[Array, int, int]:
        room.take(indices[:2])
        far = np.abs(np.subtract.outer(np.arange(indices[0]), np.arange(indices[1])))
        return energy(far.astype(np.float64), *values[:n_values].tolist()), 2, n_values

    return read


def _potts(far: Array, same: float, other: float) -> Array:
    values: Array = np.where(far == 0, same, other)
    return values


_READERS: Mapping[int, Callable[[list[int], Array, _Room], tuple[Array, int, int]]] = {
    16000: _explicit,
    16002: _by_distance(1, lambda far, weight: weight * far),
    16003: _by_distance(2, lambda far, cap, weight: weight * np.minimum(far, cap)),
    16004: _by_distance(1, lambda far, weight: weight * far**2),
    16005: _by_distance(2, lambda far, cap, weight: weight * np.minimum(far**2, cap)),
    16006: _by_distance(2, _potts),
}
"""What reads a function: its table, and how many indices and values that took."""


def _functions(group: Any, kind: int, count: int, room: _Room) -> list[Array]:
    if kind not in _READERS:
        raise _UnknownFunctionError(
            f"holds functions of OpenGM's type {kind}, which are not read; types that are: "
            f"{', '.join(map(str, _READERS))}"
        )
    indices = _wholes(group, "indices")
    values = _numbers(group, "values").astype(np.float64)
    tables = []
    for _ in range(count):
        table, n_indices, n_values = _READERS[kind](indices, values, room)
        tables.append(-table)
        indices, values = indices[n_indices:], values[n_values:]
    return tables


def _read_factors(
    words: list[int], functions: Sequence[Sequence[Array]], count: int
) -> tuple[list[tuple[int, ...]], list[Array]]:
    scopes, tables, at = [], [], 0
    for _ in range(count):
        number, kind, order = words[at : at + 3]
        scopes.append(tuple(words[at + 3 : at + 3 + order]))
        tables.append(functions[kind][number])
        at += 3 + order
    return scopes, tables
