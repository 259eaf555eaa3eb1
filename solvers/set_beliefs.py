"""Sum-product messages from cliques to their nodes.

The auxiliary nodes of :mod:`pgm_places.solvers.set_terms` are exact for the best labelling, where
only the best label of an auxiliary node counts. In a sum over labellings all of its labels count,
which is another distribution. Beliefs therefore need the sets themselves, as functions of the
number of their nodes with each label.
"""

from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from pgm_places._checks import freeze
from pgm_places._core import pass_from_sets
from pgm_places.errors import InputError
from pgm_places.solvers.pairwise import PairwiseModel
from pgm_places.solvers.set_terms import SetNodes


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
    """Rewards of sets as a sum over labels of a function of the number of nodes with the label.

    Parameters
    ----------
    sets : SetNodes
    rewards : (C, K) float
        Reward per node of a set whose nodes all agree.

    Raises
    ------
    InputError
        Three labels or more and a dissent above 1/2: several labels of a set may then earn a
        reward, of which only the largest counts, which is not a sum over labels.
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
    """Messages of sets to their members, and the model whose unaries include them.

    Parameters
    ----------
    model : PairwiseModel
        Without the sets.
    tables : SetTables
    """

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
