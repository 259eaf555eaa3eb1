"""Minimum cuts as DIMACS max-flow files."""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pgm_places._checks import frozen
from pgm_places.errors import InputError
from pgm_places.io.atomic import write_text
from pgm_places.io.csv_table import plain_number
from pgm_places.io.input_file import read_text

MAX_BYTES = 1 << 30
_MOST_WITHOUT_ARCS = 1_000_000
"""Nodes that no arc names; more are a slip in the number of nodes."""
_DIGITS = 12
_WHAT = "a cut problem (DIMACS max)"


@dataclass(frozen=True, eq=False)
class CutProblem:
    """Capacities between a source, a sink and N nodes, as ``minimum_cut`` takes them.

    Parameters
    ----------
    source_capacity, sink_capacity : (N,) float
        From the source to each node, and from each node to the sink.
    edges : (E, 2) int
        Pairs of nodes, each pair once.
    forward, backward : (E,) float
        From an edge's first node to its second, and back.
    constant : float
        The capacity from the source straight to the sink: every cut parts it.

    Examples
    --------
    >>> from pgm_places.solvers.max_flow import minimum_cut
    >>> one = CutProblem(np.array([3.0, 0]), np.array([0, 2.0]), np.array([[0, 1]]), [1.0], [0.0])
    >>> minimum_cut(*one.capacities).value
    1.0
    """

    source_capacity: NDArray[np.float64]
    sink_capacity: NDArray[np.float64]
    edges: NDArray[np.int64]
    forward: NDArray[np.float64]
    backward: NDArray[np.float64]
    constant: float = 0.0

    @property
    def capacities(self) -> tuple[NDArray[Any], ...]:
        """The arguments of :func:`~pgm_places.solvers.max_flow.minimum_cut`."""
        return self.source_capacity, self.sink_capacity, self.edges, self.forward, self.backward


def read_dimacs(path: Path | str) -> CutProblem:
    """The cut problem of a file; the nodes but source and sink keep their order, from 0.

    Arcs into the source and out of the sink are left out: no minimum cut parts them. Parallel arcs
    add up.

    Raises
    ------
    InputError
        The file is missing or damaged; the message says in which line.
    """
    path = Path(path)
    n_nodes, ends, arcs = 0, {}, []
    text = read_text(path, InputError, _WHAT, max_bytes=MAX_BYTES)
    for number, line in enumerate(text.splitlines(), start=1):
        kind, *words = line.split() or ["c"]
        try:
            if kind == "p" and words[0] == "max" and not n_nodes:
                n_nodes = _whole(words[1])
            elif kind == "n":
                ends[words[1]] = _node(words[0], n_nodes)
            elif kind == "a":
                arcs.append(_arc(words, n_nodes))
            elif kind != "c":
                raise ValueError
        except (ValueError, IndexError):
            raise InputError(
                f"{path}, line {number}: {_WHAT} has lines 'p max NODES ARCS', 'n NODE s', "
                f"'n NODE t' and 'a FROM TO CAPACITY', got {line[:60]!r}"
            ) from None
    if set(ends) != {"s", "t"} or ends["s"] == ends["t"]:
        raise InputError(f"{path}: {_WHAT} needs a source ('n NODE s') and another node as sink")
    if n_nodes > 2 * len(arcs) + _MOST_WITHOUT_ARCS:
        raise InputError(
            f"{path}: {_WHAT} says that there are {n_nodes} nodes, but its {len(arcs)} arcs name "
            f"{2 * len(arcs)} at most; correct the line 'p max NODES ARCS'"
        )
    if not np.isfinite(sum(capacity for _, _, capacity in arcs)):
        raise InputError(f"{path}: the capacities of {_WHAT} add up to infinity; divide them")
    return _gathered(n_nodes, ends["s"], ends["t"], arcs)


def write_dimacs(path: Path | str, problem: CutProblem) -> Path:
    """The path, once the file holds the problem; node i is i + 1, the source N + 1, the sink N + 2.

    Raises
    ------
    OutputError
        The file cannot be written.
    """
    n = len(problem.source_capacity)
    arcs = [(n + 1, i + 1, c) for i, c in enumerate(problem.source_capacity.tolist())]
    arcs += [(i + 1, n + 2, c) for i, c in enumerate(problem.sink_capacity.tolist())]
    for (i, j), ahead, back in zip(problem.edges, problem.forward, problem.backward, strict=True):
        arcs += [(int(i) + 1, int(j) + 1, float(ahead)), (int(j) + 1, int(i) + 1, float(back))]
    arcs.append((n + 1, n + 2, float(problem.constant)))
    kept = [(i, j, capacity) for i, j, capacity in arcs if capacity > 0]
    lines = [f"p max {n + 2} {len(kept)}", f"n {n + 1} s", f"n {n + 2} t"]
    lines += [f"a {i} {j} {_text(capacity)}" for i, j, capacity in kept]
    return write_text(path, "\n".join(lines) + "\n")


def _whole(word: str) -> int:
    if not (word.isascii() and word.isdigit() and len(word) <= _DIGITS):
        raise ValueError
    return int(word)


def _node(word: str, n_nodes: int) -> int:
    node = _whole(word) - 1
    if not 0 <= node < n_nodes:
        raise ValueError
    return node


def _arc(words: list[str], n_nodes: int) -> tuple[int, int, float]:
    capacity = plain_number(words[2])
    if not 0 <= capacity < np.inf:
        raise ValueError
    return _node(words[0], n_nodes), _node(words[1], n_nodes), capacity


def _gathered(
    n_nodes: int, source: int, sink: int, arcs: list[tuple[int, int, float]]
) -> CutProblem:
    inner = np.ones(n_nodes, np.bool_)
    inner[[source, sink]] = False
    place = np.cumsum(inner) - 1
    to_sink, from_source = np.zeros(n_nodes - 2), np.zeros(n_nodes - 2)
    between: dict[tuple[int, int], list[float]] = {}
    constant = 0.0
    for i, j, capacity in arcs:
        if j == source or i in (sink, j):
            continue
        if i == source and j == sink:
            constant += capacity
        elif i == source:
            from_source[place[j]] += capacity
        elif j == sink:
            to_sink[place[i]] += capacity
        else:
            first, second = int(place[i]), int(place[j])
            pair = between.setdefault((min(first, second), max(first, second)), [0.0, 0.0])
            pair[first > second] += capacity
    edges = np.array(list(between), np.int64).reshape(-1, 2)
    both = np.array(list(between.values()), np.float64).reshape(-1, 2)
    ahead, back = map(frozen, both.T)
    return CutProblem(frozen(from_source), frozen(to_sink), frozen(edges), ahead, back, constant)


def _text(capacity: float) -> str:
    """As whole a number as it is, with as many digits as it takes to read it back unchanged."""
    return str(int(capacity)) if capacity.is_integer() and capacity < 2**53 else repr(capacity)
