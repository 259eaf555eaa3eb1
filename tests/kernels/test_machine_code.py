"""Machine code that is called without numba gives what numba gives, or numba is asked."""

import hashlib
import json
import os
import shutil
import subprocess
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any, NamedTuple

import numba
import numpy as np
import pytest

from pgm_places.kernels.argument_kinds import description, kinds_of
from pgm_places.kernels.machine_code import _machine
from tests.kernels.test_jit import cut, flip

KERNELS = """\
from typing import NamedTuple

import numpy as np
from helper import factor
from pgm_places.kernels.jit import inlined, njit
from pgm_places.kernels.lanes import load, store


class Pair(NamedTuple):
    first: np.ndarray
    second: float


@inlined
def _scaled(x):
    return factor(x) * x


@njit
def scaled(pair, out):
    for i in range(out.shape[0]):
        out[i] = _scaled(pair.first[i]) + pair.second


@njit
def doubled(planes):
    out = np.empty_like(planes)
    for row in range(planes.shape[0]):
        store(out, row, load(planes, row) * 2.0)
    return out


@njit
def checked(x):
    if x < 0:
        raise ValueError("negative")
    return x, 2 * x, x > 1


@njit
def total(values):
    sum = 0
    for value in values:
        sum += value
    return sum
"""

HELPER = """\
from pgm_places.kernels.jit import fused


@fused
def factor(x):
    return 3.0
"""

MAIN = """\
import sys
import numpy as np
from kernels import Pair, checked, doubled, scaled, total

out = np.zeros(2)
scaled(Pair(np.array([1.0, 2.0]), 0.5), out)
print(out, doubled(np.ones((1, 16)))[0, :2], checked(3), checked(np.float32(0.5)))
try:
    checked(-1)
except ValueError as error:
    print(error)
print(total(np.arange(4)), total(np.arange(8)[::2]), "numba" in sys.modules)
"""

SAID = "[3.5 6.5] [2. 2.] (3, 6, True) (0.5, 1.0, False)\nnegative\n6 12 "
COMPILED, STORED = (f"{SAID}True\n", ""), (f"{SAID}False\n", "")

only_where_tried = pytest.mark.skipif(
    _machine() is None, reason="numba itself keeps the code here (another system, or NUMBA_...)"
)


PROGRAMS = {"kernels": KERNELS, "helper": HELPER, "main": MAIN}


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Two modules with kernels, a program that has called them, and what is kept of that."""
    folder = tmp_path_factory.mktemp("kernels")
    for name, text in {
        **PROGRAMS,
        "later": LATER,
        "earlier": EARLIER,
        "references": REFERENCES,
    }.items():
        (folder / f"{name}.py").write_text(text)
    assert run(folder) == COMPILED
    return folder


def run(folder: Path, program: str = "main.py", **changes: str) -> tuple[str, str]:
    """What the program prints, and its warnings."""
    ended = subprocess.run(
        [sys.executable, folder / program],
        capture_output=True,
        text=True,
        env={**os.environ, "PGM_PLACES_CACHE_DIR": str(folder / "cache"), **changes},
        check=True,
    )
    return ended.stdout, ended.stderr


@only_where_tried
def test_a_second_process_does_the_same_without_numba(folder: Path) -> None:
    assert run(folder) == STORED
    assert run(folder, NUMBA_OPT="3") == COMPILED  # a variable that could change the code


@only_where_tried
def test_a_change_of_any_file_that_a_kernel_calls_into_is_seen(folder: Path) -> None:
    (folder / "helper.py").write_text(HELPER.replace("3.0", "10.0"))
    changed = run(folder)
    (folder / "helper.py").write_text(HELPER)
    assert changed == (COMPILED[0].replace("[3.5 6.5]", "[10.5 20.5]"), "")
    assert run(folder) == COMPILED


@only_where_tried
def test_what_numba_has_kept_by_itself_is_taken_over(folder: Path) -> None:
    shutil.rmtree(folder / "cache" / "code")
    assert run(folder) == COMPILED
    assert run(folder) == STORED


@only_where_tried
@pytest.mark.parametrize("damage", [cut, flip])
def test_damaged_code_is_never_run(damage: Callable[[bytes], bytes], folder: Path) -> None:
    stored = sorted((folder / "cache" / "code").glob("checked-*"))
    assert len(stored) == 2
    for path in stored:
        path.write_bytes(damage(path.read_bytes()))
    out, warned = run(folder)
    assert out == COMPILED[0]
    assert warned.count("RuntimeWarning: compiled kernels in") == 1
    assert run(folder) == STORED


@only_where_tried
@pytest.mark.parametrize(
    "foreign",
    [
        ["eval", ["1"], None],
        ["SystemExit", None, None],
        ["os.system", ["true"], None],
        ["ValueError", [["nested"]], None],
        ["ValueError"],
        "int",
        5,
    ],
)
def test_code_that_asks_for_other_objects_is_compiled_anew(foreign: Any, folder: Path) -> None:
    stored = sorted((folder / "cache" / "code").glob("checked-*"))
    before = [path.read_bytes() for path in stored]
    for path, kept in zip(stored, before, strict=True):
        header, _, body = kept[:-32].partition(b"\n")
        told = json.loads(header)
        told["objects"] = dict.fromkeys(told["objects"], foreign)
        content = json.dumps(told).encode() + b"\n" + body
        path.write_bytes(content + hashlib.sha256(content).digest())
    assert run(folder) == COMPILED
    assert [path.read_bytes() for path in stored] == before


LATER = """\
import main
import numba
from kernels import doubled, total
import numpy as np

