"""Preparation of scans for features: filling missing returns, and resampling beams."""

import math
from typing import Any, Literal, get_args

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pgm_places._checks import require_at_least
from pgm_places.errors import InputError

InvalidBeams = Literal["max-range", "interpolate"]

JUMP_M = 0.5
"""Neighbouring beams that differ by more end on different obstacles and are not interpolated."""

MIN_BEAMS = 3


def check_ranges(ranges: ArrayLike) -> NDArray[Any]:
    """``ranges`` as an (N, M) array of float32 or float64 with at least three beams.

    Raises
    ------
    InputError
        If ``ranges`` is not a matrix of real numbers or has fewer than three beams.
    """
    array = np.asarray(ranges)
    if array.dtype.kind not in "fiu":
        raise InputError(f"ranges must be real numbers in metres, got dtype {array.dtype}")
    if array.ndim != 2 or array.shape[1] < MIN_BEAMS:
        raise InputError(
            f"ranges must have shape (scans, beams) with at least {MIN_BEAMS} beams, "
            f"got {array.shape}; pass a single scan as ranges[np.newaxis]"
        )
    if array.dtype in (np.float32, np.float64):
        return array
    return array.astype(np.float32 if array.dtype == np.float16 else np.float64)


def check_max_range(max_range_m: float) -> float:
    """``max_range_m`` if it is a positive finite number."""
    if not (math.isfinite(max_range_m) and max_range_m > 0):
        raise InputError(f"max_range_m must be a positive number of metres, got {max_range_m}")
    return float(max_range_m)


def clean_beams(
    ranges: ArrayLike, *, max_range_m: float, invalid: InvalidBeams = "max-range"
) -> NDArray[Any]:
    """(N, M) ranges in which every beam lies in [0, ``max_range_m``].

    A reading without a return is NaN, infinite, negative, or at least ``max_range_m``.

    Parameters
    ----------
    ranges : (N, M) float
        Beam lengths in metres.
    max_range_m : float
        The sensor's maximum range.
    invalid : {"max-range", "interpolate"}
        ``"max-range"`` makes such a beam ``max_range_m`` long; ``"interpolate"`` draws a straight
        line, over the beam's number, between the nearest beams with a return on both sides. A
        scan without any return becomes ``max_range_m`` everywhere.

    Raises
    ------
    InputError
        If an argument does not fit.

    Examples
    --------
    >>> clean_beams([[1.0, float("nan"), 3.0, 99.0]], max_range_m=30.0)
    array([[ 1., 30.,  3., 30.]])
    >>> clean_beams([[1.0, float("nan"), 3.0, 99.0]], max_range_m=30.0, invalid="interpolate")
    array([[1., 2., 3., 2.]])
    """
    array = check_ranges(ranges)
    limit = array.dtype.type(check_max_range(max_range_m))
    check_invalid(invalid)
    returned = (array >= 0) & (array < limit)
    clean = np.where(returned, array, limit)
    if invalid == "interpolate":
        beams = np.arange(array.shape[1])
        for scan in np.flatnonzero(returned.any(axis=1) & ~returned.all(axis=1)):
            valid = returned[scan]
            clean[scan, ~valid] = np.interp(
                beams[~valid], beams[valid], array[scan, valid], period=array.shape[1]
            )
    return clean


def check_invalid(invalid: str) -> None:
    """Refuse an unknown way of treating beams without a return."""
    if invalid not in get_args(InvalidBeams):
        raise InputError(f"invalid must be one of {get_args(InvalidBeams)}, got {invalid!r}")


def resample_beams(ranges: ArrayLike, n_beams: int) -> NDArray[Any]:
    """(N, ``n_beams``) ranges of the scans at equally spaced angles, with the same first angle.

    Fewer beams: the nearest beam is taken. More beams: linear interpolation over the angle, except
    between neighbours more than 0.5 m apart, where the nearest beam is taken. Of two equally near
    beams the shorter one counts, so that mirrored scans give mirrored results.

    Parameters
    ----------
    ranges : (N, M) float
        Clean beam lengths in metres over the full circle.
    n_beams : int
        Number of beams wanted, at least three.

    Raises
    ------
    InputError
        If an argument does not fit.

    Examples
    --------
    >>> resample_beams([[1.0, 1.2, 4.0, 1.0]], 8)
    array([[1. , 1.1, 1.2, 1.2, 4. , 1. , 1. , 1. ]])
    """
    array = check_ranges(ranges)
    require_at_least("n_beams", n_beams, MIN_BEAMS)
    n_given = array.shape[1]
    if n_beams == n_given:
        return array
    low, remainder = np.divmod(np.arange(n_beams) * n_given, n_beams)
    before, after = array[:, low], array[:, (low + 1) % n_given]
    nearest = np.where(2 * remainder < n_beams, before, after)
    nearest = np.where(2 * remainder == n_beams, np.minimum(before, after), nearest)
    if n_beams < n_given:
        return nearest
    weight = (remainder / n_beams).astype(array.dtype)
    line = before + weight * (after - before)
    return np.where(np.abs(after - before) > JUMP_M, nearest, line)
