"""Every public call with every wrong thing: a right answer, or one line of the package's own."""

import itertools
import os
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import pgm_places as p
from pgm_places.errors import PgmPlacesError
from tests.right_calls import RightCall, Things, first_error, right_calls, things


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Things]:
    folder = tmp_path_factory.mktemp("made")
    before = Path.cwd()
    os.chdir(folder)
    yield things(folder)
    os.chdir(before)


@pytest.fixture(scope="module")
def calls(made: Things) -> list[RightCall]:
    return right_calls(made, Path.cwd())


def wrong_things(made: Things) -> dict[str, Any]:
    """The neighbours' types, other kinds of values, and arrays of other shapes and content."""
    masked = np.ma.masked_array(np.ones((3, 2)), np.eye(3)[:, :2] > 0)
    neighbours = {type(item).__name__: item for item in made}
    return {
        **neighbours,
        "the class itself": p.LabelGraph,
        "None": None,
        "a word": "room",
        "an empty word": "",
        "a path that is not there": Path("not/there.yaml"),
        "a path of a map": "map.yaml",
        "a whole number": 3,
        "a negative number": -1,
        "a half": 0.5,
        "NaN": float("nan"),
        "infinity": float("inf"),
        "True": True,
        "an empty list": [],
        "a list of names": ["a", "b"],
        "a list of None": [None],
        "a ragged list": [[0, 1], [2]],
        "a set": {"a", "b"},
        "a mapping": {"a": 1},
        "an object": object(),
        "a function": print,
        "a generator": (i for i in range(3)),
        "a list of graphs": [made.graph],
        "a pair of a map and labels": (made.grid, made.known.labels),
        "an array of three dimensions": np.zeros((3, 2, 2)),
        "an array of no dimension": np.array(1.0),
        "an array of NaN": np.full((3, 2), np.nan),
        "an array of names": np.array(["a", "b", "a"]),
        "an array of objects": np.array([None, made], dtype=object),
        "node numbers": np.array([0, 1, 2]),
        "huge numbers": np.array([0, 1, 10**9]),
        "complex numbers": np.ones((3, 2), complex),
        "a masked array": masked,
        "bytes": b"abc",
    }


def spoiled(calls: list[RightCall], made: Things) -> Iterator[tuple[str, Exception | None]]:
    """Every call with one argument wrong, or two swapped; what it raises."""
    for call in calls:
        for name in call.arguments:
            for what, wrong in wrong_things(made).items():
                yield f"{call.name}({name}={what})", first_error(call, **{name: wrong})
        names = list(call.arguments)
        for one, other in itertools.pairwise(names):
            swapped = {one: call.arguments[other], other: call.arguments[one]}
            yield f"{call.name}({one} and {other} swapped)", first_error(call, **swapped)


def test_right_calls_are_answered(calls: list[RightCall]) -> None:
    errors = {call.name: error for call in calls if (error := first_error(call)) is not None}
    assert errors == {}


@pytest.mark.filterwarnings("ignore")
def test_a_wrong_argument_is_answered_or_refused_in_one_line(
    calls: list[RightCall], made: Things
) -> None:
    internal, several_lines, n_calls = [], [], 0
    for what, error in spoiled(calls, made):
        n_calls += 1
        if error is not None and not isinstance(error, PgmPlacesError):
            internal.append(f"{what}: {type(error).__name__}: {error}")
        elif error is not None and "\n" in str(error):
            several_lines.append(f"{what}: {error}")
    assert n_calls > 8000
    assert (len(internal), internal) == (0, [])
    assert several_lines == []


def test_public_names_are_all_called(calls: list[RightCall]) -> None:
    called = {call.name.partition(".")[0].partition(" ")[0] for call in calls}
    rest = {"EdgeKind", "PgmPlacesError", "Status", "__version__"}
    assert set(p.__all__) - called == rest
