"""Input and output types of decoders."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING, Annotated, Any

import numpy as np
from numpy.typing import NDArray

from pgm_places.graph.label_graph import LabelGraph
from pgm_places.inference.labeling import Status
from pgm_places.inference.potentials import Potentials
from pgm_places.options.marks import Ge, Lt

if TYPE_CHECKING:
    from pgm_places.solvers.pairwise import PairwiseModel


Damping = Annotated[float, Ge(0), Lt(1)]
"""Weight of the old message or belief in an update."""


def model_of(graph: LabelGraph, potentials: Potentials) -> "PairwiseModel":
    """The solvers' model of potentials on a graph."""
    from pgm_places.solvers.pairwise import pairwise_model

    return pairwise_model(potentials.unary, graph.edges, potentials.agreement, potentials.pairwise)


@dataclass(frozen=True)
class DecodingTask:
    """The input of a decoder.

    Parameters
    ----------
    graph, potentials
        The problem; shapes are checked.
    record : callable
        To be called after each iteration with its number, from 1, and a measure of progress.
    limit : int, optional
        Limit of the iterations, if the user has set one.
    inside : bool
        Whether ``info`` should include internal quantities such as messages, if there are any.
    damping : float, optional
        Weight of old messages or beliefs in an update, if the user has set one.
    """

    graph: LabelGraph
    potentials: Potentials
    record: Callable[[int, float], None]
    limit: int | None = None
    inside: bool = False
    damping: float | None = None

    @cached_property
    def model(self) -> "PairwiseModel":
        """The solvers' model of the problem."""
        return model_of(self.graph, self.potentials)

    def limited(self, name: str = "max_iterations") -> dict[str, Any]:
        """Keyword arguments of a solver: the limit, if any, under its name, and the reporter."""
        chosen: dict[str, Any] = {"on_iteration": self.record}
        if self.limit is not None:
            chosen[name] = self.limit
        return chosen

    def damped(self, default: float = 0.0) -> dict[str, Any]:
        """The keyword arguments of :meth:`limited` and the damping."""
        return {**self.limited(), "damping": default if self.damping is None else self.damping}


@dataclass(frozen=True)
class DecodingAnswer:
    """The output of a decoder; the score is computed from the labels.

    Parameters
    ----------
    labels : (N,) int
        A label index per node. If they are forbidden (-inf), an allowed labelling is searched.
    status : Status
        ``EXACT`` only if the labelling is proved optimal, else ``CONVERGED``, or ``STOPPED`` at the
        limit.
    bound : float, optional
        Upper bound of all scores. If it equals the score up to rounding, the status becomes
        ``EXACT``.
    beliefs : (N, K) float, optional
        Probability of each label at each node; rows sum to one.
    info : mapping
        Further results by name.
    """

    labels: NDArray[np.int64]
    status: Status
    bound: float | None = None
    beliefs: NDArray[np.floating[Any]] | None = None
    info: Mapping[str, Any] = field(default_factory=dict)


@dataclass(frozen=True)
class NamedDecoder:
    """A decoder and its capabilities.

    Parameters
    ----------
    run : callable
        The decoder.
    gives_beliefs : bool
        Whether its answers have beliefs.
    labels_maps : bool
        Whether it supports graphs of many cycles, such as the cells of a map.
    """

    run: Callable[[DecodingTask], DecodingAnswer]
    gives_beliefs: bool = False
    labels_maps: bool = True


def converged(is_converged: bool) -> Status:
    """CONVERGED or STOPPED: the status of a local method."""
    return Status.CONVERGED if is_converged else Status.STOPPED
