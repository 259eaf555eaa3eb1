"""KeptField: mean field on one raster again and again, where little changes from time to time."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pgm_places._core import update_rows
from pgm_places.kernels.threads import run_parts

MAX_BYTES = 1 << 28
"""Passes of larger fields (some 1,100,000 cells of three labels and 20 passes) are not kept."""

_ROWS_PER_TASK = 32


@dataclass(frozen=True, eq=False)
class Rule:
    """All that beliefs follow from beside the unaries; ``start`` (H + 1,) has rows' first nodes."""

    table: NDArray[np.float64]
    cells: NDArray[np.int32]
    start: NDArray[np.int64]
    reach: int
    damping: float

    def same(self, other: "Rule") -> bool:
        """Whether passes by one are passes by the other."""
        return (
            (self.reach, self.damping) == (other.reach, other.damping)
            and np.array_equal(self.table, other.table)
            and np.array_equal(self.cells, other.cells)
        )


class KeptField:
    """What every pass of a mean field left, so that the next solution updates only what differs.

    A row of cells is updated in a pass if its own unaries have changed, or if a row that it looks
    at holds other beliefs than it did then. All others would see the very same numbers and keep
    those that they were given, so beliefs, labels and history are the same to the bit as if all
    rows had been updated, however far a change spreads.

    Examples
    --------
    >>> from pgm_places.solvers.grid_mean_field import grid_mean_field
    >>> cells, table = [(row, 0) for row in range(50)], np.eye(2)
    >>> unary = np.tile([1.0, 0.0], (50, 1))
    >>> field = KeptField()
    >>> with kept_in(field):
    ...     first = grid_mean_field(unary, cells, table)
    ...     unary[49] = 0.0, 9.0
    ...     second = grid_mean_field(unary, cells, table)
    >>> alone = grid_mean_field(unary, cells, table)
    >>> bool((second.beliefs == alone.beliefs).all())
    True
    """

    def __init__(self) -> None:
        self._rule: Rule | None = None
        self._unary = np.empty((0, 0))
        self._passes: list[NDArray[np.float32]] = []  # at the start, and after each pass
        self._changes: list[NDArray[np.float64]] = []  # (H,) the largest in each row of a pass
        self.n_updated = 0

    def solved(
        self,
        rule: Rule,
        unary: NDArray[np.float64],
        begun: Callable[[NDArray[np.float64]], NDArray[np.float32]],
        repeated: Callable[[Callable[[int], float]], list[float]],
        n_threads: int,
    ) -> tuple[NDArray[np.float32], list[float]]:
        """The beliefs (N, K) after the last pass, and the largest change of each pass.

        ``begun`` makes beliefs of unaries, and ``repeated`` makes passes, given their number, until
        their changes are small. ``n_updated`` then says how many rows were updated in all passes.
        """
        start, n_rows = rule.start, len(rule.start) - 1
        dirty = self._changed_rows(rule, unary)
        self._rule = None  # until all passes belong to these unaries
        self._unary = unary.copy()
        for row in np.flatnonzero(dirty).tolist():
            nodes = slice(start[row], start[row + 1])
            self._passes[0][nodes] = begun(unary[nodes])
        self.n_updated = 0
        differs = dirty.copy()  # the rows whose beliefs are not those that were kept

        def update(done: int) -> float:
            number = done + 1
            if number == len(self._passes):  # nobody has come so far
                self._passes.append(np.empty_like(self._passes[0]))
                self._changes.append(np.zeros(n_rows))
                differs[:] = True
            for parity in (0, 1):
                reached = differs.copy()
                reached[:-1] |= differs[1:]
                reached[1:] |= differs[:-1]
                rows = np.flatnonzero(reached | dirty)
                rows = rows[rows % 2 == parity]
                differs[rows] = self._updated(rule, number, rows, n_threads)
                self.n_updated += len(rows)
            return float(self._changes[done].max(initial=0.0))

        history = repeated(update)
        del self._passes[len(history) + 1 :], self._changes[len(history) :]
        self._rule = rule
        return self._passes[-1].copy(), history

    def _changed_rows(self, rule: Rule, unary: NDArray[np.float64]) -> NDArray[np.bool_]:
        """(H,) the rows with other unaries than before; all where something else is different."""
        n_rows = len(rule.start) - 1
        if self._rule is None or not self._rule.same(rule) or self._unary.shape != unary.shape:
            self._passes, self._changes = [np.empty(unary.shape, np.float32)], []
            return np.ones(n_rows, np.bool_)
        changed = np.zeros(n_rows, np.bool_)
        nodes = np.flatnonzero(self._unary.ravel() != unary.ravel()) // unary.shape[1]
        changed[rule.cells[nodes, 0]] = True
        return changed

    def _updated(
        self, rule: Rule, number: int, rows: NDArray[np.int64], n_threads: int
    ) -> NDArray[np.bool_]:
        """Update rows (n,) that do not touch; whether each holds other beliefs than it did."""
        differs = np.empty(len(rows), np.bool_)

        def some(part: slice) -> None:
            differs[part] = [self._updated_row(rule, number, row) for row in rows[part].tolist()]

        run_parts(some, len(rows), _ROWS_PER_TASK, n_threads=n_threads)
        return differs

    def _updated_row(self, rule: Rule, number: int, row: int) -> bool:
        """Update a row; whether it holds other beliefs than it did after this pass."""
        before, after = self._passes[number - 1], self._passes[number]
        above = max(row - 1, 0)
        starts = rule.start[above : row + 3]
        first, last = int(starts[0]), int(starts[-1])
        own = slice(int(rule.start[row]), int(rule.start[row + 1]))
        # Rows of odd number look at what the same pass has made of those of even number.
        beliefs = (after if row % 2 else before)[first:last].copy()
        local = slice(own.start - first, own.stop - first)
        beliefs[local] = before[own]
        self._changes[number - 1][row] = update_rows(
            self._unary[first:last],
            rule.table,
            rule.cells[first:last],
            starts - first,
            row - above,
            row - above + 1,
            rule.reach,
            rule.damping,
            beliefs,
        )
        if np.array_equal(beliefs[local], after[own]):
            return False
        after[own] = beliefs[local]
        return True


_FIELD: ContextVar[KeptField | None] = ContextVar("kept field", default=None)


@contextmanager
def kept_in(field: KeptField) -> Iterator[None]:
    """Mean fields on rasters that are solved inside keep their passes, and start from those kept.

    A context rather than an argument: between a labeler and its solver lie methods and decoders
    that need not know of it.
    """
    token = _FIELD.set(field)
    try:
        yield
    finally:
        _FIELD.reset(token)


def current_field(n_nodes: int, n_labels: int, max_iterations: int) -> KeptField | None:
    """The field to keep passes in; None where nobody wants them, or they would be too large."""
    n_bytes = 4 * n_nodes * n_labels * (max_iterations + 1)
    return _FIELD.get() if 0 < n_bytes <= MAX_BYTES else None
