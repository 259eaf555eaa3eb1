"""OpenGM's HDF5 files; h5py is an extra."""

import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from pgm_places.errors import InputError
from pgm_places.inference.factor_graph import FactorGraph
from pgm_places.io.networks.opengm import read_opengm, write_opengm
from tests.inference.test_factor_graph import random_factors


def test_without_h5py_a_line_says_how_to_install_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, "h5py", None)
    with pytest.raises(InputError, match=r"OpenGM's HDF5 files needs .*\[networks\]"):
        read_opengm(tmp_path / "x.h5")


class TestFiles:
    """With the extra; skipped where it is not installed."""

    @pytest.fixture
    def h5py(self) -> Any:
        return pytest.importorskip("h5py", reason="needs the extra networks")

    @pytest.mark.usefixtures("h5py")
    @pytest.mark.parametrize("seed", range(8))
    def test_graphs_come_back_as_they_were(self, seed: int, tmp_path: Path) -> None:
        graph = random_factors(seed, unit=1e3)
        again = read_opengm(write_opengm(tmp_path / "g.h5", graph))
        assert again.n_labels.tolist() == graph.n_labels.tolist()
        assert again.scopes == graph.scopes
        for one, other in zip(again.tables, graph.tables, strict=True):
            np.testing.assert_array_equal(one, other)

    def test_functions_of_label_distance_are_written_out(self, h5py: Any, tmp_path: Path) -> None:
        path = tmp_path / "g.h5"
        kinds = {
            16006: [0.0, 2.0],
            16003: [1.5, 2.0],
            16004: [3.0],
            16002: [2.0],
            16005: [2.0, 1.0],
        }
        with h5py.File(path, "w") as file:
            group = file.create_group("gm")
            pairs = [n for kind in kinds for n in (kind, 1)]
            group["header"] = np.array([2, 0, 2, 5, 5, *pairs, 1], np.uint64)
            group["numbers-of-states"] = np.array([2, 3], np.uint64)
            for kind, values in kinds.items():
                inner = group.create_group(f"function-id-{kind}")
                inner["indices"] = np.array([2, 3], np.uint64)
                inner["values"] = np.array(values)
            group["factors"] = np.array([n for k in range(5) for n in (0, k, 2, 0, 1)], np.uint64)
        tables = dict(zip(kinds, read_opengm(path).tables, strict=True))
        assert tables[16006].tolist() == [[0, -2, -2], [-2, 0, -2]]
        assert tables[16003].tolist() == [[0, -2, -3], [-2, 0, -2]]
        assert tables[16004].tolist() == [[0, -3, -12], [-3, 0, -3]]
        assert tables[16002].tolist() == [[0, -2, -4], [-2, 0, -2]]
        assert tables[16005].tolist() == [[0, -1, -2], [-1, 0, -1]]

    def test_the_first_node_of_a_table_is_the_fastest(self, h5py: Any, tmp_path: Path) -> None:
        path = tmp_path / "g.h5"
        with h5py.File(path, "w") as file:
            group = file.create_group("gm")
            group["header"] = np.array([2, 0, 2, 1, 1, 16000, 1], np.uint64)  # the older header
            group["numbers-of-states"] = np.array([2, 3], np.uint64)
            inner = group.create_group("function-id-16000")
            inner["indices"] = np.array([2, 2, 3], np.uint64)
            inner["values"] = np.arange(6.0)
            group["factors"] = np.array([0, 0, 2, 0, 1], np.uint64)
        assert read_opengm(path).tables[0].tolist() == [[0, -2, -4], [-1, -3, -5]]

    @pytest.mark.parametrize("damage", ["text", "dataset", "type", "short"])
    def test_damage_is_told_in_one_line(self, h5py: Any, tmp_path: Path, damage: str) -> None:
        path = write_opengm(tmp_path / "g.h5", random_factors(5))
        if damage == "text":
            path.write_text("no HDF5")
        elif damage != "dataset":
            with h5py.File(path, "r+") as file:
                name = {"type": "header", "short": "factors"}[damage]
                values = file["gm"][name][()]
                del file["gm"][name]
                if damage == "type":
                    values[5] = 16999
                    file["gm"].move("function-id-16000", "function-id-16999")
                file["gm"][name] = values if damage == "type" else values[:2]
        dataset = "other" if damage == "dataset" else "gm"
        expected = "type 16999, which are not read" if damage == "type" else "not a factor graph"
        with pytest.raises(InputError, match=expected) as caught:
            read_opengm(path, dataset=dataset)
        assert "\n" not in str(caught.value)

    @pytest.mark.parametrize(
        ("part", "values"),
        [
            ("header", [2, 0, 2, -1, 1, 16000, -1, 1]),
            ("header", [2.5, 0, 2, 1.5, 1, 16000, 1.2, 1]),
            ("numbers-of-states", [b"a", b"b"]),
            ("numbers-of-states", np.array([2, 2**64 - 1], np.uint64)),
            ("factors", [-1, -1, 2, 0, 1]),
            ("factors", [0, 0, 70, *range(70)]),
            ("function-id-16000/indices", [2, -1, -4]),
            ("function-id-16000/indices", [2, 2**32, 2**32]),
            ("function-id-16000/indices", [70, *[1] * 70]),
            ("function-id-16000/values", [np.nan] * 4),
        ],
    )
    def test_no_number_stops_the_reader(
        self, h5py: Any, tmp_path: Path, part: str, values: Any
    ) -> None:
        path = write_opengm(tmp_path / "g.h5", FactorGraph.of([2, 2], [(0, 1)], [np.eye(2)]))
        with h5py.File(path, "r+") as file:
            del file["gm"][part]
            file["gm"][part] = np.array(values)
        with pytest.raises(InputError, match=r"g\.h5: not a factor graph .* named 'gm' \("):
            read_opengm(path)

    @pytest.mark.parametrize("n", [10**9, 60_000])
    def test_tables_larger_than_the_file_could_mean_are_not_written_out(
        self, h5py: Any, tmp_path: Path, n: int
    ) -> None:
        path = tmp_path / "g.h5"
        with h5py.File(path, "w") as file:
            group = file.create_group("gm")
            group["header"] = np.array([2, 0, 2, 1, 1, 16006, 1, 1])
            group["numbers-of-states"] = np.array([n, n])
            group["function-id-16006/indices"] = np.array([n, n])
            group["function-id-16006/values"] = np.array([0.0, 1.0])
            group["factors"] = np.array([0, 0, 2, 0, 1])
        with pytest.raises(InputError, match=f"a table of {n * n} numbers and order 2"):
            read_opengm(path)

    def test_numbers_that_are_not_in_the_file_are_not_made(self, h5py: Any, tmp_path: Path) -> None:
        path = write_opengm(tmp_path / "g.h5", FactorGraph.of([2, 2], [(0, 1)], [np.eye(2)]))
        with h5py.File(path, "r+") as file:
            inner = file["gm/function-id-16000"]
            del inner["values"]
            inner.create_dataset("values", shape=(10**9,), dtype="f8", chunks=(1_000_000,))
        with pytest.raises(InputError, match="'values' must be a list of at most"):
            read_opengm(path)
