"""Memory that goes back to the system piece by piece, and arrays that wait in files."""

import sys
from pathlib import Path

import numpy as np
import pytest

from pgm_places.kernels.lazy_memory import MappedPlanes, drop_pages, set_aside

LINUX = pytest.mark.skipif(sys.platform != "linux", reason="pages are given back on Linux")


def resident_bytes() -> int:
    pages = int(Path("/proc/self/statm").read_text().split()[1])
    return pages * 4096


@LINUX
def test_what_is_given_up_is_freed_and_the_rest_stays() -> None:
    planes = MappedPlanes((2, 8_000_000), np.float32)
    assert not planes.array[:, ::1000].any()
    planes.array[:] = np.arange(8_000_000) % 1000
    full = resident_bytes()
    planes.release(0, 3_000_000)
    planes.release(3_000_000, 6_000_001)
    assert full - resident_bytes() > 45_000_000  # of 64 million
    rest = planes.array[:, 6_000_001:]
    assert (rest == np.arange(6_000_001, 8_000_000) % 1000).all()


def test_there_may_be_nothing_to_give_up() -> None:
    planes = MappedPlanes((0, 5), np.float32)
    planes.release(0, 5)
    assert planes.array.shape == (0, 5)


@LINUX
def test_arrays_wait_in_a_file_that_has_no_name(tmp_path: Path) -> None:
    values = np.random.default_rng(0).random((300_000, 3), np.float32)
    waiting = set_aside(values, tmp_path, at_least=1)
    assert isinstance(waiting, np.memmap) and not list(tmp_path.iterdir())
    part = np.asarray(waiting)[1000:]
    assert (part == values[1000:]).all()
    before = resident_bytes()
    drop_pages(part)
    assert before - resident_bytes() > values.nbytes / 2
    assert (waiting == values).all()  # read once more


def test_small_arrays_and_those_without_room_stay(tmp_path: Path) -> None:
    values = np.ones(10)
    assert set_aside(values, tmp_path) is values
    assert set_aside(values, tmp_path / "missing", at_least=1) is values
    drop_pages(values)
    assert values.all()
