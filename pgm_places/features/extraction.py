"""The laser features of scans for any choice of columns, after missing returns are filled."""

import math
import threading
from collections.abc import Sequence
from typing import Any, Literal, get_args

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pgm_places import _core
from pgm_places._checks import require_at_least
from pgm_places.errors import InputError
from pgm_places.features.laser import CANONICAL_BEAMS, LASER_FEATURES, FeaturePlan, plan_features
from pgm_places.kernels.threads import run_parts

InvalidBeams = Literal["max-range", "interpolate"]

JUMP_M = 0.5
"""Neighbouring beams that differ by more end on different obstacles and are not interpolated."""

MIN_BEAMS = 3


def check_ranges(ranges: ArrayLike) -> NDArray[Any]:
    """``ranges`` as an (N, M) array of float32 or float64 with at least three beams.

    InputError: if ``ranges`` is not a matrix of real numbers or has fewer than three beams.
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

    ``ranges`` (N, M): beam lengths in metres. ``max_range_m``: the sensor's maximum range.
    ``invalid``: ``"max-range"`` makes such a beam ``max_range_m`` long; ``"interpolate"`` draws a
    straight line, over the beam's number, between the nearest beams with a return on both sides. A
    scan without any return becomes ``max_range_m`` everywhere.

    InputError: if an argument does not fit.

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

    ``ranges`` (N, M): clean beam lengths in metres over the full circle. ``n_beams``: number of
    beams wanted, at least three.

    InputError: if an argument does not fit.

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


__all__ = ["ScanExtractor", "Workspace", "extract", "extract_one", "resample_beams"]


N_BEAMS = CANONICAL_BEAMS

N_FEATURES = len(LASER_FEATURES)

LANES = 16

TILE_ROWS = N_BEAMS + 1
"""Rows of a tile: row ``TILE_ROWS tile + k`` holds beam ``k`` of its scans; beam 360 is beam 0."""

SHAPE_ROWS = 4
"""Rows of a tile in ``shape``: area, perimeter and centroid, for later kernels."""


_CACHE_LINE_BYTES = 64


def aligned_planes(rows: int, dtype: Any) -> NDArray[Any]:
    """(rows, 16) uninitialised array on whole cache lines, so that no vector straddles two."""
    size = rows * LANES * np.dtype(dtype).itemsize
    raw = np.empty(size + _CACHE_LINE_BYTES, np.uint8)
    start = -raw.ctypes.data % _CACHE_LINE_BYTES
    return raw[start : start + size].view(dtype).reshape(rows, LANES)


class Workspace:
    """Buffers for a number of tiles, about 0.1 MB each.

    ``rho`` holds the beams, ``edges`` and ``shape`` the shared results of the polygon's kernels,
    ``values`` the features; the others are scratch of single kernels.
    """

    def __init__(self, n_tiles: int) -> None:
        self.rho = aligned_planes(n_tiles * TILE_ROWS, np.float64)
        self.edges = aligned_planes(n_tiles * TILE_ROWS, np.float64)
        self.shape = aligned_planes(n_tiles * SHAPE_ROWS, np.float64)
        self.values = aligned_planes(n_tiles * N_FEATURES, np.float32)
        self.ahead = aligned_planes(N_BEAMS + 1, np.float64)
        self.kept = aligned_planes(N_BEAMS + 1, np.float64)
        self.series = aligned_planes(_core.fourier_rows(), np.float32)
        self.beams = np.zeros(N_BEAMS + 1, np.int64)


Columns = Sequence[int] | NDArray[np.integer]

TILES_PER_GROUP = 8
"""Tiles per kernel call: their buffers, about a megabyte, fit into a near cache."""

SCANS_PER_GROUP = TILES_PER_GROUP * LANES

SCANS_PER_TASK = 2 * SCANS_PER_GROUP


ALL_COLUMNS = tuple(range(N_FEATURES))

_ANGLES = 2.0 * np.pi * (np.arange(TILE_ROWS) % N_BEAMS) / N_BEAMS
DIRECTIONS = np.column_stack([np.cos(_ANGLES), np.sin(_ANGLES)])

CHORDS = 4.0 * np.sin(np.pi * np.arange(N_BEAMS + 1) / (2.0 * N_BEAMS)) ** 2
"""``4 sin(a / 2)^2`` for the angle ``a`` of 0, 1, 2, ... half beams, up to half a turn."""


def extract(
    ranges: ArrayLike,
    *,
    max_range_m: float,
    columns: Columns | None = None,
    out: NDArray[np.float32] | None = None,
    invalid: InvalidBeams = "max-range",
) -> NDArray[np.float32]:
    """(N, F) features of N scans, one row a scan, one column for each entry of ``columns``.

    Parameters
    ----------
    ranges : (N, M) float32 or float64
        Beam lengths in metres, beam ``i`` at the angle ``2 pi i / M``, over the full circle.
        Scans of other than 360 beams are resampled to 360 first: see ``resample_beams``.
    max_range_m : float
        The sensor's maximum range. Beams that are NaN, infinite, negative or at least as long have
        no return.
    columns : sequence of F int, optional
        Which columns of ``LASER_FEATURES`` to compute, without repetition, in any order; all 321
        by default. Only these are computed, and a value has the same bits with any selection of
        columns.
    out : (N, F) float32, optional
        Receives the result.
    invalid : {"max-range", "interpolate"}
        Beams without a return count as ``max_range_m`` long, or lie on a straight line between
        their neighbours with a return: see ``clean_beams``.

    Raises
    ------
    InputError
        If an argument does not fit.

    Definitions are in ``LASER_FEATURES`` and the manual; an undefined feature of a scan (division
    by an area of 0, say) is 0, never NaN. Values are computed in float64 and rounded to float32,
    except the sums of ``f16``, which are float32. Memory beyond the result is about a megabyte for
    each thread.

    Examples
    --------
    >>> import numpy as np
    >>> circle = np.full((1, 360), 2.0)
    >>> from pgm_places.features.laser import laser_feature_names
    >>> names = laser_feature_names()
    >>> area, compactness = names.index("f5"), names.index("f22")
    >>> extract(circle, max_range_m=30.0, columns=[area, compactness]).round(3)
    array([[12.566,  1.   ]], dtype=float32)
    """
    array = check_ranges(ranges)
    limit = float(array.dtype.type(check_max_range(max_range_m)))
    check_invalid(invalid)
    plan = plan_features(_check_columns(columns))
    result = _check_out(out, (len(array), len(plan.columns)), array)
    as_they_are = invalid == "max-range" and array.shape[1] == N_BEAMS
    n_tiles = min(TILES_PER_GROUP, -(-len(array) // LANES))
    idle: list[Workspace] = []

    def work(part: slice) -> None:
        space = idle.pop() if idle else _workspace(n_tiles)
        scans = array[part]
        if not as_they_are:
            scans = clean_beams(scans, max_range_m=max_range_m, invalid=invalid)
            scans = resample_beams(scans, N_BEAMS)
        rows = result[part]
        contiguous = rows if rows.flags.c_contiguous else np.empty(rows.shape, np.float32)
        _extract_part(np.ascontiguousarray(scans), limit, plan, space, contiguous)
        if contiguous is not rows:
            rows[:] = contiguous
        idle.append(space)

    run_parts(work, len(array), SCANS_PER_TASK)
    return result


def extract_one(
    ranges: ArrayLike,
    *,
    max_range_m: float,
    columns: Columns | None = None,
    invalid: InvalidBeams = "max-range",
) -> NDArray[np.float32]:
    """(F,) features of one scan of M beams, with the same bits as ``extract``.

    Examples
    --------
    >>> import numpy as np
    >>> extract_one(np.full(720, 2.0), max_range_m=30.0, columns=[12])
    array([2.], dtype=float32)
    """
    scan = np.asarray(ranges)
    if scan.ndim != 1:
        raise InputError(f"ranges of one scan must have shape (beams,), got {scan.shape}")
    rows = extract(scan[np.newaxis], max_range_m=max_range_m, columns=columns, invalid=invalid)
    return rows[0]


class ScanExtractor:
    """Extractor for a sequence of single scans, with reused buffers; not thread-safe.

    Parameters
    ----------
    columns : sequence of F int
        As in :func:`extract`.
    max_range_m : float
        The sensor's maximum range.
    """

    def __init__(self, columns: Columns, *, max_range_m: float) -> None:
        self._plan = plan_features(_check_columns(columns))
        self._max_range_m = check_max_range(max_range_m)
        self._limit = float(np.float32(self._max_range_m))
        self._space = Workspace(1)

    def features(self, scan: NDArray[np.float32]) -> NDArray[np.float32]:
        """(F,) features of a scan (M,), with the same bits as :func:`extract`."""
        if scan.shape != (N_BEAMS,) or scan.dtype != np.float32:
            columns = self._plan.columns
            return extract_one(scan, max_range_m=self._max_range_m, columns=columns)
        rows = np.empty((1, len(self._plan.columns)), np.float32)
        scans = np.ascontiguousarray(scan)[np.newaxis]
        _extract_part(scans, self._limit, self._plan, self._space, rows)
        return rows[0]


class _OfThread(threading.local):
    """The buffers for one tile of each thread; allocating them takes longer than a feature."""

    def __init__(self) -> None:
        self.space = Workspace(1)


_of_thread = _OfThread()


def _workspace(n_tiles: int) -> Workspace:
    return _of_thread.space if n_tiles == 1 else Workspace(n_tiles)


def _extract_part(
    scans: NDArray[Any],
    limit: float,
    plan: FeaturePlan,
    space: Workspace,
    rows: NDArray[np.float32],
) -> None:
    for start in range(0, len(scans), SCANS_PER_GROUP):
        stop = min(start + SCANS_PER_GROUP, len(scans))
        _core.load_tiles(scans, start, stop, limit, space.rho)
        n_tiles = -(-(stop - start) // LANES)
        _beam_families(plan, space, n_tiles)
        _polygon_families(plan, space, n_tiles)
        _core.write_rows(space.values, plan.columns, start, stop, rows)


def _beam_families(plan: FeaturePlan, space: Workspace, n_tiles: int) -> None:
    rho, values = space.rho, space.values
    if plan.spread:
        _core.spread_features(rho, n_tiles, values)
    if plan.cuts is not None:
        _core.cut_features(rho, n_tiles, *plan.cuts, values)
    if plan.gaps is not None:
        _core.gap_features(rho, n_tiles, *plan.gaps, space.kept, values)
    if plan.ratios is not None:
        _core.ratio_features(rho, n_tiles, *plan.ratios, space.kept, values)
    if plan.minima is not None:
        scratch = space.ahead, space.kept, space.beams
        _core.minima_features(rho, n_tiles, plan.minima, CHORDS, scratch, values)


def _polygon_families(plan: FeaturePlan, space: Workspace, n_tiles: int) -> None:
    rho, values, shape = space.rho, space.values, space.shape
    if plan.outline:
        _core.outline_features(rho, n_tiles, DIRECTIONS, space.edges, shape, values)
    if plan.centroid:
        _core.centroid_features(rho, n_tiles, DIRECTIONS, shape, values)
    if plan.moments:
        _core.moment_features(rho, n_tiles, DIRECTIONS, shape, values)
    if plan.fourier is not None:
        outline = rho, DIRECTIONS, space.edges, shape
        _core.fourier_features(outline, n_tiles, plan.fourier, space.series, values)


def _check_columns(columns: Columns | None) -> tuple[int, ...]:
    if columns is None:
        return ALL_COLUMNS
    chosen = np.asarray(columns)
    if chosen.ndim != 1 or (chosen.size and chosen.dtype.kind not in "iu"):
        raise InputError(f"columns must be a sequence of column numbers, got {columns!r}")
    numbers = tuple(chosen.tolist())
    if chosen.size and not (chosen.min() >= 0 and chosen.max() < N_FEATURES):
        raise InputError(f"columns must lie in 0..{N_FEATURES - 1}, got {list(numbers)}")
    if len(set(numbers)) != len(numbers):
        raise InputError(f"columns must not repeat, got {list(numbers)}")
    return numbers


def _check_out(
    out: NDArray[Any] | None, shape: tuple[int, int], ranges: NDArray[Any]
) -> NDArray[np.float32]:
    if out is None:
        return np.empty(shape, np.float32)
    if out.shape != shape or out.dtype != np.float32 or not out.flags.writeable:
        raise InputError(
            f"out must be a writeable float32 array of shape {shape}, got {out.dtype} {out.shape}"
        )
    if np.may_share_memory(out, ranges):
        raise InputError("out must not share memory with ranges, which are never modified")
    return out
