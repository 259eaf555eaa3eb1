"""The table of the 321 geometric features of a laser scan: names, parameters, definitions.

A scan is ``M`` beams at the angles ``2 pi i / M`` around the sensor with lengths ``rho_i`` in
metres, indices modulo ``M``; every feature is a number that does not change when the robot turns
on the spot. ``D_i = |rho_i - rho_{i+1}|``, ``q_i = min(a, b) / max(a, b)`` with
``a = rho_i + 1e-4`` and ``b = rho_{i+1} + 1e-4``. The polygon joins the beams' end points, has the
area ``A``, the perimeter ``L`` and the Fourier coefficients ``c_n`` of its outline as a function of
arc length. Means and standard deviations divide by ``M``.
"""

import hashlib
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache, lru_cache, partial
from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

CANONICAL_BEAMS = 360
"""Features are computed on this many beams: counts and differences depend on their number."""

DEFINITIONS_VERSION = 1
"""Incremented when a definition changes, so that stored models are refused."""

CUT_LENGTHS_M = (5, 10, 15, 20, 25, 30, 35, 40, 45, 50)
GAP_LENGTHS_M = tuple(k / 2 for k in range(1, 21))
GAP_RATIOS = tuple(k / 10 for k in range(1, 11))
PROMINENCES_M = tuple(k / 10 for k in range(1, 11))
FOURIER_ORDERS = (*range(-100, 0), *range(2, 101))
HU_INVARIANTS = (1, 2, 3, 4, 5, 6, 7)

_CODE = "Mozos' published code and its parameter list"
_CODE_ONLY = "Mozos' published code (not in its parameter list)"
_CUTS = "formula: Mozos' published code; cut lengths: a later port, extended"
_MINIMA = "name, purpose and parameters: Mozos' published code; search: this package"
_NEGATIVE = "formula: Mozos' published code; negative orders: this package"


@dataclass(frozen=True, slots=True)
class FeatureSpec:
    """One feature: its short name, parameter, definition and where the definition comes from.

    Examples
    --------
    >>> FeatureSpec("f14", 0.5, "beams", "number of i with D_i > t", "example").name
    'f14[0.5]'
    """

    id: str  # name of the family, as in the author's code (``f14``)
    # threshold in metres, ratio, or order; None where the family has one member
    parameter: float | int | None
    # ``"beams"`` (computed on the raw beams) or ``"polygon"`` (on the polygon they span)
    group: Literal["beams", "polygon"]
    # the formula; ``t`` stands for a threshold, ``d`` for a prominence, ``n``, ``k`` for orders
    definition: str
    source: str  # the source of the definition and its parameters

    @property
    def name(self) -> str:
        """The column's name: ``f2_sd``, ``f14[0.5]``, ``f16[-3]``."""
        return self.id if self.parameter is None else f"{self.id}[{self.parameter}]"


def _family(
    group: Literal["beams", "polygon"],
    id: str,
    definition: str,
    source: str = _CODE,
    parameters: Sequence[float | int | None] = (None,),
) -> list[FeatureSpec]:
    return [FeatureSpec(id, value, group, definition, source) for value in parameters]


_beams, _polygon = partial(_family, "beams"), partial(_family, "polygon")
LASER_FEATURES: tuple[FeatureSpec, ...] = (
    *_beams("f2", "mean of D_i"),
    *_beams("f2_sd", "standard deviation of D_i"),
    *_beams("f3", "mean of |min(rho_i, t) - min(rho_{i+1}, t)|", _CUTS, CUT_LENGTHS_M),
    *_beams("f8", "mean of rho_i"),
    *_beams("f8_sd", "standard deviation of rho_i"),
    *_beams("f14", "number of i with D_i > t", _CODE, GAP_LENGTHS_M),
    *_beams("f33", "f14[t] / (M - 1)", _CODE, GAP_LENGTHS_M),
    *_beams("f30", "number of i with q_i < t", _CODE, GAP_RATIOS),
    *_beams("f34", "f30[t] / (M - 1)", _CODE, GAP_RATIOS),
    *_beams("f27", "mean of q_i"),
    *_beams("f27_sd", "standard deviation of q_i"),
    *_beams("f28", "mean of rho_i / max rho"),
    *_beams("f28_sd", "standard deviation of rho_i / max rho"),
    *_beams("f32", "kurtosis: mean of (rho_i - f8)^4, over f8_sd^4"),
    *_beams(
        "f25",
        "distance between the end points of the lowest minimum and of the lowest other "
        "minimum whose prominence is at least d",
        _MINIMA,
        PROMINENCES_M,
    ),
    *_beams(
        "f26", "angle between the beams of the same two minima, in [0, pi]", _MINIMA, PROMINENCES_M
    ),
    *_polygon("f5", "area A"),
    *_polygon("f6", "perimeter L, the closing edge included"),
    *_polygon("f7", "L / A"),
    *_polygon("f9", "mean distance from the area's centroid to the vertices"),
    *_polygon("f9_sd", "standard deviation of those distances"),
    *_polygon("f29", "mean of those distances over the largest"),
    *_polygon("f29_sd", "f9_sd over the largest of those distances"),
    *_polygon("f31", "4 pi A / L^2"),
    *_polygon("f16", "|c_n| / |c_1|", _NEGATIVE, [n for n in FOURIER_ORDERS if n < 0]),
    *_polygon("f16", "|c_n| / |c_1|", _CODE, [n for n in FOURIER_ORDERS if n > 0]),
    *_polygon("f17", "major axis of the Fourier ellipse: |c_1| + |c_-1|"),
    *_polygon("f18", "minor axis of the Fourier ellipse: ||c_1| - |c_-1||"),
    *_polygon("f19", "f18 / f17"),
    *_polygon("f17_2", "f17 / |c_1|"),
    *_polygon("f18_2", "f18 / |c_1|"),
    *_polygon("f19_2", "f18_2 / f17_2"),
    *_polygon(
        "f21",
        "sign(h_k) log10(1 + |h_k| / 1e-12) of Hu's k-th invariant of the area moments",
        _CODE_ONLY,
        HU_INVARIANTS,
    ),
    *_polygon("f22", "compactness A^2 / (2 pi (mu_20 + mu_02))", _CODE_ONLY),
    *_polygon(
        "f23", "eccentricity sqrt((mu_20 - mu_02)^2 + 4 mu_11^2) / (mu_20 + mu_02)", _CODE_ONLY
    ),
)
"""The 321 features in the order of their columns."""


