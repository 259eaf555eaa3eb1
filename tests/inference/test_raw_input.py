"""What is no array, no problem or no graph is refused in one line that says what to give."""

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
import scipy.sparse as sp
from sklearn.linear_model import LogisticRegression

from pgm_places import LabelGraph, LabelingProblem, Potentials, StructuredLabeler, build, decode
from pgm_places.errors import ConfigError, InputError
from pgm_places.inference.backends import backend_names

GRAPH = LabelGraph.from_lattice((3,))
NAMES = ["a", "b"]
FLAT: Any = np.zeros((3, 2))
PROBLEM = LabelingProblem(GRAPH, NAMES, FLAT, node_features=np.arange(6.0).reshape(3, 2))
TRUTH = np.array([0, 1, 1])


def fitted(name: str) -> Any:
    backend = build(name)
    return backend.fit([PROBLEM], [TRUTH]) if hasattr(backend, "fit") else backend


CASES: dict[str, tuple[Callable[[], object], str]] = {
    "flat unary": (lambda: Potentials.potts(np.zeros(3), 1.0), r"unary must have shape \(N, K\)"),
    "ragged unary": (lambda: Potentials.potts([[0, 1], [1]], 1.0), "unary must be an array of"),
    "text": (lambda: Potentials([["1", "2"]]), "unary must be an array of numbers, got"),  # type: ignore[arg-type]
    "complex": (
        lambda: Potentials(FLAT + 1j),
        "unary must be an array of numbers, got an array of type complex",
    ),
    "ragged tables": (lambda: Potentials(FLAT, pairwise=[[1], [1, 2]]), "pairwise must be an arra"),  # type: ignore[arg-type]
    "weight": (lambda: Potentials.potts(FLAT, "high"), "weight must be an array of numbers"),
    "sparse unary": (
        lambda: LabelingProblem(GRAPH, NAMES, sp.csr_array(FLAT)),  # type: ignore[arg-type]
        r"unary must be an array of numbers, got a sparse one; give its toarray\(\)",
    ),
    "dense matrix": (
        lambda: LabelGraph.from_sparse(np.eye(3)),
        r"matrix must be a sparse matrix or array of SciPy, got a ndarray; write scipy\.sparse",
    ),
    "one name": (lambda: LabelingProblem(GRAPH, "ab", FLAT), "label_names must be a list of names"),
    "no graph": (lambda: LabelingProblem(3, NAMES, FLAT), "graph must be a LabelGraph, got 3"),  # type: ignore[arg-type]
    "no potentials": (lambda: decode(GRAPH, FLAT), "potentials must be a Potentials, got an array"),
    "half a node": (lambda: LabelGraph.from_edges(3.5, []), "n_nodes must be a whole number"),  # type: ignore[arg-type]
    "ragged edges": (lambda: LabelGraph.from_edges(3, [(0, 1), (1,)]), "edges must be an array"),
    "size of a lattice": (lambda: LabelGraph.from_lattice((2, -1)), "lattice's sizes must hold"),
    "no trajectory": (lambda: LabelGraph.from_trajectory("drive"), "positions_m must be an array"),
    "one belief": (lambda: fitted("hmm").advance([0.0, 0.0], "half"), "belief must be an array of"),
}


@pytest.mark.parametrize("key", list(CASES))
def test_what_cannot_be_read_is_named(key: str) -> None:
    call, message = CASES[key]
    with pytest.raises(InputError, match=message) as caught:
        call()
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("name", backend_names())
def test_a_list_is_not_labelled_as_one_problem(name: str) -> None:
    backend = fitted(name)
    with pytest.raises(InputError, match="must be a LabelingProblem, got a list; the problems of"):
        backend.infer([PROBLEM])


@pytest.mark.parametrize("name", ["amn", "hmm", "relaxation"])
def test_one_problem_is_not_a_list_of_problems(name: str) -> None:
    backend = build(name)
    with pytest.raises(InputError, match=r"got a single LabelingProblem; write \[problem\]"):
        backend.fit(PROBLEM, TRUTH)
    with pytest.raises(InputError, match=r"problems\[0\] must be a LabelingProblem, got a ndarray"):
        backend.fit([FLAT], [TRUTH])
    with pytest.raises(InputError, match="labelings must be a list, one per problem, got None"):
        backend.fit([PROBLEM], None)


def test_unknown_options_of_a_classifier_are_refused() -> None:
    labeler = StructuredLabeler("potts", LogisticRegression())
    with pytest.raises(
        ConfigError, match="Invalid parameter 'Cc' for estimator LogisticRegression"
    ):
        labeler.set_params(classifier__Cc=1.0)
    with pytest.raises(ConfigError, match="StructuredLabeler has no option 'bakend'"):
        labeler.set_params(bakend="amn")
