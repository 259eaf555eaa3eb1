"""Record of learning (status, bounds, times) as an array that is stored with the model."""

import warnings
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pgm_places._checks import learned_number
from pgm_places.errors import LearningWarning
from pgm_places.models.held_out_choice import LEARNERS
from pgm_places.solvers.margin_solution import LearningStep, reached, relative_gap

LEARNING_STATUSES = (
    "optimal", "inaccurate", "stalled", "iteration_limit", "time_limit", "stopped",
    "within_tolerance", "oracle_limit", "local_optimum",
)  # fmt: skip
"""Status words of :class:`~pgm_places.solvers.margin_solution.LearnedWeights`; records store
indices into this tuple, so append new ones."""


REASONS = (
    "chosen by hand",
    "costs about a second or two at this size",
    "the quadratic program would take longer at this size",
    "the quadratic program knows no cliques, known or unknown labels, sparse features or weights "
    "to begin at",
    "exact where no graph has a cycle",
    "labels held-out parts best",
    "no held-out part to compare learners on",
    "likelihoods know no cliques",
    "completes labels that are not known",
)
"""Reasons for the choice of a learner; records store indices, so append new ones."""

NEGLIGIBLE = 1e-4
"""Gap, as a share of C, that is ignored with an offset, where the optimum may be 0."""

LARGE_GAP = 0.1
"""A certified gap above this causes a warning: the weights may label badly."""


@dataclass(frozen=True)
class LearningRecord:
    """Status, bounds and cost of learning."""

    status: str
    """One of :data:`LEARNING_STATUSES`, as :class:`LearnedWeights` explains them."""
    penalty: float
    """C, set or chosen."""
    objective: float
    """The objective by the learner; the QP's is made feasible, hence rigorous."""
    lower_bound: float
    """No weights reach less (rigorous)."""
    certified_objective: float | None
    """A rigorous upper bound of the objective, if requested."""
    iterations: float
    """Cuts, passes, or the QP solver's iterations."""
    seconds: float
    certificate_seconds: float
    """Wall-clock time of learning and of the certificate."""
    n_nodes: float
    n_edges: float
    n_maps: float
    """Size of the training set."""
    learner: str | None = None
    """Name of the learner; None in records of earlier versions."""
    reason: str | None = None
    """Reason for the learner: a sentence of :data:`REASONS`."""

    def to_array(self) -> NDArray[np.float64]:
        """The fields in order: words as indices into the tuples of this module, None as -1."""
        values = {name: getattr(self, name) for name in _FIELDS}
        for name, words in _WORDS.items():
            values[name] = None if values[name] is None else words.index(values[name])
        return np.array([-1.0 if n is None else n for n in values.values()], np.float64)

    @classmethod
    def from_array(cls, values: NDArray[np.float64]) -> "LearningRecord":
        """The record stored by :meth:`to_array`.

        Earlier versions stored ``optimal`` for every closed gap; it is read as such only if proved.
        """
        named: dict[str, Any] = dict(zip(_FIELDS, values.tolist(), strict=len(values) == N_RECORD))
        for name, words in _WORDS.items():
            stored = np.array([named.pop(name, -1)])
            place = learned_number(f"the record's {name}", stored, 0, len(words), low=-1)
            named[name] = None if place < 0 else words[place]
        certified = named.pop("certified_objective")
        rigorous = None if certified < 0 else certified
        status = named.pop("status")
        if status == "optimal":
            status = reached(rigorous, named["lower_bound"], 0.0)
        return cls(status=status, certified_objective=rigorous, **named)

    @property
    def certified_gap(self) -> float | None:
        """(certified objective - lower bound) / certified objective; None without a certificate."""
        if self.certified_objective is None:
            return None
        return relative_gap(self.certified_objective, self.lower_bound)

    def summary(self) -> Mapping[str, Any]:
        """The record by name, with the gap, and integers as int."""
        named: dict[str, Any] = {name: getattr(self, name) for name in _FIELDS}
        for name in ("iterations", "n_nodes", "n_edges", "n_maps"):
            named[name] = int(named[name])
        named["certified_gap"] = self.certified_gap
        return named


def warn_of_gap(
    record: LearningRecord, scale: str, remedies: str, *, has_offset: bool = False
) -> None:
    """Warn that learning ended early or that better weights may exist, with a remedy."""
    gap = record.certified_gap
    rescale = "take scale='auto', after which the units of features do not matter"
    reached = record.certified_objective or record.objective
    if has_offset and reached - record.lower_bound <= NEGLIGIBLE * record.penalty:
        return
    if record.status != "stalled":
        if gap is not None and gap > LARGE_GAP and record.status not in _NO_GAP:
            warnings.warn(
                f"better weights may exist: the certified gap of learning is {100 * gap:.0f} % of "
                f"the objective ({record.status}, C = {record.penalty:g}); "
                f"{rescale if scale == 'none' else remedies}",
                LearningWarning,
                stacklevel=3,
            )
        return
    remedy = rescale if scale == "none" else f"take a smaller C than {record.penalty:g}"
    warnings.warn(
        f"learning stalled {100 * relative_gap(reached, record.lower_bound):.2g} % above its lower "
        f"bound: it finds no better weights, and the current ones may label badly; {remedy}",
        LearningWarning,
        stacklevel=3,
    )


# Ended by the user, or without a lower bound.
_NO_GAP = ("stopped", "local_optimum")

_FIELDS = tuple(LearningRecord.__dataclass_fields__)
_WORDS = {"status": LEARNING_STATUSES, "learner": LEARNERS, "reason": REASONS}

N_RECORD = len(_FIELDS)
"""Length of the array of a record."""

LENGTHS = (N_RECORD - 2, N_RECORD)
"""Accepted lengths: records of earlier versions lack the learner."""


def history_array(history: tuple[LearningStep, ...]) -> NDArray[np.float64]:
    """(T, 4): seconds, objective of the best so far, lower bound, active cuts, per iteration."""
    rows = [[s.seconds, s.objective, s.lower_bound, float(s.n_cuts)] for s in history]
    return np.array(rows, np.float64).reshape(-1, 4)
