"""A labelling that judges itself: optimality, and what is wrong with it."""

import re
from dataclasses import replace

import numpy as np
import pytest

from pgm_places import LabelGraph, Labeling, LabelingProblem, Potentials, Status, decode
from pgm_places.errors import InputError

GRAPH = LabelGraph.from_lattice((3, 3))
UNARY = np.random.default_rng(0).normal(size=(9, 3))
UNARY[4, 1] = -np.inf
KNOWN = np.array([2, *[-1] * 8])
PROBLEM = LabelingProblem(GRAPH, list("abc"), UNARY, known=KNOWN)
POTENTIALS = Potentials(UNARY, pairwise=np.random.default_rng(1).normal(size=(3, 3))).with_known(
    KNOWN
)


@pytest.mark.parametrize("method", ["trw-s", "exact", "icm", "sum-product", "max-product"])
def test_what_decoders_find_is_in_order(method: str) -> None:
    found = decode(GRAPH, POTENTIALS, method, certify=True)
    assert found.check(PROBLEM, POTENTIALS) == []
    assert found.check(PROBLEM) == []
    best = decode(GRAPH, POTENTIALS, "exact").score
    assert best is not None and found.score is not None and found.gap is not None
    assert found.is_optimal(found.gap + 1e-12)
    if found.is_optimal():
        assert found.score == pytest.approx(best)
    if found.score < best - 1e-9:
        assert not found.is_optimal((best - found.score) / 2)


def test_without_a_bound_nothing_is_proved_but_by_the_method() -> None:
    labels = np.zeros(3, np.int64)
    assert not Labeling(labels, Status.CONVERGED, score=1.0).is_optimal(100.0)
    assert Labeling(labels, Status.EXACT).is_optimal()
    assert Labeling(labels, Status.CONVERGED, score=1.0, bound=1.5).is_optimal(0.5)
    with pytest.raises(InputError, match="tolerance must be at least 0"):
        Labeling(labels, Status.EXACT).is_optimal(-1.0)


def test_what_is_wrong_is_said() -> None:
    right = decode(GRAPH, POTENTIALS, "sum-product", certify=True)
    assert right.score is not None and right.beliefs is not None
    wrong = right.labels.copy()
    wrong[[0, 4]] = 1
    beliefs = np.full((9, 3), 1 / 3)
    cases = {
        "2 labels are not allowed, the first is 'b' at node 0": replace(right, labels=wrong),
        "above 0 for labels that are not allowed": replace(right, beliefs=beliefs),
        r"beliefs have shape \(9, 2\)": replace(right, beliefs=np.full((9, 2), 0.5)),
        "the labels score .*, not": replace(right, score=right.score - 0.1),
        "the bound .* is below the score": replace(right, bound=right.score - 0.1),
        "label 3 is none of the problem's 3": replace(right, labels=np.full(9, 3)),
        "it labels 8 nodes, the problem has 9": right.part(slice(0, 8)),
    }
    for message, labeling in cases.items():
        assert re.search(message, "; ".join(labeling.check(PROBLEM, POTENTIALS)))
