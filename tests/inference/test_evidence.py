"""Evidence: labels that are known or forbidden hold in every method."""

from dataclasses import dataclass
from typing import Any

import networkx as nx
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray
from sklearn.linear_model import LogisticRegression

from pgm_places import (
    LabelGraph,
    Labeling,
    LabelingProblem,
    Potentials,
    Status,
    StructuredLabeler,
    build,
    decode,
)
from pgm_places.errors import InputError
from pgm_places.inference.backends import Backend
from pgm_places.inference.labeling import keep_evidence
from pgm_places.models.decoders import DECODERS as BUILT_IN
from pgm_places.models.hmm import MODES
from tests.reference.energy import Model, labelings, score
from tests.refusals import refused
from tests.strategies import models

NAMES = ("a", "b", "c")

METHODS: dict[str, tuple[str, dict[str, Any]]] = {
    "independent": ("independent", {}),
    "relaxation": ("relaxation", {}),
    **{f"potts, {name}": ("potts", {"inference": name}) for name in BUILT_IN},
    **{f"amn, {name}": ("amn", {"inference": name}) for name in BUILT_IN},
    **{
        f"crf, {name}": ("crf", {"inference": name})
        for name in ("auto", *BUILT_IN)
        if name != "graph-cut"
    },
    "crf, max-margin": ("crf", {"learner": "max-margin"}),
    **{
        f"hmm, {mode}, {seen}": ("hmm", {"mode": mode, "observation": seen})
        for mode in MODES
        for seen in ("hard", "soft", "posterior")
    },
}


def chain(seed: int, n_nodes: int) -> tuple[LabelingProblem, NDArray[np.int64]]:
    rng = np.random.default_rng(seed)
    truth = np.arange(n_nodes) // 5 % 3
    p = rng.dirichlet(np.ones(3), n_nodes) + 0.3 * np.eye(3)[truth]
    graph = LabelGraph.from_lattice((n_nodes,))
    features = truth[:, None] + rng.normal(size=(n_nodes, 2))
    return LabelingProblem(graph, NAMES, np.log(p), node_features=features), truth


def fitted(key: str) -> Backend:
    name, chosen = METHODS[key]
    backend: Any = build(name, chosen)
    problem, truth = chain(0, 60)
    return backend.fit([problem], [truth]) if hasattr(backend, "fit") else backend


@pytest.mark.parametrize("how", ["known", "forbidden"])
@pytest.mark.parametrize("key", list(METHODS))
def test_what_is_known_holds_against_every_classifier(key: str, how: str) -> None:
    backend = fitted(key)
    plain, _ = chain(1, 30)
    assert plain.unary is not None
    known = np.full(30, -1)
    known[[0, 4, 17, 29]] = plain.unary[[0, 4, 17, 29]].argmin(axis=1)
    evident = known >= 0
    if how == "known":
        problem = LabelingProblem(plain.graph, NAMES, plain.unary, plain.node_features, known=known)
    else:
        unary = np.array(plain.unary)
        unary[evident] = np.where(np.eye(3)[known[evident]] > 0, unary[evident], -np.inf)
        problem = LabelingProblem(plain.graph, NAMES, unary, plain.node_features)
    found = backend.infer(problem)
    np.testing.assert_array_equal(found.labels[evident], known[evident])
    if found.beliefs is not None:
        np.testing.assert_allclose(
            found.beliefs[evident], np.eye(3)[known[evident]], rtol=0, atol=1e-12
        )


