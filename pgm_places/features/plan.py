"""What has to be computed for a choice of columns: which kernels run, with which parameters."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from pgm_places.features.laser import (
    FOURIER_BETWEEN_CENTRES,
    FOURIER_FIRST_CENTRE,
    LASER_FEATURES,
)

__all__ = ["FeaturePlan", "FourierPlan", "Thresholds", "plan_features"]

Columns = NDArray[np.int64]


@dataclass(frozen=True, eq=False)
class Thresholds:
    """Parameters of one family, sorted, and the columns their results go to.

    ``columns`` is (P,) for one result a parameter, (P, 2) for two.
    """

    parameters: NDArray[np.float64]
    columns: Columns

    def __len__(self) -> int:
        return len(self.parameters)


@dataclass(frozen=True, eq=False)
class FourierPlan:
    """The cells (centre, step) that the wanted orders need; see the Fourier kernel.

    ``bounds`` (R + 1,) delimits the cells of each centre row, ``steps`` holds their steps,
    ``orders`` (O, 4) the order, its cell, its side of the centre and its column.
    """

    n_steps: int
    bounds: Columns
    steps: Columns
    orders: Columns


@dataclass(frozen=True, eq=False)
class FeaturePlan:
    """Which families are computed, None or False for those that are not."""

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
    """The parameters wanted of any of the families; ``also`` are results without a parameter."""
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
        np.array(parameters, np.float64), np.ascontiguousarray(table[:, 0]) if len(families) == 1 else table
    )


def _cell(order: int) -> tuple[int, int, int]:
    """Centre row, step number, and side of the centre of an order other than 0.

    Row ``2 j`` is the centre ``10.5 + 20 j``, row ``2 j + 1`` its mirror image.
    """
    group = (abs(order) - 1) // FOURIER_BETWEEN_CENTRES
    beyond = abs(order) - (FOURIER_FIRST_CENTRE + FOURIER_BETWEEN_CENTRES * group)
    row = 2 * group + (order < 0)
    side = 1 if (beyond > 0) == (order > 0) else -1
    return row, int(abs(beyond)), side


def _fourier(columns: tuple[int, ...]) -> FourierPlan | None:
    specs = [(column, LASER_FEATURES[column]) for column in columns]
    if not any(spec.id[:3] in {"f16", "f17", "f18", "f19"} for _, spec in specs):
        return None
    wanted = [(int(spec.parameter), column) for column, spec in specs if spec.id == "f16" and spec.parameter]
    cells = sorted({_cell(order)[:2] for order, _ in wanted if order != -1})
    number = {cell: k for k, cell in enumerate(cells)}
    orders = []
    for order, column in wanted:
        row, step, side = _cell(order)
        orders.append((order, number.get((row, step), 0), side, column))
    n_rows = 2 * (1 + max((row for row, _ in cells), default=-2) // 2)
    bounds = np.searchsorted([row for row, _ in cells], np.arange(n_rows + 1))
    return FourierPlan(
        n_steps=1 + max((step for _, step in cells), default=-1),
        bounds=bounds.astype(np.int64),
        steps=np.array([step for _, step in cells], np.int64),
        orders=np.array(orders, np.int64).reshape(len(orders), 4),
    )
