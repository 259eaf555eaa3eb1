"""The maps that arguments name (files, folders to look through, patterns), and shares of them."""

import glob
import hashlib
import os
import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from itertools import chain
from pathlib import Path, PurePosixPath
from typing import Self

from pgm_places.errors import InputError, MapError
from pgm_places.io.input_file import file_kind, is_address, user_path
from pgm_places.io.remote_files import RemoteFolder, address_of

_DESCRIBES_MAP = re.compile(rb"^image[ \t]*:", re.MULTILINE)
_HEAD = 1 << 16


@dataclass(frozen=True, slots=True)
class FoundMap:
    """A map to label; there may be a million, so it holds its path as text.

    Parameters
    ----------
    name : str
        Its folder among the results: its path below the root, with slashes and without ``.yaml``.
    file : str
        Its YAML file, absolute.
    """

    name: str
    file: str

    @property
    def path(self) -> Path:
        """Its YAML file."""
        return Path(self.file)


@dataclass(frozen=True)
class FoundMaps:
    """The maps of some arguments.

    Parameters
    ----------
    maps : tuple of FoundMap
        By name.
    n_passed_over : int
        How many YAML files were passed over because they describe no map.
    root : Path
        The folder that their names start from, absolute.
    """

    maps: tuple[FoundMap, ...]
    n_passed_over: int
    root: Path


def names_many(argument: str) -> bool:
    """Whether an argument is a folder or a pattern, and no single file."""
    if is_address(argument):
        return glob.has_magic(argument) or RemoteFolder.at(argument, MapError).is_folder()
    path = user_path(argument, MapError)
    return file_kind(path) == "folder" or (glob.has_magic(argument) and not path.exists())


def find_maps(
    arguments: Sequence[str], out: Path | None = None, *, root: Path | None = None
) -> FoundMaps:
    """The maps that arguments name, each once.

    A file is taken as it is. In a folder, and for a pattern (``floors/*/map.yaml``, ``**`` for any
    depth), every YAML file with a key ``image`` is a map, except in hidden folders and below
    ``out``. A map is called by its path below the root, so that no other map changes its name.

    Parameters
    ----------
    arguments : sequence of str
    out : Path, optional
        Where the results are.
    root : Path, optional
        The folder that names start from; by default the deepest one that holds all arguments.

    Raises
    ------
    MapError
        A folder or a pattern holds no map, or a map lies outside the root.
    """
    many = {argument: names_many(argument) for argument in arguments}
    if root is None:
        root = _common([_base(argument, many=many[argument]) for argument in arguments])
    found: dict[str, None] = {}
    n_passed_over = 0
    for argument in arguments:
        listed = _listed(argument, _normal(out) if out else None) if many[argument] else None
        if listed is None:
            path = Path(argument) if is_address(argument) else user_path(argument, MapError)
            found[str(path if is_address(path) else path.absolute())] = None
            continue
        far = RemoteFolder.at(argument, MapError) if is_address(argument) else None
        are_maps = (map if far is None else far.at_once)(_describes_map, listed)
        maps = [file for file, is_map in zip(listed, are_maps, strict=True) if is_map]
        if not maps:
            raise MapError(
                f"{argument}: no map in it: none of {len(listed)} YAML files has a key 'image'"
            )
        n_passed_over += len(listed) - len(maps)
        found |= dict.fromkeys(maps)
    named = [FoundMap(_name(Path(file), root), file) for file in found]
    return FoundMaps(tuple(sorted(named, key=lambda item: item.name)), n_passed_over, root)


def _base(argument: str, *, many: bool) -> Path:
    """The folder of an argument: itself, that of the file, or what a pattern begins with."""
    path = Path(argument) if is_address(argument) else _normal(user_path(argument, MapError))
    if not many:
        return path.parent
    if not glob.has_magic(str(path)) or file_kind(path) == "folder":
        return path
    return next(part for part in path.parents if not glob.has_magic(str(part)))


def _common(bases: Sequence[Path]) -> Path:
    """The deepest folder that holds all others.

    Raises
    ------
    MapError
        There is none, because addresses of different machines, or files of this one, are among
        them.
    """
    far = [path for path in bases if is_address(path / "any")]  # s3: has lost its slashes
    root = Path(os.path.commonpath(bases)) if len(far) in (0, len(bases)) else Path()
    if far and not is_address(root / "any"):
        raise MapError(
            f"{address_of(far[0])}: names start from one folder that holds all maps, and there is "
            "none; label what lies in different places by itself, into another --out"
        )
    return root