@cache
def laser_feature_names() -> tuple[str, ...]:
    """The names of the 321 columns, in order.

    Examples
    --------
    >>> names = laser_feature_names()
    >>> len(names), names[0], names[99]
    (321, 'f2', 'f5')
    """
    return tuple(spec.name for spec in LASER_FEATURES)


@cache
def feature_set_hash() -> str:
    """Hexadecimal digest that changes with the columns, their order or their definitions."""
    text = "\n".join((f"{DEFINITIONS_VERSION} {CANONICAL_BEAMS}", *laser_feature_names()))
    return hashlib.sha256(text.encode()).hexdigest()


def _repeats(spec: FeatureSpec) -> bool:
    """Whether the feature is a monotone image of an earlier column on every scan.

    ``f33`` and ``f34`` are ``f14`` and ``f30`` over a constant; ``f19``, ``f17_2``, ``f18_2`` and
    ``f19_2`` are functions of ``f16[-1]`` alone while ``|c_-1| < |c_1|``; ``f22`` is the
    reciprocal of Hu's first invariant up to a constant.
    """
    return spec.id in {"f33", "f34", "f19", "f17_2", "f18_2", "f19_2", "f22"}


def distinct_features(max_range_m: float | None = None) -> tuple[int, ...]:
    """Columns that remain when monotone repetitions of earlier columns are left out.

    Linear models need this: with the repetitions their columns are linearly dependent. Stumps do
    not. 286 of 321 columns remain; with ``max_range_m``, the cuts ``f3[t]`` at or beyond it, which
    repeat ``f2``, are left out, too.

    Examples
    --------
    >>> len(distinct_features()), len(distinct_features(max_range_m=30.0))
    (286, 281)
    """
    return tuple(
        column
        for column, spec in enumerate(LASER_FEATURES)
        if not _repeats(spec) and not _cut_never_reached(spec, max_range_m)
    )


def _cut_never_reached(spec: FeatureSpec, max_range_m: float | None) -> bool:
    if spec.id != "f3" or max_range_m is None or spec.parameter is None:
        return False
    return spec.parameter >= max_range_m


def first_column(id: str) -> int:
    """The first column of a family."""
    return next(column for column, spec in enumerate(LASER_FEATURES) if spec.id == id)


FOURIER_REACH = 14
"""Orders are reached from the centres 0, +-29, +-58, +-87 by steps of up to 14."""

FOURIER_BLOCK = 5
"""Steps from one centre per block of the kernel; a rest of three or four is padded."""

Columns = NDArray[np.int64]


class Thresholds(NamedTuple):
    """Parameters of a family, sorted, and the columns of their results."""

    parameters: NDArray[np.float64]  # (P,)
    columns: Columns  # (P,) for one result a parameter, (P, 2) for two


class FourierPlan(NamedTuple):
    """The cells (centre, step) for the requested orders; see the Fourier kernel."""

    n_steps: int  # the largest step
    bounds: Columns  # (R + 1,) the cells of centre row ``r`` are ``bounds[r]..bounds[r + 1] - 1``
    steps: Columns  # the step of each cell
    # (O, 4) an order, its cell, 1 for centre + step or -1 for centre - step, its column.
    orders: Columns


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
    """The plan for the columns of the table of features, in this order."""
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
    """Centre row, step and side of the centre of an order; ``R`` is the reach.

    Row 0 is the centre 0, row ``2 g - 1`` the centre ``(2 R + 1) g``, row ``2 g`` its mirror image.
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
