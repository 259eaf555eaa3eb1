"""How learning went, as arrays that are stored with the model."""

import warnings
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pgm_places.errors import LearningWarning
from pgm_places.solvers.margin_solution import LearningStep, reached, relative_gap

LEARNING_STATUSES = (
    "optimal", "inaccurate", "stalled", "iteration_limit", "time_limit", "stopped",
    "within_tolerance", "oracle_limit", "local_optimum",
)  # fmt: skip
"""Words of :class:`~pgm_places.solvers.margin_solution.LearnedWeights`; records hold their places
here, so new ones come last."""


@dataclass(frozen=True)
class LearningRecord:
    """How learning went.

    Parameters
    ----------
    status : str
        One of :data:`LEARNING_STATUSES`, as :class:`LearnedWeights` explains them.
    penalty : float
        C, given or chosen.
    objective : float
        What the learner says it reached; the QP's value is repaired, hence rigorous.
    lower_bound : float
        No weights reach less (rigorous).
    certified_objective : float or None
        A rigorous upper bound of what was reached, where it was asked for.
    iterations : float
        Cuts, passes, or the QP solver's iterations.
    seconds, certificate_seconds : float
        Wall-clock time of learning and of the certificate.
    n_nodes, n_edges, n_maps : float
        Size of the training set.
    """

    status: str
    penalty: float
    objective: float
    lower_bound: float
    certified_objective: float | None
    iterations: float
    seconds: float
    certificate_seconds: float
    n_nodes: float
    n_edges: float
    n_maps: float

    def to_array(self) -> NDArray[np.float64]:
        """The fields in order: the status as its index in LEARNING_STATUSES, None as -1."""
        first = LEARNING_STATUSES.index(self.status)
        numbers = [getattr(self, name) for name in _FIELDS[1:]]
        return np.array([first, *(-1.0 if n is None else n for n in numbers)], np.float64)

    @classmethod
    def from_array(cls, values: NDArray[np.float64]) -> "LearningRecord":
        """The record that :meth:`to_array` wrote.

        Earlier versions called every closed gap optimal; here only a proved one is.
        """
        named = dict(zip(_FIELDS[1:], (float(value) for value in values[1:]), strict=True))
        certified = named.pop("certified_objective")
        rigorous = None if certified < 0 else certified
        status = LEARNING_STATUSES[int(values[0])]
        if status == "optimal":
            status = reached(rigorous, named["lower_bound"], 0.0)
        return cls(status=status, certified_objective=rigorous, **named)

    @property
    def certified_gap(self) -> float | None:
        """(certified objective - lower bound) / certified objective, where there is one."""
        if self.certified_objective is None:
            return None
        return relative_gap(self.certified_objective, self.lower_bound)

    def summary(self) -> Mapping[str, Any]:
        """The record by name, with the gap and whole numbers as such."""
        named: dict[str, Any] = {name: getattr(self, name) for name in _FIELDS}
        for name in ("iterations", "n_nodes", "n_edges", "n_maps"):
            named[name] = int(named[name])
        named["certified_gap"] = self.certified_gap
        return named


def warn_if_stalled(record: LearningRecord, scale: str) -> None:
    """Say that learning ended too early, and what to do with features scaled in that way."""
    if record.status != "stalled":
        return
    reached = record.certified_objective or record.objective
    if scale == "none":
        remedy = "take scale='auto', after which the units of features do not matter"
    else:
        remedy = f"take a smaller C than {record.penalty:g}"
    warnings.warn(
        f"learning stalled {100 * relative_gap(reached, record.lower_bound):.2g} % above its lower "
        f"bound: it finds no better weights, and those it has may label badly; {remedy}",
        LearningWarning,
        stacklevel=3,
    )


_FIELDS = tuple(LearningRecord.__dataclass_fields__)

N_RECORD = len(_FIELDS)
"""Length of the array of a record."""


def history_array(history: tuple[LearningStep, ...]) -> NDArray[np.float64]:
    """(T, 4): seconds, objective of the best so far, lower bound, active cuts, per iteration."""
    rows = [[s.seconds, s.objective, s.lower_bound, float(s.n_cuts)] for s in history]
    return np.array(rows, np.float64).reshape(-1, 4)
