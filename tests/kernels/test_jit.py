"""Where compiled code is kept, and that it can also run uncompiled."""

import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from pgm_places.kernels.cache import cache_folder
from pgm_places.kernels.jit import fused, njit


def test_named_folder_is_used_and_private(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("PGM_PLACES_CACHE_DIR", str(tmp_path / "kernels"))
    assert cache_folder() == tmp_path / "kernels"
    if os.name == "posix":
        assert (tmp_path / "kernels").stat().st_mode & 0o077 == 0


@pytest.mark.skipif(os.name != "posix", reason="permissions are POSIX's")
def test_a_folder_that_others_may_write_is_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    shared = tmp_path / "shared"
    shared.mkdir()
    shared.chmod(0o777)
    monkeypatch.setenv("PGM_PLACES_CACHE_DIR", str(shared))
    assert cache_folder() is None


def test_no_folder_at_all_still_works(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    code = (
        "from pgm_places.kernels.jit import njit\n"
        "from pgm_places.kernels.cache import cache_folder\n"
        "assert cache_folder() is None\n"
        "@njit\n"
        "def twice(x):\n"
        "    return 2 * x\n"
        "assert twice(3) == 6\n"
    )
    environment = {**os.environ, "PGM_PLACES_CACHE_DIR": str(tmp_path / "file" / "below")}
    subprocess.run([sys.executable, "-c", code], check=True, env=environment)


def test_kernels_run_without_compiling() -> None:
    code = (
        "from pgm_places.kernels.jit import njit\n"
        "@njit\n"
        "def twice(x):\n"
        "    return 2 * x\n"
        "assert type(twice).__name__ == 'function' and twice(3) == 6\n"
    )
    environment = {**os.environ, "NUMBA_DISABLE_JIT": "1"}
    subprocess.run([sys.executable, "-c", code], check=True, env=environment)


@fused
def _last(array: NDArray[np.float64]) -> float:
    if array.ndim == 1:
        return array[-1]
    return array[-1, -1]


@njit
def _twice_the_last(array: NDArray[np.float64]) -> float:
    return 2.0 * _last(array)


def test_a_fused_helper_may_treat_arrays_by_their_number_of_axes() -> None:
    """The other branch would not even compile."""
    assert _twice_the_last(np.array([1.0, 2.0])) == 4.0
    assert _twice_the_last(np.array([[1.0, 2.0], [3.0, 5.0]])) == 10.0
