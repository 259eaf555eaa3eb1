"""The laser features of scans, computed for any choice of columns."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pgm_places._lanes import LANES, aligned_planes
from pgm_places._threads import run_tasks
from pgm_places.errors import InputError
from pgm_places.features._beam_kernels import (
    cut_features,
    gap_features,
    ratio_features,
    spread_features,
)
from pgm_places.features._fourier_kernels import WORK_ROWS, fourier_features
from pgm_places.features._minima_kernels import minima_features
from pgm_places.features._polygon_kernels import (
    SHAPE_ROWS,
    centroid_features,
    moment_features,
    outline_features,
)
from pgm_places.features._tile_kernels import load_tiles, write_rows
from pgm_places.features.beams import (
    InvalidBeams,
    check_invalid,
    check_max_range,
    check_ranges,
    clean_beams,
    resample_beams,
)
from pgm_places.features.laser import CANONICAL_BEAMS, LASER_FEATURES
from pgm_places.features.plan import FeaturePlan, plan_features

__all__ = ["extract", "extract_one", "resample_beams"]

TILES_PER_GROUP = 4
"""Tiles that one kernel call handles: their planes stay in the second-level cache."""

SCANS_PER_GROUP = TILES_PER_GROUP * LANES
GROUPS_PER_TASK = 4


def _directions() -> NDArray[np.float64]:
    angles = 2.0 * np.pi * np.arange(CANONICAL_BEAMS) / CANONICAL_BEAMS
    return np.column_stack([np.cos(angles), np.sin(angles)])


def _chords() -> NDArray[np.float64]:
    """``4 sin(a / 2)^2`` for the angle ``a`` of 0, 1, 2, ... half beams, up to half a turn."""
    return 4.0 * np.sin(np.pi * np.arange(CANONICAL_BEAMS + 1) / (2.0 * CANONICAL_BEAMS)) ** 2


DIRECTIONS = _directions()
CHORDS = _chords()


def _planes64(rows: int) -> Any:
    return field(default_factory=lambda: aligned_planes(rows, np.float64))


def _planes32(rows: int) -> Any:
    return field(default_factory=lambda: aligned_planes(rows, np.float32))


@dataclass(frozen=True, eq=False)
class _Workspace:
    """The planes that one thread works in; about a megabyte."""

    rho: NDArray[np.float64] = _planes64(TILES_PER_GROUP * CANONICAL_BEAMS)
    edges: NDArray[np.float64] = _planes64(TILES_PER_GROUP * CANONICAL_BEAMS)
    shape: NDArray[np.float64] = _planes64(TILES_PER_GROUP * SHAPE_ROWS)
    values: NDArray[np.float32] = _planes32(TILES_PER_GROUP * len(LASER_FEATURES))
    left: NDArray[np.float64] = _planes64(CANONICAL_BEAMS)
    sums: NDArray[np.float64] = _planes64(32)
    found: NDArray[np.float64] = _planes64(8)
    turns: NDArray[np.float32] = _planes32(WORK_ROWS)
    cells: NDArray[np.float32] = _planes32(400)


def extract(
    ranges: ArrayLike,
    *,
    max_range_m: float,
    columns: Sequence[int] | NDArray[np.integer] | None = None,
    n_threads: int | None = None,
    out: NDArray[np.float32] | None = None,
    invalid: InvalidBeams = "max-range",
) -> NDArray[np.float32]:
    """(N, F) features of N scans, one row a scan, one column for each entry of ``columns``."""
    array = check_ranges(ranges)
    limit = float(array.dtype.type(check_max_range(max_range_m)))
    check_invalid(invalid)
    plan = plan_features(_check_columns(columns))
    result = _check_out(out, (len(array), len(plan.columns)))
    ready = invalid == "max-range" and array.shape[1] == CANONICAL_BEAMS
    per_task = GROUPS_PER_TASK * SCANS_PER_GROUP
    idle: list[_Workspace] = []

    def work(task: int) -> None:
        space = idle.pop() if idle else _Workspace()
        first, last = task * per_task, min((task + 1) * per_task, len(array))
        scans = array[first:last]
        if not ready:
            scans = clean_beams(scans, max_range_m=max_range_m, invalid=invalid)
            scans = resample_beams(scans, CANONICAL_BEAMS)
        for start in range(0, len(scans), SCANS_PER_GROUP):
            stop = min(start + SCANS_PER_GROUP, len(scans))
            load_tiles(scans, start, stop, limit, space.rho)
            n_tiles = -(-(stop - start) // LANES)
            _beam_families(plan, space, n_tiles)
            _polygon_families(plan, space, n_tiles)
            write_rows(space.values, plan.columns, start, stop, result[first:last])
        idle.append(space)

    run_tasks(work, -(-len(array) // per_task), n_threads=n_threads)
    return result


def _beam_families(plan: FeaturePlan, space: _Workspace, n_tiles: int) -> None:
    rho, values = space.rho, space.values
    if plan.spread:
        spread_features(rho, n_tiles, values)
    if plan.cuts is not None:
        cut_features(rho, n_tiles, plan.cuts.parameters, plan.cuts.columns, values)
    if plan.gaps is not None:
        gap_features(rho, n_tiles, plan.gaps.parameters, plan.gaps.columns, space.sums, values)
    if plan.ratios is not None:
        bounds = plan.ratios
        ratio_features(rho, n_tiles, bounds.parameters, bounds.columns, space.sums, values)
    if plan.minima is not None:
        minima = plan.minima
        minima_features(
            rho,
            n_tiles,
            minima.parameters,
            minima.columns,
            CHORDS,
            space.left,
            space.found,
            space.sums,
            values,
        )


def _polygon_families(plan: FeaturePlan, space: _Workspace, n_tiles: int) -> None:
    rho, values, shape = space.rho, space.values, space.shape
    if plan.outline:
        outline_features(rho, n_tiles, DIRECTIONS, space.edges, shape, values)
    if plan.centroid:
        centroid_features(rho, n_tiles, DIRECTIONS, shape, values)
    if plan.moments:
        moment_features(rho, n_tiles, DIRECTIONS, shape, space.found, values)
    if plan.fourier is not None:
        fourier = plan.fourier
        fourier_features(
            rho,
            n_tiles,
            DIRECTIONS,
            space.edges,
            shape,
            fourier.n_steps,
            fourier.bounds,
            fourier.steps,
            fourier.orders,
            space.found,
            space.turns,
            space.cells,
            values,
        )


def extract_one(
    ranges: ArrayLike,
    *,
    max_range_m: float,
    columns: Sequence[int] | NDArray[np.integer] | None = None,
    invalid: InvalidBeams = "max-range",
) -> NDArray[np.float32]:
    """(F,) features of one scan of M beams."""
    one = np.asarray(ranges)[np.newaxis]
    return extract(one, max_range_m=max_range_m, columns=columns, n_threads=1, invalid=invalid)[0]


def _check_columns(columns: Sequence[int] | NDArray[np.integer] | None) -> tuple[int, ...]:
    n_known = len(LASER_FEATURES)
    if columns is None:
        return tuple(range(n_known))
    chosen = np.asarray(columns)
    if chosen.ndim != 1 or (chosen.size and chosen.dtype.kind not in "iu"):
        raise InputError(f"columns must be a sequence of column numbers, got {columns!r}")
    numbers = tuple(int(column) for column in chosen)
    if any(not 0 <= column < n_known for column in numbers):
        raise InputError(f"columns must lie in 0..{n_known - 1}, got {list(numbers)}")
    if len(set(numbers)) != len(numbers):
        raise InputError(f"columns must not repeat, got {list(numbers)}")
    return numbers


def _check_out(out: NDArray[Any] | None, shape: tuple[int, int]) -> NDArray[np.float32]:
    if out is None:
        return np.empty(shape, np.float32)
    if out.shape != shape or out.dtype != np.float32 or not out.flags.writeable:
        raise InputError(
            f"out must be a writeable float32 array of shape {shape}, got {out.dtype} {out.shape}"
        )
    return out
