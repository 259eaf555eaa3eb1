"""Methods that learn the same are learned once: those that differ in how they label alone."""

import dataclasses
from collections.abc import Hashable, Mapping
from typing import Any

from pgm_places.inference.backends import Learnable
from pgm_places.inference.traits import traits_of
from pgm_places.options import option_values

__all__ = ["as_fitted", "learned_with"]


def learned_with(methods: Mapping[str, tuple[Any, str]]) -> dict[str, str]:
    """For each method that need not learn, the first one that learns the same.

    Parameters
    ----------
    methods : mapping of str to (Backend, str)
        The backends with the unary that each is given. Learned ones that share their arrays are
        told, too.

    Examples
    --------
    >>> from pgm_places import build
    >>> names = {"cut": "graph-cut", "lp": "lp"}
    >>> methods = {name: (build("amn", {"inference": how}), "") for name, how in names.items()}
    >>> learned_with({**methods, "other": (build("amn", {"C": 10.0}), "")})
    {'lp': 'cut'}
    """
    first: dict[Hashable, str] = {}
    shared = {}
    for name, (backend, unary) in methods.items():
        key = _what_is_learned(backend)
        if key is None:
            continue
        other = first.setdefault((key, unary), name)
        if other != name:
            shared[name] = other
    return shared


def as_fitted(backend: Any, fitted: Any) -> Any:
    """The fitted backend, labelling as another one does that learns the same."""
    chosen = {name: getattr(backend, name) for name in traits_of(backend).labelling_options}
    return dataclasses.replace(fitted, **chosen)


def _what_is_learned(backend: Any) -> Hashable | None:
    """What learning depends on; None for what learns nothing, or says nothing of that."""
    if not isinstance(backend, Learnable) or not traits_of(backend).labelling_options:
        return None
    options = {
        name: value
        for name, value in option_values(backend).items()
        if name not in traits_of(backend).labelling_options
    }
    arrays = [
        id(getattr(backend, item.name))
        for item in dataclasses.fields(backend)  # type: ignore[arg-type]
        if item.metadata.get("learned")
    ]
    return type(backend), repr(options), tuple(arrays)
