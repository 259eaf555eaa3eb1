"""Problems labelled side by side get the labels and beliefs that they get alone."""

from typing import Any

import numpy as np
import pytest
import scipy.sparse as sp
from numpy.typing import NDArray

from pgm_places.graph.label_graph import LabelGraph
from pgm_places.inference.backends import build
from pgm_places.inference.problem import LabelingProblem
from pgm_places.labelers import method
from pgm_places.labelers.method import infer, label_many, stack_problems
from pgm_places.labelers.structured_labeler import StructuredLabeler

NAMES = ("a", "b", "c")


def sentences(
    n: int, seed: int, *, sparse: bool = False, known: bool = False
) -> tuple[list[LabelingProblem], list[NDArray[np.int64]]]:
    """Chains of different lengths, single nodes among them."""
    rng = np.random.default_rng(seed)
    problems, truths = [], []
    for _ in range(n):
        length = int(rng.integers(1, 9))
        truth = np.sort(rng.integers(0, 3, length))
        looks: Any = np.eye(3)[truth] + 0.7 * rng.normal(size=(length, 3))
        looks = sp.csr_array(np.round(looks)) if sparse else looks
        problems.append(
            LabelingProblem(
                LabelGraph.from_lattice((length,)),
                NAMES,
                node_features=looks,
                known=np.where(rng.random(length) < 0.2, truth, -1) if known else None,
            )
        )
        truths.append(truth)
    return problems, truths


@pytest.mark.parametrize("known", [False, True])
@pytest.mark.parametrize("sparse", [False, True])
@pytest.mark.parametrize(
    ("name", "options"),
    [
        ("crf", {}),
        ("crf", {"learner": "max-margin"}),
        ("crf", {"inference": "exact"}),
        ("amn", {"inference": "sum-product"}),
        ("amn", {"inference": "sum-product", "edge_features": ("constant",)}),
        ("amn", {"inference": "graph-cut"}),
    ],
)
def test_the_answers_are_those_of_single_calls(
    name: str, options: dict[str, Any], sparse: bool, known: bool
) -> None:
    problems, truths = sentences(12, 0, sparse=sparse)
    method = build(name, {"C": 10.0, **options}).fit(problems, truths)
    asked, _ = sentences(40, 1, sparse=sparse, known=known)
    alone = [method.infer(problem) for problem in asked]
    together = label_many(method, asked)
    for one, other in zip(alone, together, strict=True):
        np.testing.assert_array_equal(one.labels, other.labels)
        assert one.status == other.status
        if one.beliefs is not None:
            assert other.beliefs is not None
            np.testing.assert_allclose(one.beliefs, other.beliefs, rtol=0, atol=1e-12)


def test_one_call_labels_all(monkeypatch: pytest.MonkeyPatch) -> None:
    calls = []

    def counted(backend: Any, problem: LabelingProblem) -> Any:
        calls.append(problem.graph.n_nodes)
        return infer(backend, problem)

    monkeypatch.setattr(f"{method.__name__}.infer", counted)
    problems, truths = sentences(30, 0)
    labeler = StructuredLabeler("crf").fit(problems, truths)
    found = labeler.predict(problems)
    assert calls == [sum(len(truth) for truth in truths)]
    assert [len(part) for part in found] == [len(truth) for truth in truths]


def test_a_classifier_is_asked_once_too() -> None:
    from sklearn.linear_model import LogisticRegression

    problems, truths = sentences(30, 0)
    labeler = StructuredLabeler("potts", LogisticRegression()).set_params(
        backend__inference="sum-product"
    )
    labeler.fit(problems, truths)
    alone = [labeler.label(problem) for problem in problems]
    for one, other in zip(alone, labeler.label_many(problems), strict=True):
        np.testing.assert_array_equal(one.labels, other.labels)
        assert one.beliefs is not None and other.beliefs is not None
        np.testing.assert_allclose(one.beliefs, other.beliefs, rtol=0, atol=1e-12)


def test_what_would_change_is_not_labelled_as_one() -> None:
    problems, _ = sentences(3, 0)
    ring = LabelGraph.from_edges(3, [(0, 1), (1, 2), (0, 2)])
    cycle = LabelingProblem(ring, NAMES, node_features=np.zeros((3, 3)))
    assert stack_problems([*problems, cycle]) is None
    zeros = np.zeros((problems[0].graph.n_nodes, 3))
    renamed = LabelingProblem(problems[0].graph, ("x", "y", "z"), node_features=zeros)
    assert stack_problems([*problems, renamed]) is None
    assert stack_problems([*problems, problems[0].with_unary(zeros)]) is None
    whole = stack_problems(problems)
    assert whole is not None and whole.graph.n_nodes == sum(p.graph.n_nodes for p in problems)