def _normal(path: Path) -> Path:
    """The path, absolute and without ``..``; an address as it is."""
    if is_address(path):
        return path
    return Path(os.path.abspath(path))  # noqa: PTH100  Path.absolute keeps '..'


def _name(path: Path, root: Path) -> str:
    """What a map is called; parts that would be hidden have a dash in front."""
    try:
        below = _normal(path).relative_to(root)
    except ValueError:
        raise MapError(
            f"{path}: outside {root}, the folder that the names of earlier results start from; "
            "use another --out for it"
        ) from None
    if below.suffix == ".yaml":  # that of hall.yml stays, for there may be hall.yaml, too
        below = below.with_suffix("")
    parts = (f"-{part}" if part.startswith(".") else part for part in below.parts)
    return str(PurePosixPath(*parts))


def _listed(argument: str, out: Path | None) -> list[str]:
    """The YAML files of a folder or a pattern, absolute and sorted, but for those below ``out``."""
    if is_address(argument):
        files = map(Path, _listed_far(RemoteFolder.at(argument, MapError)))
        return [str(file) for file in files if out not in file.parents]
    path = user_path(argument, MapError)
    if file_kind(path) == "folder":
        below: Iterable[Path] = chain(path.rglob("*.yaml"), path.rglob("*.yml"))
        below = (file for file in below if not _is_hidden(file.relative_to(path)))
    else:
        # Path.glob takes no absolute patterns. Neither finds hidden folders by a wildcard.
        below = map(Path, glob.iglob(str(path), recursive=True))  # noqa: PTH207
        below = (file for file in below if file.suffix in (".yaml", ".yml"))
    # What is no file (a dangling link, a folder) is listed, too, so that it is reported.
    whole = (file.absolute() for file in below)
    return sorted({str(file) for file in whole if out not in (file, *file.parents)})


def _listed_far(folder: RemoteFolder) -> list[str]:
    """The YAML files of a far folder, or that fit a pattern, as addresses."""
    if glob.has_magic(folder.path):
        start = len(folder.address) - len(folder.path)
        files = [Path(folder.address[:start] + name) for name in folder.matching()]
    else:
        names = (name for name in folder.names() if not _is_hidden(Path(name)))
        files = [Path(f"{folder.address.rstrip('/')}/{name}") for name in names]
    return sorted(str(file) for file in files if file.suffix in (".yaml", ".yml"))


def _is_hidden(file: Path) -> bool:
    return any(part.startswith(".") for part in file.parts)


def _describes_map(file: str) -> bool:
    """Whether it has a key ``image``; a file that cannot be read counts, so that it is reported."""
    path = Path(file)
    if is_address(path):
        try:
            return _DESCRIBES_MAP.search(RemoteFolder.at(path, MapError).head(_HEAD)) is not None
        except InputError:  # an empty file has no first byte to ask for
            return True
    if file_kind(path) != "file":  # a pipe would never end
        return True
    try:
        with path.open("rb") as opened:
            return _DESCRIBES_MAP.search(opened.read(_HEAD)) is not None
    except OSError:
        return True


@dataclass(frozen=True)
class Shard:
    """One of several parts into which names fall by chance, but always alike.

    Parameters
    ----------
    number, of : int
        The first is 1.
    """

    number: int
    of: int

    @classmethod
    def named(cls, text: str) -> Self:
        """The part that ``i/n`` names.

        Raises
        ------
        InputError
            It is not written like that, or there is no such part.

        Examples
        --------
        >>> Shard.named("3/16")
        Shard(number=3, of=16)
        """
        found = re.fullmatch(r"([0-9]{1,9})/([0-9]{1,9})", text.strip())
        if found is None or not 1 <= int(found[1]) <= int(found[2]):
            raise InputError(
                f"--shard expects i/n, such as 3/16, the first being 1/16 and the last 16/16; "
                f"got {text!r}"
            )
        return cls(int(found[1]), int(found[2]))

    def has(self, name: str) -> bool:
        """Whether a name is in this part."""
        digest = hashlib.sha256(name.encode("utf-8", "surrogateescape")).digest()
        return int.from_bytes(digest[:8], "big") % self.of == self.number - 1
