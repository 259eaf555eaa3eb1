"""Patterns of maps in a configuration, and tables of their buildings."""

import glob
import os
import re
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

from pgm_places.errors import ConfigError, nearest_name, quoted
from pgm_places.io.csv_table import open_table
from pgm_places.io.input_file import user_path


def resolved_path(name: str, folder: Path) -> Path:
    """The absolute path of a name in a configuration in ``folder``; expands a leading ``$NAME``.

    ConfigError if the environment variable is not set, or no file can have this name.
    """
    if name.startswith("$"):
        variable, _, rest = name[1:].partition("/")
        named = os.environ.get(variable)
        if not named:
            raise ConfigError(
                f"the path {name!r} needs the environment variable {variable}; set it to the "
                "folder with the data"
            )
        path = user_path(Path(named) / rest, ConfigError)
    else:
        path = folder / user_path(name, ConfigError)
    return Path(os.path.realpath(path))  # Path.resolve would fail on circular links


_WILDCARD = re.compile(r"\*\*/?|\*|\?|\[(?:![^\]]+|[^!\]][^\]]*)\]")
"""An unclosed or empty bracket is an ordinary character."""

_BESIDE = ("labels", "regions", "corrections")
_MAX_BYTES = 16 << 20


def without_patterns(content: Mapping[str, Any], folder: Path, where: str) -> dict[str, Any]:
    """A configuration with a table per map in place of tables whose ``map`` is a pattern.

    ``map = "floors/*/map.yaml"`` stands for all matching files, sorted by name; wildcards of
    ``labels``, ``regions`` or ``corrections`` are replaced by the text that matches in the map's
    path. ``buildings`` is a table (CSV) with columns ``map`` and ``building``. ConfigError if
    nothing matches, wildcards differ in number, or a map has no building.
    """
    made = dict(content)
    for part in ("train", "test"):
        tables = made.get(part)
        if not isinstance(tables, list):
            continue  # reported by the check of options
        made[part] = []
        for number, table in enumerate(tables):
            names_map = isinstance(table, dict) and isinstance(table.get("map"), str)
            at = f"{where}: {part}[{number}]"
            made[part] += _tables(table, folder, at) if names_map else [table]
    return made


def _tables(table: dict[str, Any], folder: Path, where: str) -> list[dict[str, Any]]:
    """The tables of all maps of a table."""
    pattern = table["map"]
    many = _has_wildcards(pattern) and not resolved_path(pattern, folder).exists()
    if not many and "buildings" not in table:
        return [table]
    rest = {key: value for key, value in table.items() if key != "buildings"}
    made = list(_matches(rest, folder, where)) if many else [rest]
    if "buildings" in table:
        if "building" in table:
            raise ConfigError(f"{where}: building and buildings (a table) cannot be combined")
        buildings = _buildings(resolved_path(str(table["buildings"]), folder))
        for each in made:
            path = resolved_path(each["map"], folder)
            each["building"] = _building_of(path, buildings, where)
    return made


def _matches(table: dict[str, Any], folder: Path, where: str) -> Iterator[dict[str, Any]]:
    pattern = table["map"]
    base = resolved_path(_before_wildcards(pattern), folder)
    rest = pattern[len(_before_wildcards(pattern)) :]
    patterns = {key: table[key] for key in _BESIDE if isinstance(table.get(key), str)}
    if not _has_wildcards(patterns.get("corrections", "*")):
        del patterns["corrections"]  # one file in the frame of all maps
    n_wildcards = len(_WILDCARD.findall(rest))
    for key, other in patterns.items():
        if len(_WILDCARD.findall(other)) != n_wildcards:
            raise ConfigError(
                f"{where}: map has {n_wildcards} wildcards ({pattern!r}), so {key} must have the "
                f"same number, got {other!r}"
            )
    if "name" in table:
        raise ConfigError(f"{where}: name is for one map, and map = {pattern!r} names several")
    names = sorted(glob.glob(rest, root_dir=base, recursive=True))  # noqa: PTH207  from a root
    if not names:
        raise ConfigError(f"{where}: no file matches map = {pattern!r} in {folder}")
    for name in names:
        match = _match(rest, Path(name).as_posix())
        if match is None:
            raise ConfigError(
                f"{where}: cannot tell what the wildcards of {pattern!r} are in {name!r}"
            )
        filled = {key: _filled(other, match.groups()) for key, other in patterns.items()}
        yield {**table, "map": _before_wildcards(pattern) + name, **filled}


def _has_wildcards(pattern: str) -> bool:
    return _WILDCARD.search(pattern) is not None


def _before_wildcards(pattern: str) -> str:
    """The folders before the first wildcard, with the slash."""
    match = _WILDCARD.search(pattern)
    assert match is not None  # only called for patterns
    return pattern[: pattern.rfind("/", 0, match.start()) + 1]


def _match(pattern: str, name: str) -> re.Match[str] | None:
    try:
        return re.fullmatch(_regex(pattern), name)
    except re.error:  # a reversed range
        return None


def _regex(pattern: str) -> str:
    """A regular expression with a group per wildcard."""
    groups = {"**/": "((?:.*/)?)", "**": "(.*)", "*": "([^/]*)", "?": "([^/])"}
    regex, end = "", 0
    for match in _WILDCARD.finditer(pattern):
        text = match.group()
        regex += re.escape(pattern[end : match.start()]) + (groups.get(text) or _one_of(text[1:-1]))
        end = match.end()
    return regex + re.escape(pattern[end:])


def _one_of(listed: str) -> str:
    """A group for the characters in brackets; a leading ``!`` negates them."""
    others = listed.startswith("!")
    escaped = re.sub(r"([\\\[^&~|])", r"\\\1", listed[1:] if others else listed)
    return f"([{'^' if others else ''}{escaped}])"


def _filled(pattern: str, texts: tuple[str, ...]) -> str:
    """The pattern with its wildcards replaced by texts."""
    remaining = iter(texts)
    return _WILDCARD.sub(lambda _: next(remaining), pattern)


def _buildings(path: Path) -> dict[str, str]:
    """The building of each map, by the map's name or its path."""
    what = "a table of buildings (CSV with the columns map and building)"
    with open_table(path, ConfigError, what, max_bytes=_MAX_BYTES) as table:
        columns = [table.index("map", "name", "floor"), table.index("building")]
        if None in columns:
            raise ConfigError(
                f"{path}: expected the columns map and building, got {quoted(table.names)}"
            )
        _, (maps, buildings) = table.read([], [column for column in columns if column is not None])
    building_of: dict[str, str] = {}
    for key, building in zip(maps, buildings, strict=True):
        looks_like_path = "/" in key or key.endswith((".yaml", ".yml"))
        key = str(resolved_path(key, path.parent)) if looks_like_path else key
        if (other := building_of.setdefault(key, building)) != building:
            raise ConfigError(f"{path}: {key} is in two buildings, {other} and {building}")
    return building_of


def _building_of(path: Path, buildings: Mapping[str, str], where: str) -> str:
    name = path.parent.name if path.stem == "map" else path.stem
    building = buildings.get(str(path)) or buildings.get(name)
    if not building:
        raise ConfigError(
            f"{where}: no building of {path} in the table, neither for its path nor for {name!r}. "
            f"{nearest_name(name, list(buildings))}"
        )
    return building
