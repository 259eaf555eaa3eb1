"""The maps that arguments name: files, folders to look through, and patterns."""

import glob
import re
from collections import defaultdict
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

from pgm_places.errors import MapError
from pgm_places.io.input_file import file_kind, user_path

__all__ = ["FoundMap", "FoundMaps", "find_maps", "names_many"]

_DESCRIBES_MAP = re.compile(rb"^image[ \t]*:", re.MULTILINE)
_HEAD = 1 << 16


@dataclass(frozen=True)
class FoundMap:
    """A map to label.

    Parameters
    ----------
    name : str
        Its folder among the results.
    path : Path
        Its YAML file, absolute.
    """

    name: str
    path: Path


@dataclass(frozen=True)
class FoundMaps:
    """The maps, by name, and how many YAML files were passed over because they describe none."""

    maps: tuple[FoundMap, ...]
    n_passed_over: int


def names_many(argument: str) -> bool:
    """Whether an argument is a folder or a pattern, and no single file."""
    path = user_path(argument, MapError)
    return file_kind(path) == "folder" or (glob.has_magic(argument) and not path.exists())


def find_maps(arguments: Sequence[str], out: Path | None = None) -> FoundMaps:
    """The maps that arguments name, each once.

    A file is taken as it is. In a folder, and for a pattern (``floors/*/map.yaml``, ``**`` for any
    depth), every YAML file with a key ``image`` is a map, except in hidden folders and below
    ``out``. A map is called after its file, or after its folder where the file is ``map.yaml``;
    where two have one name, the names of their folders are put in front.

    Raises
    ------
    MapError
        A folder or a pattern holds no map.
    """
    found: dict[Path, None] = {}
    n_passed_over = 0
    for argument in arguments:
        listed = _listed(argument, None if out is None else out.absolute())
        if listed is None:
            found[user_path(argument, MapError).absolute()] = None
            continue
        maps = [path for path in listed if _describes_map(path)]
        if not maps:
            raise MapError(
                f"{argument}: no map in it: none of {len(listed)} YAML files has a key 'image'"
            )
        n_passed_over += len(listed) - len(maps)
        found |= dict.fromkeys(maps)
    named = zip(_names(list(found)), found, strict=True)
    maps_by_name = sorted((FoundMap(*item) for item in named), key=lambda item: item.name)
    return FoundMaps(tuple(maps_by_name), n_passed_over)


def _listed(argument: str, out: Path | None) -> list[Path] | None:
    """The YAML files of a folder or a pattern, absolute and sorted; None for a single file."""
    path = user_path(argument, MapError)
    if not names_many(argument):
        return None
    if file_kind(path) == "folder":
        below: Iterable[Path] = (*path.rglob("*.yaml"), *path.rglob("*.yml"))
        below = (file for file in below if not _is_hidden(file.relative_to(path)))
    else:
        # Path.glob takes no absolute patterns. Neither finds hidden folders by a wildcard.
        below = map(Path, glob.iglob(str(path), recursive=True))  # noqa: PTH207
        below = (file for file in below if file.suffix in (".yaml", ".yml"))
    files = {file.absolute() for file in below}
    return sorted(file for file in files if file.is_file() and out not in file.parents)


def _is_hidden(file: Path) -> bool:
    return any(part.startswith(".") for part in file.parts)


def _describes_map(path: Path) -> bool:
    """Whether it has a key ``image``; a file that cannot be read counts, so that it is reported."""
    try:
        with path.open("rb") as file:
            return _DESCRIBES_MAP.search(file.read(_HEAD)) is not None
    except OSError:
        return True


def _names(paths: Sequence[Path]) -> list[str]:
    """A name for each path; no two differ by capital letters alone, as some disks know none."""
    taken = [1] * len(paths)
    parts = [_name_parts(path) for path in paths]
    while True:
        names = ["-".join(part[-n:]) for part, n in zip(parts, taken, strict=True)]
        others: dict[str, set[tuple[str, ...]]] = defaultdict(set)
        for name, part in zip(names, parts, strict=True):
            others[name.casefold()].add(tuple(word.casefold() for word in part))
        longer = [
            number
            for number, name in enumerate(names)
            if len(others[name.casefold()]) > 1 and taken[number] < len(parts[number])
        ]
        if not longer:
            return list(_numbered(names))
        for number in longer:
            taken[number] += 1


def _name_parts(path: Path) -> list[str]:
    """The words that a map's name may be made of, its own name last."""
    folders = [part.lstrip(".") or "_" for part in path.parent.parts[1:]]
    stem = path.stem.lstrip(".") or "_"
    return folders if stem == "map" and folders else [*folders, stem]


def _numbered(names: Iterable[str]) -> Iterator[str]:
    """The names, with numbers behind those that are still the same."""
    seen: set[str] = set()
    for name in names:
        number, numbered = 1, name
        while numbered.casefold() in seen:
            number += 1
            numbered = f"{name}-{number}"
        seen.add(numbered.casefold())
        yield numbered
