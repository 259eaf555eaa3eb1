"""Presets of a configuration, and the record of their values."""

import copy
from collections.abc import Iterator, Mapping
from typing import Any, get_args

from pgm_places.labelers.presets import ANY_METHOD, Preset, preset_values


def with_preset(content: Mapping[str, Any]) -> dict[str, Any]:
    """A configuration with the values of its ``preset`` for options that are not set.

    An unknown preset, or one together with a base model, adds nothing: validation rejects it.
    """
    filled = copy.deepcopy(dict(content))
    preset: Any = filled.get("preset")
    if preset in get_args(Preset) and "base_model" not in filled:
        for key, value in preset_values(preset, filled.get("nodes", "cells")).items():
            *path, option = key.split(".")
            for table in _tables(filled, path):
                table.setdefault(option, value)
    return filled


def preset_record(config: Mapping[str, Any]) -> dict[str, Any] | None:
    """The values set by the preset of a resolved configuration, and those set by the user."""
    preset = config.get("preset")
    if preset is None:
        return None
    of_preset, of_user = {}, {}
    for key, wanted in preset_values(preset, config["nodes"]).items():
        *path, option = key.split(".")
        values = [table.get(option) for table in _tables(copy.deepcopy(dict(config)), path)]
        others = [value for value in values if value != wanted]
        if values and len(others) < len(values):
            of_preset[key] = wanted
        if others:
            of_user[key] = others[0] if len(others) == 1 else others
    return {"name": preset, "set": of_preset, "given": of_user}


def _tables(content: dict[str, Any], path: list[str]) -> Iterator[dict[str, Any]]:
    """The tables at a path, created if missing; for methods, all with the name in the path."""
    if path[0] == "methods":
        methods = content.get("methods")
        for method in methods if isinstance(methods, list) else ():
            if isinstance(method, dict) and path[1] in (ANY_METHOD, method.get("name")):
                yield method
        return
    table: Any = content
    for name in path:
        table = table.setdefault(name, {})
        if not isinstance(table, dict):
            return  # validation refuses it
    yield table
