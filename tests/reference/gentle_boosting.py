"""Gentle AdaBoost with regression trees, slow and obvious, in whole numbers where it matters."""

from dataclasses import dataclass
from fractions import Fraction
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[Any]
WHOLE = 2**30
TIE = Fraction(1, 2**40)
TOLERANCE = 1e-6


@dataclass
class Node:
    """A leaf, or a split into two nodes; ``rows`` are the training examples that reach it."""

    rows: Array
    value: float = 0.0
    feature: int = -1
    cut: float = np.inf
    left: "Node | None" = None
    right: "Node | None" = None


def all_splits(X: Array) -> list[tuple[int, float]]:
    """Every (feature, float32 halfway between two neighbouring values), in tie order."""
    found = []
    for j in range(X.shape[1]):
        for low, high in pairwise(np.unique(X[:, j])):
            middle = np.float32((float(low) + float(high)) / 2)
            found.append((j, float(middle if middle > low else high)))
    return found


def squared_over_mass(y: Array, mass: Array) -> Fraction:
    """(sum m y)^2 / sum m."""
    return Fraction(int((mass * y).sum()) ** 2, int(mass.sum()))


def grow(X: Array, y: Array, mass: Array, rows: Array, depth: int, least: int, splits: Any) -> Node:
    """The tree of ``depth`` levels that explains most of ``y`` with each of its splits."""
    node = Node(rows)
    total = int(mass[rows].sum())
    if total:
        node.value = int((mass[rows] * y[rows]).sum()) / total
    if depth == 0 or total == 0:
        return node
    scores = []
    for j, cut in splits:
        goes_left = X[rows, j] < cut
        sides = rows[goes_left], rows[~goes_left]
        if min(int(mass[side].sum()) for side in sides) < least:
            scores.append(Fraction(-1))
        else:
            left, right = (squared_over_mass(y[side], mass[side]) for side in sides)
            scores.append(left + right)
    best = max(scores, default=Fraction(-1))
    if best <= squared_over_mass(y[rows], mass[rows]) * (1 + TIE):
        return node
    node.feature, node.cut = next(
        split for split, score in zip(splits, scores, strict=True) if score >= best * (1 - TIE)
    )
    goes_left = X[rows, node.feature] < node.cut
    node.left = grow(X, y, mass, rows[goes_left], depth - 1, least, splits)
    node.right = grow(X, y, mass, rows[~goes_left], depth - 1, least, splits)
    return node


def value_at(node: Node, x: Array) -> float:
    """What the tree says of one example."""
    while node.left is not None and node.right is not None:
        node = node.left if x[node.feature] < node.cut else node.right
    return node.value


def correlation(node: Node, mass: Array) -> float:
    """The weighted correlation of the labels and the tree's values, which are their means."""
    explained, todo = 0.0, [node]
    while todo:
        node = todo.pop()
        if node.left is not None and node.right is not None:
            todo += [node.left, node.right]
        else:
            explained += node.value**2 * int(mass[node.rows].sum())
    return float(np.sqrt(explained / int(mass.sum())))


def boost(
    X: Array,
    y: Array,
    weights: Array,
    n_rounds: int,
    depth: int,
    shrinkage: float,
    least_weight: float,
    feature_share: float = 1.0,
) -> list[Node]:
    """The trees, their values not yet shrunk; positive examples must come first."""
    weights = np.where(y > 0, weights / weights[y > 0].sum(), weights)
    weights = np.where(y < 0, weights / weights[y < 0].sum(), weights) / 2
    splits = all_splits(X)
    rng, trees = np.random.default_rng(0), []
    for _ in range(n_rounds):
        total = 0.0
        for weight in weights:
            total += float(weight)
        weights = weights * (WHOLE / total)
        mass = np.rint(weights).astype(np.int64)
        least = max(1, int(least_weight * WHOLE))
        drawn = np.asarray(rng.random(X.shape[1]) < feature_share)
        some = [split for split in splits if drawn[split[0]]]
        tree = grow(X, y, mass, np.arange(len(y)), depth, least, some)
        if correlation(tree, mass) < TOLERANCE:
            break
        trees.append(tree)
        vote = np.array([np.float32(shrinkage * value_at(tree, x)) for x in X], np.float64)
        weights = weights * np.exp(-y * vote)
    return trees


def flattened(tree: Node, depth: int) -> tuple[list[int], list[float], list[float]]:
    """Features, cuts and leaves as a complete tree, unreachable parts empty."""
    level: list[Node | None] = [tree]
    features: list[int] = []
    cuts: list[float] = []
    for _ in range(depth):
        below: list[Node | None] = []
        for node in level:
            is_split = node is not None and node.left is not None
            features.append(node.feature if node is not None and is_split else -1)
            cuts.append(node.cut if node is not None and is_split else np.inf)
            below += [node.left, node.right] if node is not None and is_split else [node, None]
        level = below
    return features, cuts, [0.0 if node is None else node.value for node in level]


def score(trees: list[Node], shrinkage: float, X: Array) -> Array:
    """F of every row."""
    return np.array([sum(shrinkage * value_at(tree, x) for tree in trees) for x in X])
