"""Inference methods (backends): protocols, traits, registry, label order of learned arrays.

A backend is a frozen dataclass. Its fields are its options with their defaults, documented in its
docstring. Fitted fields carry ``metadata={"learned": True}`` and are NumPy arrays or None; they are
saved with the model and are no options. A backend declares its properties for labelers as
:class:`~pgm_places.inference.backends.Traits`.
"""

import dataclasses
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, fields, replace
from functools import wraps
from typing import Any, Protocol, Self, TypeVar, cast, runtime_checkable

import numpy as np
from numpy.typing import NDArray

from pgm_places._arguments import public
from pgm_places.errors import ConfigError, InputError
from pgm_places.inference.labeling import Labeling
from pgm_places.inference.potentials import Potentials
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

    ConfigError if it declares a trait as an attribute, as in earlier versions.
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
    "independent": "pgm_places.models.mrf:Independent",
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


@dataclass(frozen=True, eq=False, kw_only=True)
class LearnedNames:
    """A method whose learned arrays use the order of labels in ``learned_names``."""

    name_bytes: NDArray[np.uint8] | None = learned()

    @property
    def learned_names(self) -> tuple[str, ...] | None:
        """The K labels in the order of learned arrays; None if these did not come from problems.

        Models of earlier versions lack the names: their problems must have the labels in the order
        of training.
        """
        if self.name_bytes is None:
            return None
        return tuple(self.name_bytes.tobytes().decode().split("\0"))

    def with_names_of(self, problem: LabelingProblem) -> Self:
        """A copy whose learned arrays have the labels in the order of a problem."""
        text = "\0".join(problem.label_names).encode()
        return replace(self, name_bytes=np.frombuffer(text, np.uint8))

    def order_in(self, problem: LabelingProblem) -> NDArray[np.int64]:
        """(K,) the index in a problem of each label in the order of learned arrays.

        InputError if the problem has other labels.
        """
        names = self.learned_names or problem.label_names
        if set(names) != set(problem.label_names):
            raise InputError(
                f"the model has learned the labels {list(names)}, this problem has "
                f"{list(problem.label_names)}; learn from such problems, or name them alike"
            )
        return np.array([problem.label_names.index(name) for name in names])


Method = TypeVar("Method", bound=Callable[..., Any])


def in_learned_order(method: Method) -> Method:
    """Decorate a method of one problem: labels are in the learned order inside.

    Results are returned in the problem's order. The arguments ``truth`` (N,) and ``further`` (N, K)
    are reordered, too.
    """

    @wraps(method)
    def ordered(self: LearnedNames, problem: LabelingProblem, **options: Any) -> Any:
        names = self.learned_names
        if not isinstance(problem, LabelingProblem) or names in (None, problem.label_names):
            return method(self, problem, **options)
        if names is not None and len(names) != problem.n_labels:
            return method(self, problem, **options)  # which has its own words for that
        order = self.order_in(problem)
        if options.get("truth") is not None:
            options["truth"] = renumbered(np.asarray(options["truth"]), order)
        if options.get("further") is not None:
            options["further"] = np.asarray(options["further"])[:, order]
        return _restored(method(self, reordered(problem, order), **options), order)

    return cast(Method, ordered)


def renumbered(labels: NDArray[np.integer], order: NDArray[np.int64]) -> NDArray[np.int64]:
    """The labels renumbered so that label ``order[k]`` becomes k; -1 stays.

    Examples
    --------
    >>> renumbered(np.array([2, -1, 0]), np.array([2, 0, 1])).tolist()
    [0, -1, 1]
    """
    return np.append(np.argsort(order), -1)[labels]


def reordered(problem: LabelingProblem, order: NDArray[np.int64]) -> LabelingProblem:
    """The problem with label ``order[k]`` at index k."""
    return replace(
        problem,
        label_names=tuple(problem.label_names[k] for k in order),
        unary=None if problem.unary is None else problem.unary[:, order],
        known=None if problem.known is None else renumbered(problem.known, order),
    )


def reordered_potentials(potentials: Potentials, order: NDArray[np.int64]) -> Potentials:
    """The potentials with label ``order[k]`` at index k."""
    tables, earned = potentials.pairwise, potentials.agreement
    return Potentials(
        potentials.unary[:, order],
        None if tables is None else tables[..., order, :][..., order],
        None if earned is None else earned[:, order],
    )


def restored_labeling(labeling: Labeling, order: NDArray[np.int64]) -> Labeling:
    """A labelling of a :func:`reordered` problem, converted to the original order."""
    place, info = np.argsort(order), dict(labeling.info)
    if "node_marginals" in info:
        info["node_marginals"] = info["node_marginals"][:, place]
    beliefs = None if labeling.beliefs is None else labeling.beliefs[:, place]
    labels = order.astype(labeling.labels.dtype)[labeling.labels]
    return replace(labeling, labels=labels, beliefs=beliefs, info=info)


def _restored(result: Any, order: NDArray[np.int64]) -> Any:
    if isinstance(result, Labeling):
        return restored_labeling(result, order)
    place = np.argsort(order)
    if isinstance(result, Potentials):
        return reordered_potentials(result, place)
    return result[:, place]
