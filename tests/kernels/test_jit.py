"""Where compiled code is kept, and that it can also run uncompiled."""

import os
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from pgm_places._version import __version__
from pgm_places.kernels.cache import cache_folder
from pgm_places.kernels.jit import fused, njit, ready


def test_named_folder_is_used_and_private(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("PGM_PLACES_CACHE_DIR", str(tmp_path / "kernels"))
    assert cache_folder() == tmp_path / "kernels"
    if os.name == "posix":
        assert (tmp_path / "kernels").stat().st_mode & 0o077 == 0


@pytest.mark.skipif(os.name != "posix", reason="permissions are POSIX's")
@pytest.mark.parametrize("mode", [0o777, 0o770, 0o750, 0o701])
def test_a_folder_that_is_not_private_is_refused(
    mode: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    shared = tmp_path / "shared"
    shared.mkdir()
    shared.chmod(mode)
    monkeypatch.setenv("PGM_PLACES_CACHE_DIR", str(shared))
    with pytest.warns(RuntimeWarning, match="shared is not private.*chmod 700"):
        assert cache_folder() is None


@njit
def _add_to(values: NDArray[np.float64], amount: float) -> None:
    for k in range(len(values)):
        values[k] += amount


def test_a_ready_call_can_be_made_again_with_what_the_arguments_hold_then() -> None:
    values = np.zeros(3)
    call = ready(_add_to, values, 2.0)
    assert values.tolist() == [0.0, 0.0, 0.0]
    call()
    values[1] = 10.0
    call()
    assert values.tolist() == [4.0, 12.0, 4.0]


KERNEL = """\
from pgm_places.kernels.compiling import dispatcher_of
from pgm_places.kernels.jit import njit

@njit
def twice(x):
    return 2 * x

@njit
def thrice(x):
    return 3 * x

if __name__ == "__main__":
    print(twice(3), thrice(3), sum(dispatcher_of(twice).stats.cache_hits.values()))
"""


ASK_NUMBA = {"NUMBA_OPT": "3"}
"""Its default; but with any such variable, code is read and written by numba alone."""


def run_kernels(folder: Path) -> tuple[str, str]:
    """What a process with two kernels prints, and its warnings; the cache is in the folder."""
    if not (folder / "kernels.py").exists():
        (folder / "kernels.py").write_text(KERNEL)
    ended = subprocess.run(
        [sys.executable, folder / "kernels.py"],
        capture_output=True,
        text=True,
        env={**os.environ, **ASK_NUMBA, "PGM_PLACES_CACHE_DIR": str(folder / "cache")},
        check=True,
    )
    return ended.stdout, ended.stderr


def cut(content: bytes) -> bytes:
    return content[: len(content) // 2]


def flip(content: bytes) -> bytes:
    middle = len(content) * 3 // 4
    return content[:middle] + bytes([content[middle] ^ 1]) + content[middle + 1 :]


@pytest.fixture(scope="module")
def kept(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with the two kernels and their code; whoever damages it has it mended."""
    folder = tmp_path_factory.mktemp("kept")
    assert run_kernels(folder) == ("6 9 0\n", "")
    return folder


def test_each_version_has_a_cache_of_its_own(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    for variable in ("PGM_PLACES_CACHE_DIR", "NUMBA_CACHE_DIR"):
        monkeypatch.delenv(variable, raising=False)
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    monkeypatch.setattr(sys, "platform", "linux")
    assert cache_folder() == tmp_path / "pgm_places" / f"kernels-{__version__}"


@pytest.mark.parametrize("ending", ["nbi", "nbc"])
@pytest.mark.parametrize("damage", [cut, flip])
def test_damaged_code_is_compiled_anew(
    ending: str, damage: Callable[[bytes], bytes], kept: Path
) -> None:
    damaged = list((kept / "cache").rglob(f"*.{ending}"))
    assert len(damaged) == 2
    for path in damaged:
        path.write_bytes(damage(path.read_bytes()))
    out, warned = run_kernels(kept)
    assert out == "6 9 0\n"
    assert warned.count("RuntimeWarning") <= 1  # an index that is none is simply written anew
    if ending == "nbc":
        assert "are damaged and compiled anew" in warned
    assert run_kernels(kept) == ("6 9 1\n", "")


FULL = """\
import errno, os, numba.core.caching
def full(*_):
    raise OSError(errno.ENOSPC, "No space left on device")
numba.core.caching.os.replace = full
import runpy, sys
runpy.run_path(sys.argv[1], run_name="__main__")
"""


def test_a_full_disk_is_one_warning(tmp_path: Path) -> None:
    (tmp_path / "kernels.py").write_text(KERNEL)
    ended = subprocess.run(
        [sys.executable, "-c", FULL, tmp_path / "kernels.py"],
        capture_output=True,
        text=True,
        env={**os.environ, "PGM_PLACES_CACHE_DIR": str(tmp_path / "cache")},
        check=True,
    )
    assert ended.stdout == "6 9 0\n"
    assert ended.stderr.count("RuntimeWarning: compiled kernels cannot be kept in") == 1


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