@pytest.mark.parametrize("mode", MODES)
@pytest.mark.parametrize("observation", ["hard", "soft", "posterior"])
def test_what_is_known_holds_against_transitions_that_never_happened(
    mode: str, observation: str
) -> None:
    """The model has learned that labels never change and that the classifier never errs."""
    graph, z = LabelGraph.from_lattice((6,)), np.log([[0.9, 0.1]] * 6)
    truth = np.zeros(6, np.int64)
    training = [
        LabelingProblem(graph, ["a", "b"], z),
        LabelingProblem(graph, ["a", "b"], z[:, ::-1]),
    ]
    options = {"mode": mode, "observation": observation, "smoothing": 0.0}
    model = build("hmm", options).fit(training, [truth, truth + 1])
    known = np.array([-1, -1, 1, -1, -1, 0])
    found = model.infer(LabelingProblem(graph, ["a", "b"], z, known=known))
    assert found.labels[[2, 5]].tolist() == [1, 0]
    assert found.info["impossible"]
    if mode == "filter":
        state = None
        for row in LabelingProblem(graph, ["a", "b"], z, known=known).with_evidence(z):
            belief, state, _ = model.advance(row, state)
            assert belief[row == -np.inf].sum() == 0.0


@given(models(("associative",), max_nodes=5), st.integers(0, 999))
def test_known_labels_leave_the_best_of_the_labellings_that_keep_them(
    model: Model, seed: int
) -> None:
    rng = np.random.default_rng(seed)
    n_nodes, n_labels = model.unary.shape
    best = model.unary.argmax(axis=1) if n_nodes else np.zeros(0, np.int64)
    known = np.where(rng.random(n_nodes) < 0.4, best, -1)
    graph = LabelGraph.from_edges(n_nodes, model.edges)
    potentials = Potentials(model.unary, agreement=model.agreement)
    keeping = [y for y in labelings(model) if ((known < 0) | (known == y)).all()]
    highest = max(score(model, labels) for labels in keeping)
    for method in ("graph-cut", "trw-s", "lp"):
        found = decode(graph, potentials, method, known=known, certify=True)
        assert ((known < 0) | (found.labels == known)).all()
        assert found.bound is not None
        assert found.bound >= highest - 1e-9
        if found.status is Status.EXACT or n_labels == 2:
            assert found.score == pytest.approx(highest, rel=0, abs=1e-9)


@pytest.mark.parametrize("backend", ["potts", "amn", "relaxation", "independent", "hmm"])
def test_a_classifier_does_not_overwrite_what_is_known(backend: str) -> None:
    problems, truths = zip(*(chain(seed, 60) for seed in range(3)), strict=True)
    labeler = StructuredLabeler(backend, LogisticRegression()).fit(problems, truths)
    plain, truth = chain(7, 30)
    known = np.full(30, -1)
    known[[3, 12]] = (truth[[3, 12]] + 1) % 3
    unary = np.zeros((30, 3))
    unary[20, truth[20]] = -np.inf
    problem = LabelingProblem(plain.graph, NAMES, unary, plain.node_features, known=known)
    found = labeler.label(problem)
    assert found.labels[[3, 12]].tolist() == known[[3, 12]].tolist()
    assert found.labels[20] != truth[20]
    again = labeler.infer(problem, labeler.scores(problem))
    np.testing.assert_array_equal(again.labels, found.labels)


@dataclass(frozen=True)
class Deaf:
    """A plug-in that never looks at the problem's evidence."""

    beliefs: bool

    def infer(self, problem: LabelingProblem) -> Labeling:
        n, k = problem.graph.n_nodes, problem.n_labels
        beliefs = np.tile(np.arange(k, 0, -1) / (k * (k + 1) / 2), (n, 1))
        return Labeling(
            np.zeros(n, np.int64), Status.EXACT, beliefs if self.beliefs else None, 7.0, 7.0
        )


