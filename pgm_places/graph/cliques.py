"""Cliques: sets of nodes that tend to share a label, such as superpixels or rooms."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pgm_places._arguments import travels
from pgm_places._checks import frozen_copy, integer_array, require_type
from pgm_places.errors import InputError


@travels
@dataclass(frozen=True, eq=False)
class Cliques:
    """Sets of nodes, of any sizes; a node may be in several.

    ``members`` (M,) are the nodes of the first set, of the second, ...; ``start`` (C + 1,) is the
    start of each set in it, and the end of the last one.

    Examples
    --------
    >>> cliques = Cliques.of([[0, 1, 2], [2, 3]], 4)
    >>> cliques.sizes.tolist(), cliques.links.tolist()
    ([3, 2], [[0, 0], [1, 0], [2, 0], [2, 1], [3, 1]])
    """

    members: NDArray[np.int64]
    start: NDArray[np.int64]

    @classmethod
    def of(cls, sets: Iterable[ArrayLike], n_nodes: int) -> Self:
        """C sets from lists of node numbers.

        Parameters
        ----------
        sets : iterable of C sequences of int
            The nodes of each set, from 0; sets may overlap.
        n_nodes : int
            N, the number of nodes of the graph.

        Raises
        ------
        InputError
            A set is empty, or names a node twice or one outside the graph.
        """
        members: list[NDArray[np.int64]] = []
        for index, nodes in enumerate(sets):
            name = f"cliques[{index}]"
            part = integer_array(name, nodes, ("M",), low=0, high=max(n_nodes, 1))
            if not len(part) or len(np.unique(part)) != len(part):
                raise InputError(
                    f"{name} must be one or more nodes, each once, got {part.tolist()}"
                )
            members.append(part.astype(np.int64))
        start = np.cumsum([0, *(len(part) for part in members)])
        return cls(
            frozen_copy(np.concatenate([*members, np.zeros(0, np.int64)])), frozen_copy(start)
        )

    @classmethod
    def of_segments(cls, segments: Sequence[int] | NDArray[np.int64]) -> Self:
        """A set for each segment, such as a superpixel.

        Parameters
        ----------
        segments : (N,) int
            The number of each node's segment, -1 for nodes in none.

        Examples
        --------
        >>> Cliques.of_segments([0, 0, -1, 5, 5]).members.tolist()
        [0, 1, 3, 4]
        """
        of_node = integer_array("segments", segments, ("N",), low=-1, high=2**62)
        order = np.argsort(of_node, kind="stable")
        order = order[of_node[order] >= 0]
        _, sizes = np.unique(of_node[order], return_counts=True)
        return cls(frozen_copy(order.astype(np.int64)), frozen_copy(np.cumsum([0, *sizes])))

    @property
    def sizes(self) -> NDArray[np.int64]:
        """(C,) the number of nodes in each set."""
        return np.diff(self.start)

    @cached_property
    def links(self) -> NDArray[np.int64]:
        """(M, 2) pairs of a node and the number of its set."""
        of_set = np.repeat(np.arange(len(self.sizes)), self.sizes)
        return frozen_copy(np.stack([self.members, of_set], axis=1))

    def among(self, keep: NDArray[np.bool_]) -> Cliques:
        """The sets restricted to the nodes of a mask (N,); empty sets are dropped."""
        number = np.cumsum(keep) - 1
        inside = keep[self.members]
        sizes = self.sizes_among(keep)
        members = number[self.members[inside]]
        return Cliques(frozen_copy(members), frozen_copy(np.cumsum([0, *sizes[sizes > 0]])))

    def sizes_among(self, keep: NDArray[np.bool_]) -> NDArray[np.int64]:
        """(C,) nodes of each set in a mask (N,); :meth:`among` drops sets with 0."""
        of_set = self.links[keep[self.members], 1]
        return np.bincount(of_set, minlength=len(self.sizes)).astype(np.int64, copy=False)

    @staticmethod
    def beside(parts: Sequence[Cliques], starts: ArrayLike) -> Cliques:
        """The sets of several graphs in their union; ``starts`` are the graphs' first nodes."""
        begin = np.asarray(starts, np.int64)
        members = [cliques.members + first for cliques, first in zip(parts, begin, strict=True)]
        sizes = np.concatenate([cliques.sizes for cliques in parts])
        return Cliques(frozen_copy(np.concatenate(members)), frozen_copy(np.cumsum([0, *sizes])))


def check_cliques(cliques: Any, n_nodes: int) -> None:
    """Raise InputError unless these are cliques of nodes below ``n_nodes``."""
    require_type("cliques", cliques, Cliques, "; Cliques.of takes lists of nodes")
    integer_array("cliques", cliques.members, ("M",), low=0, high=max(n_nodes, 1))
