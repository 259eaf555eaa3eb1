"""Robust P^n Potts terms of sets of nodes in max-margin learning: features and linear weights.

With features z_c (G,) and weights w_s (G, K), both at least 0, a set c earns::

    max_k (w_s[:, k] . z_c) max(0, n - d_k / q),

which is linear in the weights up to q = 1/2, since then only one label can earn a reward.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pgm_places._checks import finite_array, freeze, set_frozen
from pgm_places._core import pass_from_sets
from pgm_places.errors import InputError
from pgm_places.graph.cliques import Cliques, check_cliques
from pgm_places.solvers.pairwise import PairwiseModel


@dataclass(frozen=True, eq=False)
class SetNodes:
    """Auxiliary nodes and links that represent the sets of a graph."""

    cliques: Cliques
    """C sets with M members together."""
    n_nodes: int
    """N, the nodes of the graph; the nodes of sets follow."""
    n_labels: int
    """K."""
    dissent: float
    """q, the share of its nodes, above 0 and up to 1, that may differ before a set earns
    nothing."""

    def __post_init__(self) -> None:
        if not 0 < self.dissent <= 1:
            raise InputError(f"a set's dissent must be in (0, 1], got {self.dissent}")
        check_cliques(self.cliques, self.n_nodes)

    @property
    def n_sets(self) -> int:
        """C."""
        return len(self.cliques.sizes)

    @property
    def n_whole(self) -> int:
        """Nodes of the graph and of the sets together."""
        return self.n_nodes + len(self._mask) * self.n_sets

    @property
    def n_whole_labels(self) -> int:
        """K, and one more, "mixed", where there are three or more."""
        return self.n_labels + (self.n_labels > 2)

    @cached_property
    def _mask(self) -> NDArray[np.bool_]:
        """(A, K) whether each of the A nodes of a set represents a label."""
        if self.n_labels == 2 and self.dissent < 0.5:
            return np.eye(2, dtype=np.bool_)
        return np.ones((1, self.n_labels), np.bool_)

    @cached_property
    def links(self) -> NDArray[np.int32]:
        """(A M, 2) links of each member with each node of its set."""
        node, of_set = self.cliques.links.T
        first = self.n_nodes + self.n_sets * np.arange(len(self._mask))
        ends = (first[:, None] + of_set).ravel()
        members = np.tile(node, len(self._mask))
        return np.stack([members, ends], axis=1).astype(np.int32)

    def unary(
        self, unary: NDArray[np.float64], rewards: NDArray[np.float64]
    ) -> NDArray[np.float64]:
        """(N + A C, K') the unary (N, K), then the unary of the nodes of sets; rewards (C, K)."""
        k = self.n_labels
        out = np.full((self.n_whole, self.n_whole_labels), -np.inf)
        out[: self.n_nodes, :k] = unary
        at_sets = out[self.n_nodes :].reshape(len(self._mask), self.n_sets, -1)
        at_sets[...] = 0.0
        base = rewards * (self.cliques.sizes * (1.0 - 1.0 / self.dissent))[:, None]
        at_sets[:, :, :k] = self._mask[:, None] * base
        return out

    def link_rewards(self, rewards: NDArray[np.float64]) -> NDArray[np.float64]:
        """(A M, K') reward of each link for each label at both ends."""
        k = self.n_labels
        out = np.zeros((len(self._mask), len(self.cliques.members), self.n_whole_labels))
        out[:, :, :k] = self._mask[:, None] * (rewards / self.dissent)[self.cliques.links[:, 1]]
        return out.reshape(-1, self.n_whole_labels)

    def agreement(
        self, agreement: NDArray[np.float64], rewards: NDArray[np.float64]
    ) -> NDArray[np.float64]:
        """(E + A M, K') rewards of agreement of the edges (E, K), then of the links."""
        wide = np.pad(agreement, ((0, 0), (0, self.n_whole_labels - self.n_labels)))
        return np.concatenate([wide, self.link_rewards(rewards)])

    def tables(
        self, tables: NDArray[np.float64], rewards: NDArray[np.float64]
    ) -> NDArray[np.float64]:
        """(E + A M, K', K') tables of the edges (E, K, K), then of the links."""
        wider = (0, self.n_whole_labels - self.n_labels)
        links = self.link_rewards(rewards)[:, :, None] * np.eye(self.n_whole_labels)
        return np.concatenate([np.pad(tables, ((0, 0), wider, wider)), links])

    def lift(self, labels: NDArray[np.int64], rewards: NDArray[np.float64]) -> NDArray[np.int64]:
        """A labelling (N,) extended by the best labels of the nodes of sets."""
        k = self.n_labels
        member, end = self.links.T
        earned = self.unary(np.zeros((self.n_nodes, k)), rewards)
        reward = self.link_rewards(rewards)[np.arange(len(end)), labels[member]]
        np.add.at(earned, (end, labels[member]), reward)
        return np.concatenate([labels, earned[self.n_nodes :].argmax(axis=1)])

    def agreed(self, labels: NDArray[np.integer]) -> NDArray[np.float64]:
        """(C, K) ``max(0, n - d_k / q)`` for a labelling (N,): the factor of each reward.

        Up to q = 1/2 a set has at most one entry above 0, so its score is linear in the rewards.
        """
        node, of_set = self.cliques.links.T
        cells = of_set * self.n_labels + labels[node]
        same = np.bincount(cells, minlength=self.n_sets * self.n_labels)
        sizes = self.cliques.sizes[:, None]
        differing = sizes - same.reshape(-1, self.n_labels)
        return np.maximum(sizes - differing / self.dissent, 0.0)

    def score(self, rewards: NDArray[np.float64], labels: NDArray[np.integer]) -> float:
        """Total score of the sets for a labelling (N,) and rewards (C, K)."""
        return float((rewards * self.agreed(labels)).max(axis=1, initial=0.0).sum())


# Beyond, two labels of a set may earn a reward, and their maximum is not linear.
MOST_DISSENT = 0.5


@dataclass(frozen=True, eq=False)
class SetTerms:
    """The sets of a learning problem."""

    nodes: SetNodes
    """Their auxiliary nodes and links."""
    features: NDArray[np.float64]
    """(C, G) at least 0."""

    def __post_init__(self) -> None:
        features = finite_array("clique_features", self.features, (self.nodes.n_sets, "G"))
        if features.min(initial=0.0) < 0:
            raise InputError(f"clique_features must be at least 0, got {features.min():g}")
        if self.nodes.dissent > MOST_DISSENT:
            raise InputError(
                f"weights of sets are learned up to a dissent of {MOST_DISSENT}, got "
                f"{self.nodes.dissent}; with more, several labels of a set could earn a reward"
            )
        set_frozen(self, features=features)

    @classmethod
    def of(
        cls, cliques: Cliques, features: ArrayLike, n_nodes: int, n_labels: int, dissent: float
    ) -> "SetTerms":
        """The terms of the cliques of a graph of ``n_nodes`` nodes."""
        return cls(SetNodes(cliques, n_nodes, n_labels, dissent), np.asarray(features, np.float64))

    def check_fits(self, n_nodes: int, n_labels: int) -> None:
        """Raise InputError unless the sets belong to a problem of this size."""
        if (self.nodes.n_nodes, self.nodes.n_labels) != (n_nodes, n_labels):
            raise InputError(
                f"the sets belong to a problem of {self.nodes.n_nodes} nodes and "
                f"{self.nodes.n_labels} labels, but this one has {n_nodes} and {n_labels}"
            )

    def joint_features(self, labels: NDArray[np.integer]) -> NDArray[np.float64]:
        """(G K,) sums of the features of sets by rewarded label, times the reward's factor."""
        return (self.features.T @ self.nodes.agreed(labels)).ravel()

    def among(self, keep: NDArray[np.bool_]) -> "SetTerms":
        """The terms on the nodes of a mask (N,)."""
        sets = self.nodes
        remaining = sets.cliques.sizes_among(keep) > 0
        smaller = SetNodes(sets.cliques.among(keep), int(keep.sum()), sets.n_labels, sets.dissent)
        return SetTerms(smaller, self.features[remaining])

    @property
    def joins(self) -> NDArray[np.int32]:
        """Pairs of nodes that join each set's nodes to its first node."""
        node, of_set = self.nodes.cliques.links.T
        first = self._first[of_set]
        return np.stack([first, node], axis=1)[first != node].astype(np.int32)

    @property
    def _first(self) -> NDArray[np.int64]:
        return self.nodes.cliques.members[self.nodes.cliques.start[:-1]]

    def times(self, shares: NDArray[np.float64]) -> "SetTerms":
        """The terms with features multiplied by the ``share`` (N,) of each set's nodes."""
        return SetTerms(self.nodes, self.features * shares[self._first][:, None])

    @staticmethod
    def beside(parts: Sequence["SetTerms"], starts: ArrayLike) -> "SetTerms | None":
        """The terms of several problems as blocks of one, whose nodes begin at ``starts``."""
        if not parts:
            return None
        first = parts[0].nodes
        nodes = SetNodes(
            Cliques.beside([part.nodes.cliques for part in parts], starts),
            sum(part.nodes.n_nodes for part in parts),
            first.n_labels,
            first.dissent,
        )
        return SetTerms(nodes, np.concatenate([part.features for part in parts]))


class SetTables(NamedTuple):
    """Rewards of C sets with M members in total."""

    start: NDArray[np.int64]
    """(C + 1,) start of the members of each set, and the end of the last set."""
    member: NDArray[np.int64]
    """(M,) nodes."""
    worth: NDArray[np.float64]
    """(K, M + C) of each set in turn, for 0, 1, ... n nodes with a label: where a set's members
    begin in ``member``, its worths begin here as many places later as there are sets before."""
    log_gain: NDArray[np.float64]
    """(K, M + C) ``log(exp(worth) - 1)``."""


def set_tables(sets: SetNodes, rewards: NDArray[np.float64]) -> SetTables:
    """Rewards (C, K) as a sum over labels of a function of the number of nodes with the label.

    InputError with three labels or more and a dissent above 1/2: several labels of a set may then
    earn a reward, of which only the largest counts.
    """
    k, dissent = sets.n_labels, sets.dissent
    if k > 2 and dissent > 0.5:
        raise InputError(
            f"beliefs with cliques need a dissent of at most 0.5 or two labels, got {dissent:g} "
            f"and {k} labels; lower it, or use a decoder that gives labels only"
        )
    parts = [np.zeros((k, 0))]
    for size, reward in zip(sets.cliques.sizes, rewards, strict=True):
        differing = size - np.arange(size + 1.0)
        earned = reward[:, None] * np.maximum(size - differing / dissent, 0.0)
        if k == 2:  # a node without one label has the other
            earned = np.stack([np.zeros(size + 1), np.maximum(earned[0][::-1], earned[1])])
        parts.append(earned)
    worth = np.concatenate(parts, axis=1)
    log_gain = np.full(worth.shape, -np.inf)
    some = worth > 0
    log_gain[some] = worth[some] + np.log(-np.expm1(-worth[some]))
    start, members = sets.cliques.start, sets.cliques.members
    return SetTables(freeze(start), freeze(members), freeze(worth), freeze(log_gain))


class SetMessages:
    """Messages of sets to their members, and the model whose unaries include them."""

    def __init__(self, model: PairwiseModel, tables: SetTables) -> None:
        self._tables = tables
        self._message = np.zeros((len(tables.member), model.n_labels))
        self._field = model.unary.copy()
        self.model = replace(model, unary=self._field)

    def renew(self, heard: NDArray[np.float64]) -> float:
        """Update all messages, and ``heard`` (N, K) of the nodes in place; the largest change."""
        return float(pass_from_sets(self._tables, heard, self._field, self._message))


def set_slots(model: PairwiseModel, tables: SetTables | None) -> tuple[Any, ...]:
    """Input of mean field for sets: the tables, and the slots of each node; () without sets."""
    if tables is None:
        return ()
    set_of = np.repeat(np.arange(len(tables.start) - 1), np.diff(tables.start))
    slots = np.argsort(tables.member, kind="stable")
    slot_start = np.searchsorted(tables.member[slots], np.arange(model.n_nodes + 1))
    return tables, set_of, slot_start, slots


def set_unit(model: PairwiseModel, tables: SetTables | None) -> float:
    """The unit of a model's potentials, or of the reward per node of sets if that is smaller."""
    steps = np.zeros(0) if tables is None else np.diff(tables.worth, axis=1)
    steps = steps[steps > 0]
    units = [model.unit, float(np.median(steps)) if len(steps) else 0.0]
    return min((unit for unit in units if unit > 0), default=0.0)
