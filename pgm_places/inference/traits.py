"""Traits: what labelers may take for granted of a method, declared by its class."""

from dataclasses import dataclass, fields
from typing import Any

from pgm_places.errors import ConfigError

__all__ = ["Traits", "traits_of"]


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
