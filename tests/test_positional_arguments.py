"""More positional arguments than a public function takes are refused in one line."""

import numpy as np

from pgm_places import LabelGraph, LabelingProblem, Potentials, decode
from pgm_places.errors import InputError
from tests.refusals import refused


def test_sizes_are_given_as_one_tuple() -> None:
    line = (
        r"LabelGraph.from_lattice takes 1 positional argument \(nodes\), got 2; write one tuple: "
    )
    refused(InputError, line + r"\(24, 24\)", LabelGraph.from_lattice, 24, 24)
    refused(
        InputError, r"a tuple of sizes, such as \(24, 24\), .* got 24", LabelGraph.from_lattice, 24
    )


def test_other_arguments_are_given_by_name() -> None:
    graph, potentials = LabelGraph.from_lattice((3,)), Potentials(np.zeros((3, 2)))
    line = (
        r"decode takes 3 positional arguments \(graph, potentials, method\), got 4; give the others"
    )
    refused(InputError, line, decode, graph, potentials, "exact", None)
    unary, many = np.zeros((3, 2)), (None,) * 20
    refused(InputError, "LabelingProblem takes", LabelingProblem, graph, ["a", "b"], unary, *many)
