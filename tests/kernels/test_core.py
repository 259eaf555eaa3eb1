"""The compiled module: what its kernels accept, and that every kind of processor gives the same."""

import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from pgm_places import _core
from pgm_places.features.extraction import extract
from pgm_places.maps.clearance import squared_clearance
from pgm_places.maps.occupancy_grid import OccupancyGrid
from pgm_places.models.boosting_rounds import boost
from pgm_places.models.gentle_boosting import boost_trees
from pgm_places.models.sorted_features import prepare
from pgm_places.sensing.ray_casting import cast_cells
from pgm_places.sensing.sensor import Sensor, SensorNoise
from pgm_places.solvers.grid_relaxation import relax_grid
from tests.features.scans import rooms

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
    with pytest.raises(TypeError, match=r"fill_slots\(edges: array\[uint32, ndim=2\]"):
        _core.fill_slots(*arguments)


def test_only_what_is_written_has_to_be_writable() -> None:
    for at, array in enumerate(slots()):
        arguments = slots()
        arguments[at] = array
        array.flags.writeable = False
        if at == 0:
            _core.fill_slots(*arguments)
        else:
            with pytest.raises(TypeError, match="writable"):
                _core.fill_slots(*arguments)


def test_a_tuple_of_another_length_is_refused() -> None:
    store: Any = (np.zeros((1, 1), np.float32),)
    with pytest.raises(TypeError, match=r"copy_edges\(store: tuple\["):
        _core.copy_edges(store, 0, np.zeros((3, 2, 1, 1), np.float32))


@pytest.mark.parametrize("n_tables", [1, 8])
@pytest.mark.parametrize("n_labels", [1, 2, 3, 4, 7])
@pytest.mark.usefixtures("any_registers")
def test_registers_of_any_width_give_the_same_bits(n_labels: int, n_tables: int) -> None:
    rng = np.random.default_rng(n_labels)
    mask = rng.random((40, 50)) < 0.7
    cells = np.argwhere(mask).astype(np.int32)
    unary = rng.normal(size=(len(cells), n_labels))
    tables = rng.uniform(-1, 1, (n_tables, n_labels + 1, n_labels + 1))
    found = []
    for width in (16, 32, 64):
        _core.limit_registers(width)
        relaxed = relax_grid(unary, cells, mask.shape, tables, walls=~mask, max_iterations=5)
        found.append((relaxed.beliefs.tobytes(), relaxed.max_change, relaxed.support))
    assert found[0] == found[1] == found[2]


@pytest.mark.usefixtures("any_registers")
def test_registers_of_any_width_give_the_same_features() -> None:
    scans = rooms(3 * 16 - 5, seed=3)
    scans[0, 10:50] = np.nan
    some = [0, 3, 15, 40, 90, 107, 120, 121, 250, 306, 312, 320]
    found = []
    for width in (16, 32, 64):
        _core.limit_registers(width)
        parts = [extract(scans, max_range_m=30.0, columns=columns) for columns in (None, some)]
        found.append([part.tobytes() for part in parts])
    assert found[0] == found[1] == found[2]


@pytest.mark.usefixtures("any_registers")
def test_registers_of_any_width_give_the_same_ranges_and_distances() -> None:
    rng = np.random.default_rng(4)
    cells = np.where(rng.random((50, 70)) < 0.03, 100, 0).astype(np.int8)
    cells[20, :40] = 100
    sensor = Sensor(72, 8.0, noise=SensorNoise(0.1, 0.1, 0.1, seed=5))
    found = []
    for width in (16, 32, 64):
        _core.limit_registers(width)
        ranges = cast_cells(OccupancyGrid(cells, 0.05), sensor)
        found.append((ranges.tobytes(), squared_clearance(cells > 0).tobytes()))
    assert found[0] == found[1] == found[2]


def test_the_compiled_module_is_newer_than_its_sources() -> None:
    script = ROOT / "tools" / "core.py"
    code = f"import runpy, sys; sys.exit(not runpy.run_path({str(script)!r})['is_current']())"
    done = subprocess.run([sys.executable, "-c", code], check=False)
    assert done.returncode == 0, "a source in C++ has changed: run 'make core'"


@pytest.mark.parametrize("width", [5, 12, 40])
@pytest.mark.usefixtures("any_registers")
def test_registers_of_any_width_give_the_same_classifiers(width: int) -> None:
    rng = np.random.default_rng(width)
    X = rng.normal(size=(700, width)).astype(np.float32)
    y = (X[:, 0] + X[:, 4] * X[:, 2] > rng.normal(size=700)).astype(np.int64)
    found = []
    for bytes_wide in (16, 32, 64):
        _core.limit_registers(bytes_wide)
        prepared = prepare(X, y)
        stumps = boost(prepared, [1], [0], n_rounds=20)
        trees = [boost_trees(prepared, [1], [0], n_rounds=5, max_depth=d) for d in (2, 3, 4)]
        parts: list[np.ndarray] = [prepared.codes, stumps.threshold, stumps.alpha, stumps.scores(X)]
        parts += [part for tree in trees for part in (tree.cut, tree.value, tree.scores(X))]
        found.append([part.tobytes() for part in parts])
    assert found[0] == found[1] == found[2]
