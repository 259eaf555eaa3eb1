"""The compiled module: what its kernels accept, and that every kind of processor gives the same."""

import subprocess
import sys
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from pgm_places import OccupancyGrid, Sensor, SensorNoise, _core
from pgm_places.features.extraction import extract
from pgm_places.maps.components import squared_clearance
from pgm_places.models.boosting_rounds import boost, boost_trees
from pgm_places.models.sorted_features import prepare
from pgm_places.sensing.ray_casting import cast_cells
from pgm_places.solvers.grid_relaxation import relax_grid
from tests.features.scans import rooms
from tests.refusals import refused

ROOT = Path(__file__).resolve().parent.parent.parent


def slots() -> list[np.ndarray]:
    """The arguments of a kernel for three nodes in a row."""
    edges = np.array([[0, 1], [1, 2]], np.uint32)
    return [edges, np.zeros(3, np.uint32), *(np.zeros(4, np.uint32) for _ in range(3))]


def test_a_kernel_writes_into_its_arguments() -> None:
    edges, room, start, head, arc = slots()
    _core.fill_slots(edges, room, start, head, arc)
    assert start.tolist() == [0, 1, 3, 4]
    assert head.tolist() == [1, 0, 2, 1]
    assert arc.tolist() == [0, 1, 2, 3]


@pytest.mark.parametrize(
    "spoil",
    [
        lambda array: array.astype(np.int32),
        lambda array: array.astype(np.float32),
        lambda array: array.astype(np.uint64),
        lambda array: array.astype(">u4"),
        lambda array: np.stack([array, array]),
        lambda array: np.repeat(array, 2)[::2],
        lambda array: array.tolist(),
        lambda array: None,
    ],
    ids=["int", "float", "wider", "big-endian", "dimensions", "strides", "list", "none"],
)
@pytest.mark.parametrize("at", [0, 3])
def test_an_array_of_another_kind_is_refused_and_never_converted(spoil: object, at: int) -> None:
    arguments = slots()
    arguments[at] = spoil(arguments[at])  # type: ignore[operator]
    refused(TypeError, r"fill_slots\(edges: array\[uint32, ndim=2\]", _core.fill_slots, *arguments)


def test_only_what_is_written_has_to_be_writable() -> None:
    for at, array in enumerate(slots()):
        arguments = slots()
        arguments[at] = array
        array.flags.writeable = False
        if at == 0:
            _core.fill_slots(*arguments)
        else:
            refused(TypeError, "writable", _core.fill_slots, *arguments)


def test_a_tuple_of_another_length_is_refused() -> None:
    store: Any = (np.zeros((1, 1), np.float32),)
    with pytest.raises(TypeError, match=r"copy_edges\(store: tuple\["):
        _core.copy_edges(store, 0, np.zeros((3, 2, 1, 1), np.float32))


def test_the_compiled_module_is_newer_than_its_sources() -> None:
    script = ROOT / "tools" / "core.py"
    code = f"import runpy, sys; sys.exit(not runpy.run_path({str(script)!r})['is_current']())"
    done = subprocess.run([sys.executable, "-c", code], check=False)
    assert done.returncode == 0, "a source in C++ has changed: run 'make core'"


def relaxed(n_labels: int, n_tables: int) -> list[Any]:
    rng = np.random.default_rng(n_labels)
    mask = rng.random((40, 50)) < 0.7
    cells = np.argwhere(mask).astype(np.int32)
    unary = rng.normal(size=(len(cells), n_labels))
    tables = rng.uniform(-1, 1, (n_tables, n_labels + 1, n_labels + 1))
    found = relax_grid(unary, cells, mask.shape, tables, walls=~mask, max_iterations=5)
    return [found.beliefs, found.max_change, found.support]


def laser_features() -> list[Any]:
    scans = rooms(3 * 16 - 5, seed=3)
    scans[0, 10:50] = np.nan
    some = [0, 3, 15, 40, 90, 107, 120, 121, 250, 306, 312, 320]
    return [extract(scans, max_range_m=30.0, columns=columns) for columns in (None, some)]


def ranges_and_distances() -> list[Any]:
    cells = np.where(np.random.default_rng(4).random((50, 70)) < 0.03, 100, 0).astype(np.int8)
    cells[20, :40] = 100
    sensor = Sensor(72, 8.0, noise=SensorNoise(0.1, 0.1, 0.1, seed=5))
    return [cast_cells(OccupancyGrid(cells, 0.05), sensor), squared_clearance(cells > 0)]


def classifiers(width: int) -> list[Any]:
    rng = np.random.default_rng(width)
    X = rng.normal(size=(700, width)).astype(np.float32)
    y = (X[:, 0] + X[:, 4] * X[:, 2] > rng.normal(size=700)).astype(np.int64)
    prepared = prepare(X, y)
    stumps = boost(prepared, [1], [0], n_rounds=20)
    found: list[Any] = [prepared.codes, stumps.threshold, stumps.alpha, stumps.scores(X)]
    for depth in (2, 3, 4):
        tree = boost_trees(prepared, [1], [0], n_rounds=5, max_depth=depth)
        found += [tree.cut, tree.value, tree.scores(X)]
    return found


COMPUTED: dict[str, Callable[[], list[Any]]] = {
    **{f"relaxed {k}, {n}": partial(relaxed, k, n) for k in (1, 2, 3, 4, 7) for n in (1, 8)},
    "features": laser_features,
    "ranges and distances": ranges_and_distances,
    **{f"classifiers {width}": partial(classifiers, width) for width in (5, 12, 40)},
}


@pytest.mark.parametrize("name", COMPUTED)
@pytest.mark.usefixtures("any_registers")
def test_registers_of_any_width_give_the_same_bits(name: str) -> None:
    found = []
    for width in (16, 32, 64):
        _core.limit_registers(width)
        found.append([np.asarray(part).tobytes() for part in COMPUTED[name]()])
    assert found[0] == found[1] == found[2]
