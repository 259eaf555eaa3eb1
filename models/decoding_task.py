"""Input and output types of decoders."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING, Annotated, Any

import numpy as np
from numpy.typing import NDArray

from pgm_places._option_marks import Ge, Lt
from pgm_places.graph.label_graph import LabelGraph
from pgm_places.inference.labeling import Status
from pgm_places.inference.potentials import Potentials

if TYPE_CHECKING:
    from pgm_places.solvers.pairwise import PairwiseModel


Damping = Annotated[float, Ge(0), Lt(1)]
"""Share of an old message or belief that an iteration keeps."""


def model_of(graph: LabelGraph, potentials: Potentials) -> "PairwiseModel":
    """Potentials on a graph as every solver takes them."""
    from pgm_places.solvers.pairwise import pairwise_model

    return pairwise_model(potentials.unary, graph.edges, potentials.agreement, potentials.pairwise)


@dataclass(frozen=True)
class DecodingTask:
    """What a decoder gets.

    Parameters
    ----------
    graph, potentials
        The problem: they fit each other.
    record : callable
        To be called after each iteration with its number, from 1, and a figure of the decoder's.
    limit : int, optional
        Of the iterations, where the user has set one.
    inside : bool
        Whether ``info`` is to show what led to the answer, where there is something to show.
    damping : float, optional
        Share of the old messages or beliefs that an iteration keeps, where the user has set one.
    """

    graph: LabelGraph
    potentials: Potentials
    record: Callable[[int, float], None]
    limit: int | None = None
    inside: bool = False
    damping: float | None = None

    @cached_property
    def model(self) -> "PairwiseModel":
        """The problem as every solver takes it."""
        return model_of(self.graph, self.potentials)

    def limited(self, name: str = "max_iterations") -> dict[str, Any]:
        """The limit under the solver's name for it, where there is one, and the reporter."""
        chosen: dict[str, Any] = {"on_iteration": self.record}
        if self.limit is not None:
            chosen[name] = self.limit
        return chosen

    def damped(self, default: float = 0.0) -> dict[str, Any]:
        """The same with a damping, for solvers that have one."""
        return {**self.limited(), "damping": default if self.damping is None else self.damping}


@dataclass(frozen=True)
class DecodingAnswer:
    """What a decoder finds; its score is worked out from the labels.

    Parameters
    ----------
    labels : (N,) int
        A label index per node. Where they break a rule (-inf), others that do not are searched.
    status : Status
        ``EXACT`` only if it is proved that no labelling scores more, else ``CONVERGED`` at an end
        of the decoder's own and ``STOPPED`` at the limit.
    bound : float, optional
        What no labelling scores more than. One that rounding alone parts from the score turns the
        status into ``EXACT``.
    beliefs : (N, K) float, optional
        Probability of each label at each node; rows sum to one.
    info : mapping
        What else there is to say.
    """

    labels: NDArray[np.int64]
    status: Status
    bound: float | None = None
    beliefs: NDArray[np.floating[Any]] | None = None
    info: Mapping[str, Any] = field(default_factory=dict)


@dataclass(frozen=True)
class NamedDecoder:
    """A decoder, and what is to be known of it before it is run.

    Parameters
    ----------
    run : callable
        The decoder.
    gives_beliefs : bool
        Whether its answers have beliefs.
    labels_maps : bool
        Whether it takes graphs of many cycles, such as the cells of a map.
    """

    run: Callable[[DecodingTask], DecodingAnswer]
    gives_beliefs: bool = False
    labels_maps: bool = True


def converged(is_converged: bool) -> Status:
    """The status of a local method that came to rest, or was stopped."""
    return Status.CONVERGED if is_converged else Status.STOPPED