@pytest.mark.parametrize("beliefs", [True, False])
@pytest.mark.parametrize("with_unary", [True, False])
def test_evidence_holds_in_a_plugin_that_knows_nothing_of_it(
    beliefs: bool, with_unary: bool
) -> None:
    known = np.array([-1, 2, -1, 0])
    unary = np.array([[0.0, 1.0, 2.0]] * 4)
    unary[2, 0] = -np.inf
    problem = LabelingProblem(
        LabelGraph.from_lattice((4,)),
        NAMES,
        unary if with_unary else None,
        np.zeros((4, 1)),
        known=known,
    )
    labeler = StructuredLabeler(Deaf(beliefs)).fit([problem], [np.arange(4) % 3])
    found = labeler.label(problem)
    # Without beliefs the unary decides which of the labels left is taken, with them they do.
    forbidden = (1 if beliefs else 2) if with_unary else 0
    assert found.labels.tolist() == [0, 2, forbidden, 0]
    assert (found.status, found.score, found.bound) == (Status.REPAIRED, None, None)
    if beliefs:
        assert found.beliefs is not None
        free = np.array([1 / 2, 1 / 3, 1 / 6])
        third = np.array([0, 2 / 3, 1 / 3]) if with_unary else free
        wanted = np.array([free, [0, 0, 1], third, [1, 0, 0]])
        np.testing.assert_allclose(found.beliefs.astype(float), wanted, rtol=0, atol=1e-12)


def test_what_a_plugin_says_is_not_touched_where_it_keeps_the_evidence() -> None:
    graph = LabelGraph.from_lattice((3,))
    plain = LabelingProblem(graph, NAMES, np.zeros((3, 3)))
    said = Deaf(beliefs=False).infer(plain)
    assert keep_evidence(plain, said) is said
    known = LabelingProblem(graph, NAMES, known=np.array([0, -1, -1]))
    assert keep_evidence(known, said) is said
    sure = Labeling(np.array([1, 0]), Status.EXACT, np.eye(3)[[2, 0]])
    both = LabelingProblem(LabelGraph.from_lattice((2,)), NAMES, known=np.array([1, -1]))
    found = keep_evidence(both, sure)  # no belief is left: those allowed share it
    assert (found.status, found.labels.tolist()) == (Status.EXACT, [1, 0])
    assert found.beliefs is not None
    assert found.beliefs.tolist() == [[0, 1, 0], [1, 0, 0]]


def test_known_labels_alone_are_a_problem() -> None:
    """Two ends of a chain are known; the tie between decides where the border goes."""
    graph = LabelGraph.from_lattice((6,))
    ties = np.array([5.0, 5.0, 1.0, 5.0, 5.0])[:, None]
    known = np.array([0, -1, -1, -1, -1, 1])
    problem = LabelingProblem(graph, ["a", "b"], edge_features=ties, known=known)
    found = build("potts", {"edge_weights": "given"}).infer(problem)
    assert found.labels.tolist() == [0, 0, 0, 1, 1, 1]
    part = problem.subproblem(np.arange(6) > 2)
    assert part.known is not None
    assert part.known.tolist() == [-1, -1, 1]
    assert "known (6,)" in repr(problem)


def test_a_node_with_no_label_left_is_refused_by_name() -> None:
    graph, unary = LabelGraph.from_lattice((3,)), np.zeros((3, 2))
    unary[1] = -np.inf

    def problem(unary: Any, **known: Any) -> LabelingProblem:
        return LabelingProblem(graph, ["a", "b"], unary, **known)

    wanted = "unary forbids every label at node 1"
    refused(InputError, f"{wanted}; allow at least", problem, unary)
    some = np.array([[0.0, 0.0], [0.0, -np.inf], [0.0, 0.0]])
    known = "node 1 is known to be 'b', which unary forbids there"
    refused(InputError, known, problem, some, known=np.array([-1, 1, -1]))
    refused(InputError, wanted, decode, graph, Potentials(some), "icm", known=[-1, 1, -1])
    other = r"known must hold integers from -1 to 1, got 2"
    refused(InputError, other, problem, some, known=np.array([2, -1, -1]))
    named = LabelGraph.from_networkx(nx.path_graph(["hall", "up", "stairs"]))
    wanted = "unary forbids every label at node 'up'; allow at"
    refused(InputError, wanted, LabelingProblem, named, ["a", "b"], unary)
