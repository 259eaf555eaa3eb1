"""Max-margin learning by listing every labelling: slow, obvious, for a dozen nodes."""

import itertools

import cvxpy as cp
import numpy as np
from numpy.typing import NDArray

from pgm_places.solvers.max_margin import MarginProblem, MaxMarginProblem, Oracle
from tests.reference.cliques import set_score


def all_labelings(n_nodes: int, n_labels: int) -> NDArray[np.int64]:
    return np.array(list(itertools.product(range(n_labels), repeat=n_nodes)), np.int64)


def score(
    problem: MaxMarginProblem, weights: NDArray[np.float64], labels: NDArray[np.int64]
) -> float:
    """The definition, node by node and edge by edge."""
    d, f, k = problem.node_features.shape[1], problem.edge_features.shape[1], problem.n_labels
    node_weights = weights[: d * k].reshape(d, k)
    edge_weights = weights[d * k : (d + f) * k].reshape(f, k)
    total = 0.0
    for i, label in enumerate(labels):
        total += float(problem.node_features[i] @ node_weights[:, label])
    for e, (i, j) in enumerate(problem.edges):
        if labels[i] == labels[j]:
            total += float(problem.edge_features[e] @ edge_weights[:, labels[i]])
    return total + _sets_score(problem, weights[(d + f) * k :], labels)


def _sets_score(
    problem: MaxMarginProblem, weights: NDArray[np.float64], labels: NDArray[np.int64]
) -> float:
    if problem.sets is None:
        return 0.0
    cliques, dissent = problem.sets.nodes.cliques, problem.sets.nodes.dissent
    total = 0.0
    for c, features in enumerate(problem.sets.features):
        members = cliques.members[cliques.start[c] : cliques.start[c + 1]].tolist()
        rewards = features @ weights.reshape(-1, problem.n_labels)
        total += set_score(members, labels.tolist(), rewards.tolist(), dissent)
    return total


def loss(problem: MaxMarginProblem, labels: NDArray[np.int64]) -> float:
    k = problem.n_labels
    costs = [[float(i != j) for j in range(k)] for i in range(k)]
    if problem.costs is not None:
        costs = problem.costs.tolist()
    pairs = zip(problem.labels, labels, strict=True)
    return float(sum(problem.loss[i] * costs[t][y] for i, (t, y) in enumerate(pairs)))


def objective(problem: MaxMarginProblem, weights: NDArray[np.float64]) -> float:
    """f(w) with the maximum over all labellings."""
    truth = score(problem, weights, problem.labels)
    margin = max(
        score(problem, weights, labels) + loss(problem, labels) - truth
        for labels in all_labelings(problem.n_nodes, problem.n_labels)
    )
    return 0.5 * float(weights @ weights) + problem.penalty * margin / problem.n_nodes


def optimum(problem: MaxMarginProblem) -> tuple[float, NDArray[np.float64]]:
    """The least objective and its weights, with one constraint per labelling."""
    basis = np.eye(problem.n_weights)
    labelings = all_labelings(problem.n_nodes, problem.n_labels)
    features = np.array([[score(problem, unit, y) for unit in basis] for y in labelings])
    truth = np.array([score(problem, unit, problem.labels) for unit in basis])
    losses = np.array([loss(problem, y) for y in labelings])
    return constrained_optimum(problem, features - truth, losses)


def constrained_optimum(
    problem: MarginProblem, gains: NDArray[np.float64], losses: NDArray[np.float64]
) -> tuple[float, NDArray[np.float64]]:
    """The same from what each labelling has more features (M, n_weights) than the truth."""
    weights, slack = cp.Variable(problem.n_weights), cp.Variable()
    constraints = [slack >= (gains @ weights + losses) / problem.n_nodes]
    if problem.n_free < problem.n_weights:
        constraints.append(weights[problem.n_free :] >= 0)
    program = cp.Problem(
        cp.Minimize(0.5 * cp.sum_squares(weights) + problem.penalty * slack), constraints
    )
    program.solve(solver="CLARABEL")
    assert program.status == "optimal"
    return float(program.value), np.asarray(weights.value)


def exact_oracle(problem: MaxMarginProblem) -> Oracle:
    labelings = all_labelings(problem.n_nodes, problem.n_labels)
    first, second = labelings[:, problem.edges[:, 0]], labelings[:, problem.edges[:, 1]]
    nodes, edges = np.arange(problem.n_nodes), np.arange(len(problem.edges))

    def best(unary: NDArray[np.float64], agreement: NDArray[np.float64]) -> NDArray[np.int64]:
        scores = unary[nodes, labelings].sum(axis=1)
        scores += np.where(first == second, agreement[edges, first], 0.0).sum(axis=1)
        return labelings[int(scores.argmax())]

    return best
