"""Kernel plan: which feature kernels run, with which parameters, for a selection of columns."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from pgm_places.features.laser import LASER_FEATURES

FOURIER_REACH = 14
"""Orders are reached from the centres 0, +-29, +-58, +-87 by steps of up to 14."""

FOURIER_BLOCK = 5
"""Steps from one centre per block of the kernel; a rest of three or four is padded."""

Columns = NDArray[np.int64]


class Thresholds(NamedTuple):
    """Parameters of a family, sorted, and the columns of their results."""

    parameters: NDArray[np.float64]
    """(P,)."""
    columns: Columns
    """(P,) for one result a parameter, (P, 2) for two."""


class FourierPlan(NamedTuple):
    """The cells (centre, step) for the requested orders; see the Fourier kernel."""

    n_steps: int
    """The largest step."""
    bounds: Columns
    """(R + 1,) the cells of centre row ``r`` are ``bounds[r]..bounds[r + 1] - 1``."""
    steps: Columns
    """The step of each cell."""
    orders: Columns
    """(O, 4) an order, its cell, 1 for centre + step or -1 for centre - step, its column."""


@dataclass(frozen=True, eq=False)
class FeaturePlan:
    """The families to compute; None or False for others."""

    columns: Columns
    spread: bool
    cuts: Thresholds | None
    gaps: Thresholds | None
    ratios: Thresholds | None
    minima: Thresholds | None
    outline: bool
    centroid: bool
    moments: bool
    fourier: FourierPlan | None


def plan_features(columns: Sequence[int]) -> FeaturePlan:
    """The plan for the columns of the table of features, in this order.

    Examples
    --------
    >>> plan = plan_features((0, 14, 15))
    >>> plan.spread, plan.gaps.parameters, plan.outline
    (True, array([0.5, 1. ]), False)
    """
    return _cached_plan(tuple(columns))


@lru_cache(maxsize=64)
def _cached_plan(columns: tuple[int, ...]) -> FeaturePlan:
    wanted = {LASER_FEATURES[column].id for column in columns}
    centroid = bool(wanted & {"f9", "f9_sd", "f29", "f29_sd"})
    moments = bool(wanted & {"f21", "f22", "f23"})
    fourier = _fourier(columns)
    return FeaturePlan(
        columns=np.array(columns, np.int64),
        spread=bool(wanted & {"f2", "f2_sd", "f8", "f8_sd", "f28", "f28_sd", "f32"}),
        cuts=_thresholds(columns, ("f3",)),
        gaps=_thresholds(columns, ("f14", "f33")),
        ratios=_thresholds(columns, ("f30", "f34"), descending=True, also=("f27", "f27_sd")),
        minima=_thresholds(columns, ("f25", "f26")),
        outline=centroid
        or moments
        or fourier is not None
        or bool(wanted & {"f5", "f6", "f7", "f31"}),
        centroid=centroid,
        moments=moments,
        fourier=fourier,
    )


@lru_cache(maxsize=1)
def _column_of() -> dict[tuple[str, float | int | None], int]:
    return {(spec.id, spec.parameter): column for column, spec in enumerate(LASER_FEATURES)}


def _thresholds(
    columns: tuple[int, ...],
    families: tuple[str, ...],
    *,
    descending: bool = False,
    also: tuple[str, ...] = (),
) -> Thresholds | None:
    """The requested parameters of the families; ``also`` are results without a parameter."""
    specs = [LASER_FEATURES[column] for column in columns]
    parameters = sorted(
        {spec.parameter for spec in specs if spec.id in families and spec.parameter is not None},
        reverse=descending,
    )
    if not parameters and not any(spec.id in also for spec in specs):
        return None
    rows = [[_column_of()[family, p] for family in families] for p in parameters]
    table = np.array(rows, np.int64).reshape(len(parameters), len(families))
    return Thresholds(
        np.array(parameters, np.float64),
        np.ascontiguousarray(table[:, 0]) if len(families) == 1 else table,
    )


def _cell(order: int) -> tuple[int, int, int]:
    """Centre row, step and side of the centre of an order.

    Row 0 is the centre 0, row ``2 g - 1`` the centre ``(2 R + 1) g`` with the reach ``R``, and row
    ``2 g`` its mirror image.
    """
    span = 2 * FOURIER_REACH + 1
    group = (abs(order) + FOURIER_REACH) // span
    beyond = abs(order) - span * group
    row = 0 if group == 0 else 2 * group - (order > 0)
    side = 1 if (beyond > 0) == (order > 0) else -1
    return row, abs(beyond), side


def _filled(steps: set[int]) -> list[int]:
    """The steps of one centre, padded to full blocks if that is faster than single steps."""
    rest = len(steps) % FOURIER_BLOCK
    if rest >= 3:
        spare = (step for step in range(FOURIER_REACH + 1) if step not in steps)
        steps = steps | {next(spare) for _ in range(FOURIER_BLOCK - rest)}
    return sorted(steps)


def _fourier(columns: tuple[int, ...]) -> FourierPlan | None:
    specs = [(column, LASER_FEATURES[column]) for column in columns]
    if not any(spec.id[:3] in {"f16", "f17", "f18", "f19"} for _, spec in specs):
        return None
    wanted = [
        (int(spec.parameter), column)
        for column, spec in specs
        if spec.id == "f16" and spec.parameter is not None
    ]
    # orders 1 and -1 are summed separately
    needed = [_cell(order)[:2] for order, _ in wanted if order != -1]
    n_rows = 1 + max((row for row, _ in needed), default=-1)
    rows = [_filled({step for r, step in needed if r == row}) for row in range(n_rows)]
    number = {
        (row, step): k
        for k, (row, step) in enumerate((r, step) for r in range(n_rows) for step in rows[r])
    }
    orders = []
    for order, column in wanted:
        row, step, side = _cell(order)
        orders.append((order, number.get((row, step), 0), side, column))
    return FourierPlan(
        n_steps=max((step for _, step in number), default=0),
        bounds=np.cumsum([0, *map(len, rows)]),
        steps=np.array([step for _, step in number], np.int64),
        orders=np.array(orders, np.int64).reshape(len(orders), 4),
    )
