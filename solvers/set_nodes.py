"""Robust P^n Potts potentials: sets of nodes that want one label, by a few further nodes each.

A set c of n nodes, of which d_k differ from label k, earns::

    max(0, max_k r_ck (n - d_k / q)),   r_ck >= 0,

the less the more nodes differ, until a share q of them does (P. Kohli, L. Ladicky, P. Torr, "Robust
higher order potentials for enforcing label consistency", IJCV 82 (2009)). A node that stands for
the set takes label k, or a label of its own that says "mixed"; links reward the nodes that agree
with it. What is left is pairwise and associative, so that every decoder takes it.

With two labels "mixed" is not needed, and a minimum cut stays exact: from q = 1/2 on one of the
labels always earns something; below, two nodes stand for a set, and the one that speaks for label k
says "mixed" by taking the other label. No set can then be rewarded for both.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from pgm_places.errors import InputError
from pgm_places.graph.cliques import Cliques

__all__ = ["SetNodes"]


@dataclass(frozen=True, eq=False)
class SetNodes:
    """The nodes and links that stand for the sets of a graph.

    Parameters
    ----------
    cliques : Cliques
        C sets with M members together.
    n_nodes : int
        N, the nodes of the graph; those of the sets follow them.
    n_labels : int
        K.
    dissent : float
        q, the share of its nodes, above 0 and up to 1, that may differ before a set earns nothing.

    Examples
    --------
    >>> sets = SetNodes(Cliques.of([[0, 1, 2, 3]], 4), 4, 3, 0.5)
    >>> sets.n_whole, sets.n_whole_labels, len(sets.links)
    (5, 4, 4)
    >>> [sets.score(np.ones((1, 3)), np.array(y)) for y in ([0] * 4, [0, 0, 0, 1], [0, 0, 1, 2])]
    [4.0, 2.0, 0.0]
    """

    cliques: Cliques
    n_nodes: int
    n_labels: int
    dissent: float

    def __post_init__(self) -> None:
        if not 0 < self.dissent <= 1:
            raise InputError(f"a set's dissent must be in (0, 1], got {self.dissent}")
        self.cliques.check_fits(self.n_nodes)

    @property
    def n_sets(self) -> int:
        """C."""
        return len(self.cliques.sizes)

    @property
    def n_whole(self) -> int:
        """Nodes of the graph and of the sets together."""
        return self.n_nodes + len(self._speaks) * self.n_sets

    @property
    def n_whole_labels(self) -> int:
        """K, and one more, "mixed", where there are three or more."""
        return self.n_labels + (self.n_labels > 2)

    @cached_property
    def _speaks(self) -> NDArray[np.bool_]:
        """(A, K) the labels that each of the A nodes of a set speaks for."""
        if self.n_labels == 2 and self.dissent < 0.5:
            return np.eye(2, dtype=np.bool_)
        return np.ones((1, self.n_labels), np.bool_)

    @cached_property
    def links(self) -> NDArray[np.int32]:
        """(A M, 2) each member with each node of its set, after the edges of the graph."""
        node, of_set = self.cliques.links.T
        first = self.n_nodes + self.n_sets * np.arange(len(self._speaks))
        ends = (first[:, None] + of_set).ravel()
        members = np.tile(node, len(self._speaks))
        return np.stack([members, ends], axis=1).astype(np.int32)

    def unary(
        self, unary: NDArray[np.float64], rewards: NDArray[np.float64]
    ) -> NDArray[np.float64]:
        """(N + A C, K') the unary (N, K) with that of the nodes of sets; rewards are (C, K)."""
        k = self.n_labels
        out = np.full((self.n_whole, self.n_whole_labels), -np.inf)
        out[: self.n_nodes, :k] = unary
        at_sets = out[self.n_nodes :].reshape(len(self._speaks), self.n_sets, -1)
        at_sets[...] = 0.0
        base = rewards * (self.cliques.sizes * (1.0 - 1.0 / self.dissent))[:, None]
        at_sets[:, :, :k] = self._speaks[:, None] * base
        return out

    def link_rewards(self, rewards: NDArray[np.float64]) -> NDArray[np.float64]:
        """(A M, K') what each link earns where both ends have a label."""
        k = self.n_labels
        out = np.zeros((len(self._speaks), len(self.cliques.members), self.n_whole_labels))
        out[:, :, :k] = self._speaks[:, None] * (rewards / self.dissent)[self.cliques.links[:, 1]]
        return out.reshape(-1, self.n_whole_labels)

    def agreement(
        self, agreement: NDArray[np.float64], rewards: NDArray[np.float64]
    ) -> NDArray[np.float64]:
        """(E + A M, K') the rewards of agreement (E, K) with those of the links."""
        wide = np.pad(agreement, ((0, 0), (0, self.n_whole_labels - self.n_labels)))
        return np.concatenate([wide, self.link_rewards(rewards)])

    def tables(
        self, tables: NDArray[np.float64], rewards: NDArray[np.float64]
    ) -> NDArray[np.float64]:
        """(E + A M, K', K') the tables of the edges (E, K, K) with those of the links."""
        wider = (0, self.n_whole_labels - self.n_labels)
        links = self.link_rewards(rewards)[:, :, None] * np.eye(self.n_whole_labels)
        return np.concatenate([np.pad(tables, ((0, 0), wider, wider)), links])

    def lift(self, labels: NDArray[np.int64], rewards: NDArray[np.float64]) -> NDArray[np.int64]:
        """A labelling (N,) with that of the nodes of sets, which earns them the most."""
        k = self.n_labels
        member, end = self.links.T
        earned = self.unary(np.zeros((self.n_nodes, k)), rewards)
        reward = self.link_rewards(rewards)[np.arange(len(end)), labels[member]]
        np.add.at(earned, (end, labels[member]), reward)
        return np.concatenate([labels, earned[self.n_nodes :].argmax(axis=1)])

    def agreed(self, labels: NDArray[np.integer]) -> NDArray[np.float64]:
        """(C, K) ``max(0, n - d_k / q)`` for a labelling (N,): what a reward is multiplied by.

        Up to q = 1/2 no set has two entries above 0: what it earns is linear in the rewards.
        """
        node, of_set = self.cliques.links.T
        cells = of_set * self.n_labels + labels[node]
        same = np.bincount(cells, minlength=self.n_sets * self.n_labels)
        sizes = self.cliques.sizes[:, None]
        differing = sizes - same.reshape(-1, self.n_labels)
        return np.maximum(sizes - differing / self.dissent, 0.0)

    def score(self, rewards: NDArray[np.float64], labels: NDArray[np.integer]) -> float:
        """What the sets of a labelling (N,) earn together, for rewards (C, K)."""
        return float((rewards * self.agreed(labels)).max(axis=1, initial=0.0).sum())
