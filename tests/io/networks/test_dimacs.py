"""Cuts as DIMACS files, there and back."""

from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from pgm_places.errors import InputError
from pgm_places.io.networks.dimacs import CutProblem, read_dimacs, write_dimacs
from pgm_places.solvers.max_flow import minimum_cut

EXAMPLE = """c The example of the format's description: a flow of 5.
p max 6 8
n 1 s
n 6 t
a 1 2 5
a 1 3 15
a 2 4 5
a 2 5 5
a 3 4 5
a 3 5 5
a 4 6 15
a 5 6 5
"""


def test_a_small_network(tmp_path: Path) -> None:
    path = tmp_path / "cut.max"
    path.write_text(EXAMPLE)
    problem = read_dimacs(path)
    assert len(problem.source_capacity) == 4
    cut = minimum_cut(*problem.capacities)
    # 15 from the source: 2 passes its 5 on, 3 sends 5 to 4 and 5 to 5
    assert cut.value == 15.0


@pytest.mark.parametrize("seed", range(6))
def test_problems_come_back_with_the_same_cut(seed: int, tmp_path: Path) -> None:
    rng = np.random.default_rng(seed)
    pairs = np.array([(i, j) for j in range(6) for i in range(j)])
    edges = pairs[rng.random(len(pairs)) < 0.7]
    whole = seed % 2 == 0

    def drawn(n: int) -> NDArray[np.float64]:
        return rng.integers(0, 9, n).astype(float) if whole else rng.random(n)

    n = len(edges)
    problem = CutProblem(drawn(6), drawn(6), edges, drawn(n), drawn(n), 2.0)
    again = read_dimacs(write_dimacs(tmp_path / "c", problem))
    np.testing.assert_array_equal(again.source_capacity, problem.source_capacity)
    np.testing.assert_array_equal(again.sink_capacity, problem.sink_capacity)
    assert again.constant == 2.0
    assert minimum_cut(*again.capacities).value == minimum_cut(*problem.capacities).value


def test_source_and_sink_may_stand_anywhere_and_arcs_add_up(tmp_path: Path) -> None:
    path = tmp_path / "c"
    path.write_text(
        "p max 4 7\nn 3 s\nn 1 t\na 3 2 4\na 2 4 1\na 2 4 2\na 4 2 9\na 4 1 7\na 3 1 5\na 1 3 8\n"
    )
    problem = read_dimacs(path)
    assert problem.source_capacity.tolist() == [4, 0]
    assert problem.sink_capacity.tolist() == [0, 7]
    assert (problem.edges.tolist(), problem.forward.tolist()) == ([[0, 1]], [3])
    assert (problem.backward.tolist(), problem.constant) == ([9], 5)


@pytest.mark.parametrize(
    ("old", "new", "text"),
    [
        ("a 1 2 5", "a 1 2 -5", "line 5: .* got 'a 1 2 -5'"),
        ("a 1 2 5", "a 1 7 5", "line 5: "),
        ("a 1 2 5", "b 1 2 5", "line 5: "),
        ("n 6 t\n", "", "needs a source"),
        ("n 6 t\n", "n 1 t\n", "needs a source"),
        ("p max", "p min", "line 2: "),
        ("p max 6 8", "p max 6_0 8", "line 2: "),
        ("n 1 s", "n \u0661 s", "line 3: "),
        ("a 1 2 5", "a 1 2 1_0", "line 5: "),
        ("a 1 3 15\n", "p max 3 8\n", "line 6: "),
        ("p max 6", "p max 20000000", "says that there are 20000000 nodes, but its 8 arcs name 16"),
        ("5\na 1 3 15", "1e308\na 1 3 1e308", "add up to infinity"),
    ],
)
def test_damage_is_told_in_one_line(old: str, new: str, text: str, tmp_path: Path) -> None:
    path = tmp_path / "c"
    path.write_text(EXAMPLE.replace(old, new))
    with pytest.raises(InputError, match=text):
        read_dimacs(path)
