"""Signatures in ``help``: types by the names that the source uses."""

import inspect
from collections.abc import Iterator
from typing import Any

import pgm_places


def public_callables() -> Iterator[tuple[str, Any]]:
    """Functions, classes and methods of the package's root, by name."""
    for name in pgm_places.__all__:
        item = getattr(pgm_places, name)
        yield name, item
        if inspect.isclass(item):
            for member, value in inspect.getmembers(item, callable):
                if not member.startswith("_"):
                    yield f"{name}.{member}", value


def test_signatures_show_array_like_and_not_its_parts() -> None:
    signatures = {}
    for name, item in public_callables():
        if callable(item) and not inspect.isbuiltin(item):
            try:
                signatures[name] = str(inspect.signature(item))
            except ValueError:  # classes of the standard library without a signature
                continue
    assert "ArrayLike" in signatures["evaluate"]
    assert [name for name, text in signatures.items() if "numpy._typing" in text] == []