@numba.njit
def twice(x):
    return 2 * x

print(twice(4), doubled(np.ones((2, 16), np.float32))[1, 0], total(np.arange(3.0)))
"""


@only_where_tried
def test_numba_may_be_imported_later(folder: Path) -> None:
    assert run(folder, "later.py") == (f"{STORED[0]}8 2.0 3.0\n", "")


EARLIER = """\
import numba
import numpy as np

numba.njit(lambda n: np.ones(n))(1)  # from now on numba has told the linker of its functions
import main

@numba.njit
def zeros(n):
    if n < 0:
        raise ValueError("below zero")
    return np.zeros(n)

print(zeros(2))
try:
    zeros(-1)
except ValueError as error:
    print(error)
"""


@only_where_tried
def test_code_that_numba_links_afterwards_gets_its_objects_from_numba(folder: Path) -> None:
    stored = STORED[0].replace("False\n", "True\n")  # numba has been imported
    assert run(folder, "earlier.py") == (f"{stored}[0. 0.]\nbelow zero\n", "")


REFERENCES = """\
import sys
import numpy as np
from kernels import doubled

planes = np.ones((1, 16))
doubled(planes)
before = sys.getrefcount(planes), sys.getrefcount(planes.dtype)
for _ in range(1000):
    doubled(planes)
after = sys.getrefcount(planes), sys.getrefcount(planes.dtype)
print([b - a for a, b in zip(before, after)], "numba" in sys.modules)
"""


@only_where_tried
def test_calls_leave_no_references_behind(folder: Path) -> None:
    assert run(folder, "references.py") == ("[0, 0] False\n", "")


class Left(NamedTuple):
    value: Any


class Right(NamedTuple):
    value: Any


def values() -> Iterator[Any]:
    """One value and more of everything that kernels are called with."""
    for dtype in (np.float64, np.float32, np.int64, np.int32, np.int8, np.uint8, np.bool_):
        yield dtype(1)
        for shape in ((3,), (1, 4), (4, 1), (4, 6), (2, 3, 4), (0, 3), ()):
            array = np.zeros(shape, dtype)
            frozen = array.copy()
            frozen.flags.writeable = False
            yield from (array, frozen, array.T, np.asfortranarray(array))
            if array.ndim:
                yield from (array[::2], array[..., ::2])
    shifted = np.zeros(33, np.uint8)[1:].view(np.float64)
    yield from (shifted, 1, -1, 1.0, True, None)
    array, vector = np.zeros((2, 2)), np.zeros(2)
    yield from (Left(array), Right(array), Left(vector), Left(Left(array)))
    yield from ((1, 2.0), (1, 2), (1.0, 2), (1, 2, 3), ((1, 2), 3), (array, vector))


def test_kinds_tell_apart_what_numba_compiles_anew_for() -> None:
    found = [(kinds_of((value,)), numba.typeof(value), value) for value in values()]
    for kinds, of_numba, value in found:
        for other_kinds, other_of_numba, other in found:
            assert (kinds == other_kinds) == (of_numba == other_of_numba), (value, other)


def test_descriptions_tell_apart_what_kinds_do() -> None:
    kinds = {kinds_of((value,)) for value in values()}
    words = [description(kind) for kind in kinds if kind is not None]
    assert None not in words
    assert len(set(words)) == len(words)


def test_numbers_in_the_order_of_another_processor_are_left_to_numba() -> None:
    kinds = kinds_of((np.zeros(3, ">f8"),))
    assert kinds is not None
    assert description(kinds) is None


@pytest.mark.parametrize("value", ["text", [1], {}, 1j, slice(3), (1, "text"), np.ma.zeros(3)])
def test_what_only_numba_knows_has_no_kind(value: Any) -> None:
    assert kinds_of((value,)) is None
