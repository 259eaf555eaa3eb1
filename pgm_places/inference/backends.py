"""Inference by name: the two protocols, the registry of methods, and how plugins add theirs.

A backend is a frozen dataclass. Its fields are its options, its defaults are the defaults, its
docstring is their reference. Fields that learning fills carry ``metadata={"learned": True}`` and
are NumPy arrays or None; they are saved with the model and are no options. What labelers may take
for granted of it, it declares as :class:`~pgm_places.inference.backends.Traits`.
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
    """What a method can do without, and what it cannot do; the defaults hold for any method.

    Parameters
    ----------
    uses_node_features : bool
        Whether it looks at a problem's node features; they need not be computed for one that does
        not.
    chains_only : bool
        Whether it labels nothing but chains, such as trajectories; it is refused for other graphs
        before anything is learned.
    learns_from_labels : bool
        Whether ``fit`` looks at labels alone, not at what classifiers say of the nodes.
    takes_single_precision : bool
        Whether log-probabilities in single precision are good enough for its labels.
    sees_parts_alone : bool
        Whether the scores of a part of a graph do not depend on other parts that no edge leads to:
        many small problems may then be labelled as one. A weight by the mean degree of the whole
        graph does depend on them.
    labelling_options : tuple of str
        Options that only ``infer`` reads: methods that differ in nothing else learn the same, and
        are fitted once.

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
    """The traits that a method or its class declares as ``traits``; the defaults without any.

    Raises
    ------
    ConfigError
        It declares one by itself, as methods for earlier versions did.
    """
    declared = getattr(method, "traits", None)
    if isinstance(declared, Traits):
        return declared
    for item in fields(Traits):
        if hasattr(method, item.name):
            cls = method if isinstance(method, type) else type(method)
            value = getattr(method, item.name)
            raise ConfigError(
                f"{cls.__name__} declares {item.name} by itself; declare "
                f"traits: ClassVar[Traits] = Traits({item.name}={value!r}) instead"
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
"""Built-in methods: name -> "module:Class", imported only when used."""

# Options by the names that models saved by earlier versions use, and their names now.
RENAMED = {
    "relaxation": {"iterations": "max_iterations", "prior_share": "evidence"},
    "amn": {"tolerance": "learning_tolerance"},
}

# Values of options that models saved by earlier versions have, and those now.
REPLACED = {("amn", "learner", "frank-wolfe"): "cutting-plane"}

# Methods of earlier versions, and what to use instead.
RETIRED = {"space_field": "use 'potts' with unary = 'space', which labels as well"}

# Options that configurations may still call by these names, in this release for the last time.
FORMER = {"relaxation": {"prior_share": "evidence"}}

METHODS = Registry(
    "method", "pgm_places.inference.backends", BACKENDS, RENAMED, REPLACED, RETIRED, FORMER
)
"""Where methods are looked up; packages add theirs to the entry points of that group."""


@runtime_checkable
class Backend(Protocol):
    """What can label a problem."""

    def infer(self, problem: LabelingProblem) -> Labeling:
        """A label for every node of the problem."""


@runtime_checkable
class Learnable(Protocol):
    """A backend with parameters to learn."""

    def fit(
        self, problems: Sequence[LabelingProblem], labelings: Sequence[NDArray[np.int64]]
    ) -> Self:
        """A new, fitted backend.

        ``labelings[m]`` is (N,) for problem ``m``: the true label index per node, -1 where it is
        not known.
        """


def learned(*, given: bool = False, **keywords: Any) -> Any:
    """A dataclass field that learning fills: an array or None, stored with the model.

    One that may be ``given`` instead is taken by :func:`build` as well.
    """
    marks = {"learned": True, "given": given}
    return dataclasses.field(default=None, repr=False, metadata=marks, **keywords)


def backend_names() -> list[str]:
    """The names of all methods that are built in or installed as plugins."""
    return METHODS.names()


@public
def build(name: str, options: Mapping[str, Any] | None = None, /, **further: Any) -> Any:
    """The method of that name with those options, given as a mapping, by keyword, or both.

    Raises
    ------
    ConfigError
        An unknown method or option (the nearest is offered), or a value that the method refuses.

    Examples
    --------
    >>> build("independent")
    Independent()
    >>> build("potts", weight=0.5).weight
    0.5
    """
    return METHODS.build(name, {**(options or {}), **further})
