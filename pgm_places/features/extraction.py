"""The laser features of scans, computed for any choice of columns."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pgm_places._threads import run_tasks
from pgm_places.errors import InputError
from pgm_places.features._numpy_features import features
from pgm_places.features.beams import InvalidBeams, clean_beams, resample_beams
from pgm_places.features.laser import CANONICAL_BEAMS, LASER_FEATURES

__all__ = ["extract", "extract_one", "resample_beams"]

SCANS_PER_TASK = 256


def extract(
    ranges: ArrayLike,
    *,
    max_range_m: float,
    columns: Sequence[int] | None = None,
    n_threads: int | None = None,
    out: NDArray[np.float32] | None = None,
    invalid: InvalidBeams = "max-range",
) -> NDArray[np.float32]:
    """(N, F) features of N scans, one row a scan, one column for each entry of ``columns``."""
    array = np.asarray(ranges)
    chosen = _check_columns(columns)
    clean_beams(array[:1], max_range_m=max_range_m, invalid=invalid)
    result = _check_out(out, (len(array), len(chosen)))
    n_tasks = -(-len(array) // SCANS_PER_TASK)

    def work(task: int) -> None:
        part = slice(task * SCANS_PER_TASK, (task + 1) * SCANS_PER_TASK)
        clean = clean_beams(array[part], max_range_m=max_range_m, invalid=invalid)
        result[part] = features(resample_beams(clean, CANONICAL_BEAMS).astype(float))[:, chosen]

    run_tasks(work, n_tasks, n_threads=n_threads)
    return result


def extract_one(
    ranges: ArrayLike,
    *,
    max_range_m: float,
    columns: Sequence[int] | None = None,
    invalid: InvalidBeams = "max-range",
) -> NDArray[np.float32]:
    """(F,) features of one scan of M beams."""
    one = np.asarray(ranges)[np.newaxis]
    return extract(one, max_range_m=max_range_m, columns=columns, n_threads=1, invalid=invalid)[0]


def _check_columns(columns: Sequence[int] | None) -> NDArray[np.int64]:
    n_known = len(LASER_FEATURES)
    if columns is None:
        return np.arange(n_known)
    chosen = np.asarray(columns)
    if chosen.ndim != 1 or (chosen.size and chosen.dtype.kind not in "iu"):
        raise InputError(f"columns must be a sequence of column numbers, got {columns!r}")
    chosen = chosen.astype(np.int64)
    if ((chosen < 0) | (chosen >= n_known)).any():
        raise InputError(f"columns must lie in 0..{n_known - 1}, got {chosen.tolist()}")
    if len(np.unique(chosen)) != len(chosen):
        raise InputError(f"columns must not repeat, got {chosen.tolist()}")
    return chosen


def _check_out(out: NDArray[Any] | None, shape: tuple[int, int]) -> NDArray[np.float32]:
    if out is None:
        return np.empty(shape, np.float32)
    if out.shape != shape or out.dtype != np.float32 or not out.flags.writeable:
        raise InputError(
            f"out must be a writeable float32 array of shape {shape}, got {out.dtype} {out.shape}"
        )
    return out
