"""Inference by name: the two protocols, the table of methods, and how third parties add theirs.

A backend is a frozen dataclass. Its fields are its options, its defaults are the defaults, its
docstring is their reference. Fields that learning fills carry ``metadata={"learned": True}`` and
are NumPy arrays or None; they are saved with the model and are no options. One that never looks at
a problem's node features says so with a class attribute ``uses_node_features = False``.
"""

import dataclasses
import importlib
from collections.abc import Iterator, Mapping, Sequence
from importlib.metadata import entry_points
from typing import Any, Protocol, Self, runtime_checkable

import numpy as np
from numpy.typing import NDArray

from pgm_places._checks import nearest_name
from pgm_places.errors import ConfigError
from pgm_places.labeling import Labeling
from pgm_places.problem import LabelingProblem

__all__ = [
    "BACKENDS",
    "Backend",
    "Learnable",
    "backend_class",
    "backend_names",
    "build",
    "learned",
    "uses_node_features",
]

BACKENDS: Mapping[str, str] = {
    "hmm": "pgm_places.models.hmm:HiddenMarkovModel",
    "independent": "pgm_places.models.independent:Independent",
    "relaxation": "pgm_places.models.relaxation:Relaxation",
    "amn": "pgm_places.models.amn:AssociativeMarkovNetwork",
    "potts": "pgm_places.models.mrf:PottsField",
}
"""Built-in methods: name -> "module:Class", imported only when used."""

ENTRY_POINT_GROUP = "pgm_places.backends"


@runtime_checkable
class Backend(Protocol):
    """What can label a problem."""

    def infer(self, problem: LabelingProblem) -> Labeling:
        """A label for every node of the problem."""
        ...


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
        ...


def learned(**keywords: Any) -> Any:
    """A dataclass field that learning fills: an array or None, stored with the model."""
    return dataclasses.field(default=None, repr=False, metadata={"learned": True}, **keywords)


def uses_node_features(backend: Any) -> bool:
    """Whether node features have to be computed for a backend: unless it says that it uses none."""
    return bool(getattr(backend, "uses_node_features", True))


def backend_names() -> list[str]:
    """The names of all methods that are built in or installed as plugins."""
    return sorted({*BACKENDS, *(point.name for point in entry_points(group=ENTRY_POINT_GROUP))})


def backend_class(name: str) -> type[Any]:
    """The class behind a method's name, or behind ``"module:Class"``.

    Raises
    ------
    ConfigError
        No such method; the message offers the nearest name.
    """
    target = BACKENDS.get(name)
    if target is None:
        for point in entry_points(group=ENTRY_POINT_GROUP):
            if point.name == name:
                target = point.value
    if target is None and ":" in name:
        target = name
    if target is None:
        raise ConfigError(f"unknown method {name!r}. {nearest_name(name, backend_names())}")
    module_name, _, class_name = target.partition(":")
    try:
        module = importlib.import_module(module_name)
    except ModuleNotFoundError as error:
        raise ConfigError(f"method {name!r} needs {error.name!r}, which is not installed") from None
    found = getattr(module, class_name, None)
    if not (isinstance(found, type) and dataclasses.is_dataclass(found)):
        raise ConfigError(
            f"method {name!r}: {target} is not a dataclass with its options as fields"
        )
    return found


def option_fields(cls: type[Any]) -> Iterator[dataclasses.Field[Any]]:
    """The fields of a backend that a user may set."""
    for item in dataclasses.fields(cls):
        if item.init and not item.metadata.get("learned"):
            yield item


def build(name: str, options: Mapping[str, Any] | None = None) -> Any:
    """The method of that name with those options.

    Raises
    ------
    ConfigError
        An unknown method or option (the nearest is offered), or a value that the method refuses.

    Examples
    --------
    >>> build("independent")
    Independent()
    """
    cls = backend_class(name)
    known = [item.name for item in option_fields(cls)]
    options = dict(options or {})
    for key in options:
        if key not in known:
            raise ConfigError(f"method {name!r} has no option {key!r}. {nearest_name(key, known)}")
    try:
        return cls(**options)
    except (TypeError, ValueError) as error:
        raise ConfigError(f"method {name!r}: {error}") from None
