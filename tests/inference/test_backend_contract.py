"""What every method owes its users: one suite for all, on all graphs of up to six nodes."""

from functools import cache
from typing import Any

import networkx as nx
import numpy as np
import pytest
from numpy.typing import NDArray

from pgm_places import LabelGraph, Labeling, LabelingProblem, Status, build
from pgm_places.inference.backends import Backend

# Max margin on graphs with cycles says so where its certificate is loose.
pytestmark = pytest.mark.filterwarnings("ignore:better weights may exist")

Array = NDArray[np.float64]

WEIGHT = 0.7
DECODERS = ("graph-cut", "trw-s", "lp", "icm", "mean-field", "max-product", "sum-product")
METHODS: dict[str, tuple[str, dict[str, Any]]] = {
    "independent": ("independent", {}),
    "relaxation": ("relaxation", {}),
    "relaxation, damped": ("relaxation", {"damping": 0.2, "max_iterations": 20}),
    "amn": ("amn", {}),
    "amn, trw-s": ("amn", {"inference": "trw-s"}),
    "amn, no class weights": ("amn", {"class_weight": "none", "edge_features": ("constant",)}),
    "crf": ("crf", {}),
    "crf, pseudo-likelihood": ("crf", {"learner": "pseudo-likelihood"}),
    "crf, piecewise": ("crf", {"learner": "piecewise", "inference": "mean-field"}),
    **{name: ("potts", {"weight": WEIGHT, "inference": name}) for name in DECODERS},
}


LINEAR = ("amn", "crf")
"""Methods that learn weights of features."""


@cache
def small_graphs() -> tuple[LabelGraph, ...]:
    """All graphs of one to six nodes, each shape once: 208 of them."""
    found = []
    for graph in nx.graph_atlas_g():
        if 1 <= graph.number_of_nodes() <= 6:
            edges = np.array(sorted(graph.edges), np.int64).reshape(-1, 2)
            found.append(LabelGraph.from_edges(graph.number_of_nodes(), edges))
    return tuple(found)


@cache
def problems(n_labels: int) -> tuple[LabelingProblem, ...]:
    """A problem with unaries of no structure on every small graph."""
    rng = np.random.default_rng(n_labels)
    names = [f"label {k}" for k in range(n_labels)]
    return tuple(
        LabelingProblem(graph, names, unary=np.log(rng.dirichlet(np.ones(n_labels), graph.n_nodes)))
        for graph in small_graphs()
    )


@cache
def fitted(key: str, n_labels: int = 3) -> Backend:
    """The method, learned on lattices of two halves where it learns."""
    name, options = METHODS[key]
    backend = build(name, options)
    learn = getattr(backend, "fit", None)
    return backend if learn is None else learn(*training(n_labels))


@cache
def answers(key: str) -> tuple[Labeling, ...]:
    """What the method says of the problems of three labels."""
    return tuple(fitted(key).infer(problem) for problem in problems(3))


def training(n_labels: int) -> tuple[list[LabelingProblem], list[NDArray[np.int64]]]:
    rng = np.random.default_rng(5)
    graph = LabelGraph.from_lattice((6, 8))
    names = [f"label {k}" for k in range(n_labels)]
    given, truths = [], []
    for _ in range(2):
        truth = np.repeat(np.arange(48) // 16 % n_labels, 1)
        p = rng.dirichlet(np.ones(n_labels), 48)
        p[np.arange(48), truth] += 0.8
        given.append(LabelingProblem(graph, names, unary=np.log(p / p.sum(axis=1, keepdims=True))))
        truths.append(truth)
    return given, truths


@pytest.mark.parametrize("key", list(METHODS))
def test_labels_and_beliefs_are_what_they_say(key: str) -> None:
    for problem, found in zip(problems(3), answers(key), strict=True):
        assert found.labels.shape == (problem.graph.n_nodes,)
        assert np.isin(found.labels, [0, 1, 2]).all()
        if found.beliefs is not None:
            assert found.beliefs.min() >= 0
            assert np.array_equal(found.beliefs.argmax(axis=1), found.labels)


@pytest.mark.parametrize("key", [key for key in METHODS if not key.startswith(LINEAR)])
def test_a_constant_for_all_labels_of_a_node_changes_nothing(key: str) -> None:
    """Not for linear models, to which unaries are features like others."""
    backend = fitted(key)
    rng = np.random.default_rng(0)
    for problem, found in zip(problems(3), answers(key), strict=True):
        assert problem.unary is not None
        shift = rng.normal(size=(problem.graph.n_nodes, 1))
        moved = LabelingProblem(problem.graph, problem.label_names, unary=problem.unary + shift)
        assert np.array_equal(backend.infer(moved).labels, found.labels)


def renumbered(problem: LabelingProblem, order: NDArray[np.int64]) -> LabelingProblem:
    """Node ``order[i]`` of the problem is node i of the result."""
    assert problem.unary is not None
    place = np.argsort(order)
    edges = np.sort(place[problem.graph.edges], axis=1)
    graph = LabelGraph.from_edges(problem.graph.n_nodes, edges)
    return LabelingProblem(graph, problem.label_names, unary=problem.unary[order])


def same_where_proved(first: Labeling, second: Labeling, *, proved_only: bool) -> bool:
    """Whether two runs agree; local optima may differ, so some count only where both are proved."""
    if proved_only and not first.status is second.status is Status.EXACT:
        return True
    return bool(np.array_equal(first.labels, second.labels))


LOCAL = set(DECODERS)
"""Methods whose local optimum may depend on the order of nodes or labels."""


@pytest.mark.parametrize("key", list(METHODS))
def test_the_numbers_of_nodes_do_not_matter(key: str) -> None:
    backend = fitted(key)
    rng = np.random.default_rng(1)
    proved_only = key in LOCAL or key.startswith(LINEAR)
    for problem, found in zip(problems(3), answers(key), strict=True):
        order = rng.permutation(problem.graph.n_nodes)
        other = backend.infer(renumbered(problem, order))
        moved = Labeling(found.labels[order], found.status)
        assert same_where_proved(moved, other, proved_only=proved_only)


@pytest.mark.parametrize("key", ["independent", "relaxation", *DECODERS])
def test_the_order_of_labels_does_not_matter(key: str) -> None:
    """Relaxation learns on labels in the other order, too."""
    name, options = METHODS[key]
    swap = np.array([2, 0, 1])
    other = build(name, options)
    if name == "relaxation":
        given, truths = training(3)
        turned = [
            LabelingProblem(item.graph, item.label_names, unary=item.unary[:, swap])  # type: ignore[index]
            for item in given
        ]
        other = build(name, options).fit(turned, [np.argsort(swap)[t] for t in truths])
    for problem, found in zip(problems(3), answers(key), strict=True):
        assert problem.unary is not None
        turned_one = LabelingProblem(
            problem.graph, problem.label_names, unary=problem.unary[:, swap]
        )
        turned_found = other.infer(turned_one)
        back = Labeling(swap[turned_found.labels], turned_found.status)
        assert same_where_proved(found, back, proved_only=key in LOCAL)
