"""Error messages of arguments: the accepted type and the actual value, in words."""

import collections.abc
import numbers
import os
import types
import typing
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, Literal

import numpy as np

from pgm_places._arguments.kinds import (
    CONVERTERS,
    LISTS,
    NO,
    PLAIN,
    SCALARS,
    ByName,
    check_of,
    checks_of,
    hints_of,
    is_array,
    is_array_part,
    kind_of_numbers,
)
from pgm_places.errors import InputError, OptionError, quoted
from pgm_places.options.marks import describe_type, marks_of, unannotated, union_members

_MADE_BY = {
    "EdgeList": "LabelGraph.from_edges takes node pairs",
    "PlaceLabeler": "trained_labeler(name) and load(folder) return one",
    "TrajectoryLabeler": "trained_tracker(name) and load(folder) return one",
    "TopologicalMap": "topological_map(grid, labels, label_names) makes one",
    "LabelledMap": "LabelledMap(grid, labels) makes one",
    "Trajectory": "Trajectory(times_s, poses) makes one",
}
"""How to obtain an object of each type; hints of messages."""


def refused(
    function: Any, name: str, arguments: Mapping[str, Any], error: type[InputError]
) -> InputError:
    """The error of an argument: one line with the accepted type, the value, and a hint."""
    hint, value = hints_of(function)[name], arguments[name]
    is_option = any(
        marks_of(arm) or typing.get_origin(arm) is Literal for arm in union_members(hint)
    )
    problem = f"must be {words(hint)}, got {described(value)}"
    problem += _swapped(function, name, arguments) or _what_to_do(hint, value)
    return OptionError(name, problem) if is_option else error(f"{name} {problem}")


def too_many(
    function: Any, names: Sequence[str], args: Sequence[Any], error: type[InputError]
) -> InputError:
    """The error of more positional arguments than a function has parameters for them."""
    own = [name for name in names if name not in ("self", "cls")]
    passed = tuple(args[len(names) - len(own) :])
    is_size = len(own) == 1 and all(isinstance(item, numbers.Integral) for item in passed)
    hint = f"write one tuple: {passed}" if is_size else "give the others by name"
    return error(
        f"{function.__qualname__.removesuffix('.__init__')} takes {len(own)} positional "
        f"argument{'' if len(own) == 1 else 's'} ({', '.join(own)}), got {len(passed)}; {hint}"
    )


def words(hint: Any) -> str:
    """The types that an annotation accepts, in words, converters included."""
    if isinstance(hint, ByName):
        return " or ".join(n if n == "None" else f"{_article(n)} {n}" for n in hint.names)
    if is_array(hint):
        return "an array of numbers"
    parts = union_members(hint)
    arrays = any(map(is_array_part, parts))
    if arrays:
        parts = [arm for arm in parts if not is_array_part(arm) and arm not in SCALARS]
    texts = [_words_of_arm(arm) for arm in parts]
    if arrays:
        texts.insert(len(texts) - (types.NoneType in parts), "an array of numbers")
    texts = list(dict.fromkeys(texts))
    if len(texts) == 1:
        return texts[0]
    return f"{', '.join(texts[:-1])}{',' * (len(texts) > 2)} or {texts[-1]}"


def _words_of_arm(hint: Any) -> str:
    kind = unannotated(hint)
    origin, inner = typing.get_origin(kind), typing.get_args(kind)
    if origin is np.ndarray:
        numbers_of = kind_of_numbers(inner)
        names = {np.bool_: "True and False", np.integer: "whole numbers"}
        item_names = [
            text for base, text in names.items() if numbers_of and issubclass(numbers_of, base)
        ]
        return f"an array of {item_names[0] if item_names else 'numbers'}"
    if origin in (collections.abc.Callable, type):
        return "a function" if origin is not type else "a class"
    if origin is tuple and inner and inner[-1] is not Ellipsis:
        return f"a pair ({', '.join(map(words, inner))})"
    if origin in (*LISTS, collections.abc.Iterable, collections.abc.Iterator):
        return "a list of names" if inner[0] is str else f"a list, each item {words(inner[0])}"
    if origin in (collections.abc.Mapping, dict):
        return "a mapping"
    if kind in (Path, os.PathLike):
        return "a path"
    name = getattr(origin or kind, "__name__", "")
    if isinstance(origin or kind, type) and kind not in PLAIN:
        path = " (or the path of a map's YAML file)" if name in CONVERTERS else ""
        return f"{_article(name)} {name}{path}"
    return describe_type(hint)


def _article(name: str) -> str:
    return "an" if name[:1] in "AEIOUaeio" else "a"


def described(value: Any) -> str:
    """A value in words: a number or a text itself, anything else by its type."""
    if value is None or isinstance(value, str | bytes | numbers.Number | np.generic | os.PathLike):
        return quoted(value)
    if isinstance(value, type):
        return f"the class {value.__name__} itself"
    if hasattr(value, "mask") and np.ma.is_masked(value):
        n_masked = int(np.ma.getmaskarray(value).sum())
        return f"a masked array, {n_masked} of its values masked; fill them"
    if isinstance(value, np.ndarray):
        return f"an array of type {value.dtype} and shape {value.shape}"
    if isinstance(value, list | tuple | set | frozenset | dict):
        kinds = {type(item).__name__ for item in value}
        if len(value) and not kinds & {"str", "int", "float", "bool", "NoneType", "list", "tuple"}:
            return f"a {type(value).__name__} of {len(value)} {' or '.join(sorted(kinds))}"
        return quoted(value)
    return f"{_article(type(value).__name__)} {type(value).__name__}"


def _swapped(function: Any, name: str, values: Mapping[str, Any]) -> str:
    """A hint if two arguments look swapped."""
    checks = checks_of(function)[1]
    for other, there in values.items():
        if other == name or other not in checks or checks[other](there) is not NO:
            continue
        if checks[other](values[name]) is not NO and checks[name](there) is not NO:
            return f"; are {name} and {other} swapped?"
    return ""


def _what_to_do(hint: Any, value: Any) -> str:
    """A hint to pass a field of the value or its only item, or how to make the wanted type."""
    check = check_of(hint)
    for field in getattr(type(value), "__dataclass_fields__", ()):
        part = getattr(value, field, None)
        if type(part).__module__.startswith("pgm_places") and check(part) is not NO:
            return f"; give its .{field}"
    if isinstance(value, list | tuple) and len(value) == 1 and check(value[0]) is not NO:
        return "; give the one item of the list"
    kinds = (
        []
        if isinstance(hint, ByName)
        else [getattr(arm, "__name__", "") for arm in union_members(hint)]
    )
    return next((f"; {_MADE_BY[kind]}" for kind in kinds if kind in _MADE_BY), "")
