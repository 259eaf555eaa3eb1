"""Inference methods (backends): their protocols, traits, and the registry with plug-ins.

A backend is a frozen dataclass. Its fields are its options with their defaults, documented in its
docstring. Fitted fields carry ``metadata={"learned": True}`` and are NumPy arrays or None; they are
saved with the model and are no options. A backend declares its properties for labelers as
:class:`~pgm_places.inference.backends.Traits`.
"""

import dataclasses
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields
from typing import Any, Protocol, Self, runtime_checkable

import numpy as np
from numpy.typing import NDArray

from pgm_places._arguments import public
from pgm_places.errors import ConfigError
from pgm_places.inference.labeling import Labeling
from pgm_places.inference.problem import LabelingProblem
from pgm_places.plugins import Registry


@dataclass(frozen=True)
class Traits:
    """Requirements and limits of a method; the defaults are safe for any method.

    Parameters
    ----------
    uses_node_features : bool
        Whether it uses a problem's node features; otherwise they are not computed.
    chains_only : bool
        Whether it labels only chains, such as trajectories; it is refused for other graphs before
        training.
    learns_from_labels : bool
        Whether ``fit`` uses only labels, not the scores of classifiers.
    takes_single_precision : bool
        Whether log-probabilities in single precision suffice for its labels.
    sees_parts_alone : bool
        Whether the scores of a connected component do not depend on other components: many small
        problems can then be labelled as one. A weight by the graph's mean degree, for example,
        depends on other components.
    labelling_options : tuple of str
        Options that only ``infer`` reads: methods that differ only in these are fitted once.

    Examples
    --------
    >>> from pgm_places.inference.backends import build
    >>> traits_of(build("hmm")).chains_only, traits_of(build("potts")).chains_only
    (True, False)
    """

    uses_node_features: bool = True
    chains_only: bool = False
    learns_from_labels: bool = False
    takes_single_precision: bool = False
    sees_parts_alone: bool = False
    labelling_options: tuple[str, ...] = ()


def traits_of(method: Any) -> Traits:
    """The traits that a method or its class declares as ``traits``; by default the defaults.

    Raises
    ------
    ConfigError
        It declares a trait as an attribute, as in earlier versions.
    """
    declared = getattr(method, "traits", None)
    if isinstance(declared, Traits):
        return declared
    for trait in fields(Traits):
        if hasattr(method, trait.name):
            cls = method if isinstance(method, type) else type(method)
            value = getattr(method, trait.name)
            raise ConfigError(
                f"{cls.__name__} declares {trait.name} by itself; declare "
                f"traits: ClassVar[Traits] = Traits({trait.name}={value!r}) instead"
            )
    return Traits()


BACKENDS: Mapping[str, str] = {
    "hmm": "pgm_places.models.hmm:HiddenMarkovModel",
    "semi_markov": "pgm_places.models.semi_markov:SemiMarkovModel",
    "independent": "pgm_places.models.independent:Independent",
    "relaxation": "pgm_places.models.relaxation:Relaxation",
    "amn": "pgm_places.models.amn:AssociativeMarkovNetwork",
    "crf": "pgm_places.models.crf:ConditionalRandomField",
    "potts": "pgm_places.models.mrf:PottsField",
}
"""Built-in methods: name -> "module:Class", imported on first use."""

# Former option names in saved models, and their current names.
RENAMED = {
    "relaxation": {"iterations": "max_iterations", "prior_share": "evidence"},
    "amn": {"tolerance": "learning_tolerance"},
}

# Former values of options in saved models, and their current values.
REPLACED = {("amn", "learner", "frank-wolfe"): "cutting-plane"}

# Removed methods, and what to use instead.
RETIRED = {"space_field": "use 'potts' with unary = 'space', which is as accurate"}

# Former option names that configurations may use until the next release.
FORMER = {"relaxation": {"prior_share": "evidence"}}

METHODS = Registry(
    "method", "pgm_places.inference.backends", BACKENDS, RENAMED, REPLACED, RETIRED, FORMER
)
"""The registry of methods; packages add methods as entry points of its group."""


@runtime_checkable
class Backend(Protocol):
    """The protocol of inference methods."""

    def infer(self, problem: LabelingProblem) -> Labeling:
        """A label for every node of the problem."""


@runtime_checkable
class Learnable(Protocol):
    """A backend with parameters to learn."""

    def fit(
        self, problems: Sequence[LabelingProblem], labelings: Sequence[NDArray[np.int64]]
    ) -> Self:
        """A new, fitted backend.

        ``labelings[m]`` (N,) is the true label index per node of problem ``m``, -1 where unknown.
        """


def learned(*, given: bool = False, **keywords: Any) -> Any:
    """A dataclass field for a fitted array or None, stored with the model.

    With ``given``, :func:`build` accepts it as well.
    """
    marks = {"learned": True, "given": given}
    return dataclasses.field(default=None, repr=False, metadata=marks, **keywords)


def backend_names() -> list[str]:
    """The names of all built-in methods and plug-ins."""
    return METHODS.names()


@public
def build(name: str, options: Mapping[str, Any] | None = None, /, **further: Any) -> Any:
    """The named method with options, as a mapping, by keyword, or both.

    Raises
    ------
    ConfigError
        The method or an option is unknown (the nearest is suggested), or a value is refused.

    Examples
    --------
    >>> build("independent")
    Independent()
    >>> build("potts", weight=0.5).weight
    0.5
    """
    return METHODS.build(name, {**(options or {}), **further})
