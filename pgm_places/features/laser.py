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
from functools import cache, partial
from typing import Literal

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

    Parameters
    ----------
    id
        Name of the family, as in the author's code (``f14``).
    parameter
        Threshold in metres, ratio, or order; None where the family has one member.
    group
        ``"beams"`` (computed on the raw beams) or ``"polygon"`` (on the polygon they span).
    definition
        The formula; ``t`` stands for a threshold, ``d`` for a prominence, ``n``, ``k`` for orders.
    source
        The source of the definition and its parameters.

    Examples
    --------
    >>> FeatureSpec("f14", 0.5, "beams", "number of i with D_i > t", "example").name
    'f14[0.5]'
    """

    id: str
    parameter: float | int | None
    group: Literal["beams", "polygon"]
    definition: str
    source: str

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
