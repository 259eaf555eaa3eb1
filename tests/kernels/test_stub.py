"""What mypy is told of the compiled kernels."""

import runpy
from pathlib import Path

STUB = runpy.run_path(str(Path(__file__).parents[2] / "tools" / "stub.py"))

SIGNATURES = """
import enum

@overload
def sum_of(rows: array[float32, ndim=2], limit: float) -> float: ...

@overload
def sum_of(rows: array[float32, ndim=3], limit: float) -> float: ...

@overload
def fill(at: int, out: array[uint8, ndim=1, writable]) -> None: ...

@overload
def fill(at: int, out: array[bool, ndim=1, writable]) -> None: ...

def found_in(rows: array[float64, ndim=2]) -> tuple[array, array]: ...
"""


def test_arrays_are_told_in_the_words_of_numpy() -> None:
    told = STUB["with_numpy_types"](SIGNATURES).removeprefix(STUB["HEAD"])
    assert told.splitlines() == [
        "def sum_of(rows: NDArray[numpy.float32], limit: float | numpy.floating) -> float: ...",
        "@overload",
        "def fill(at: int | numpy.integer, out: NDArray[numpy.uint8]) -> None: ...",
        "@overload",
        "def fill(at: int | numpy.integer, out: NDArray[numpy.bool]) -> None: ...",
        "def found_in(rows: NDArray[numpy.float64]) -> tuple[NDArray[Any], NDArray[Any]]: ...",
    ]
