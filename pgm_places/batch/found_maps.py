"""Finding the maps of file, folder and pattern arguments; shards of them."""

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
    """A map to label: its output folder below the root, and its absolute YAML file.

    Its path is text, which is smaller, because there may be a million maps.
    """

    name: str
    file: str

    @property
    def path(self) -> Path:
        """Its YAML file."""
        return Path(self.file)


@dataclass(frozen=True)
class FoundMaps:
    """The maps below ``root``, sorted by name; ``n_passed_over`` YAML files described no map."""

    maps: tuple[FoundMap, ...]
    n_passed_over: int
    root: Path


def names_many(argument: str) -> bool:
    """Whether an argument is a folder or a pattern rather than a single file."""
    if is_address(argument):
        return glob.has_magic(argument) or RemoteFolder.at(argument, MapError).is_folder()
    path = user_path(argument, MapError)
    return file_kind(path) == "folder" or (glob.has_magic(argument) and not path.exists())


def find_maps(
    arguments: Sequence[str], out: Path | None = None, *, root: Path | None = None
) -> FoundMaps:
    """Find the maps of arguments, without duplicates.

    Files are used directly, under any name. In a folder, and for a pattern
    (``floors/*/map.yaml``, ``**`` for any depth), every YAML file with a key ``image`` is a map,
    except in hidden folders and below ``out``. A map's name is its path below the root, so it does
    not depend on other maps. The root is by default the deepest folder above all arguments.
    """
    many = {argument: names_many(argument) for argument in arguments}
    if root is None:
        root = _common([_base(argument, many=many[argument]) for argument in arguments])
    files: dict[str, None] = {}
    n_passed_over = 0
    for argument in arguments:
        listed = _listed(argument, _normal(out) if out else None) if many[argument] else None
        if listed is None:
            path = Path(argument) if is_address(argument) else user_path(argument, MapError)
            files[str(path if is_address(path) else path.absolute())] = None
            continue
        remote = RemoteFolder.at(argument, MapError) if is_address(argument) else None
        are_maps = (map if remote is None else remote.at_once)(_describes_map, listed)
        maps = [file for file, is_map in zip(listed, are_maps, strict=True) if is_map]
        if not maps:
            raise MapError(
                f"{argument}: no map found: none of {len(listed)} YAML files has a key 'image'"
            )
        n_passed_over += len(listed) - len(maps)
        files |= dict.fromkeys(maps)
    named = [FoundMap(_name(Path(file), root), file) for file in files]
    return FoundMaps(tuple(sorted(named, key=lambda entry: entry.name)), n_passed_over, root)


def _base(argument: str, *, many: bool) -> Path:
    """The folder of an argument: itself, the file's folder, or the start of a pattern."""
    path = Path(argument) if is_address(argument) else _normal(user_path(argument, MapError))
    if not many:
        return path.parent
    if not glob.has_magic(str(path)) or file_kind(path) == "folder":
        return path
    return next(part for part in path.parents if not glob.has_magic(str(part)))


def _common(bases: Sequence[Path]) -> Path:
    """The deepest common folder; an error if there is none, as for different machines."""
    remote = [path for path in bases if is_address(path / "any")]  # s3: alone is no address
    root = Path(os.path.commonpath(bases)) if len(remote) in (0, len(bases)) else Path()
    if remote and not is_address(root / "any"):
        raise MapError(
            f"{address_of(remote[0])}: the maps have no common folder; label the maps of each "
            "machine separately, with another --out"
        )
    return root


def _normal(path: Path) -> Path:
    """The path, absolute and without ``..``; addresses are unchanged."""
    if is_address(path):
        return path
    return Path(os.path.abspath(path))  # noqa: PTH100  Path.absolute keeps '..'


def _name(path: Path, root: Path) -> str:
    """The name of a map; hidden path components get a leading dash."""
    try:
        below = _normal(path).relative_to(root)
    except ValueError:
        raise MapError(
            f"{path}: outside {root}, the root folder of the earlier results; use another --out"
        ) from None
    if below.suffix == ".yaml":  # .yml is not removed: there may be hall.yml and hall.yaml
        below = below.with_suffix("")
    parts = (f"-{part}" if part.startswith(".") else part for part in below.parts)
    return str(PurePosixPath(*parts))


def _listed(argument: str, out: Path | None) -> list[str]:
    """The YAML files of a folder or pattern, absolute and sorted, except below ``out``."""
    if is_address(argument):
        files = map(Path, _listed_remote(RemoteFolder.at(argument, MapError)))
        return [str(file) for file in files if out not in file.parents]
    path = user_path(argument, MapError)
    if file_kind(path) == "folder":
        below: Iterable[Path] = chain(path.rglob("*.yaml"), path.rglob("*.yml"))
        below = (file for file in below if not _is_hidden(file.relative_to(path)))
    else:
        # Path.glob rejects absolute patterns. Wildcards of glob skip hidden folders, too.
        below = map(Path, glob.iglob(str(path), recursive=True))  # noqa: PTH207
        below = (file for file in below if file.suffix in (".yaml", ".yml"))
    # Dangling links and folders are listed, too, so that they are reported.
    absolute = (file.absolute() for file in below)
    return sorted({str(file) for file in absolute if out not in (file, *file.parents)})


def _listed_remote(folder: RemoteFolder) -> list[str]:
    """The YAML files of a remote folder or pattern, as addresses."""
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
    """Whether a file has a key ``image``; unreadable files count, so that they are reported."""
    path = Path(file)
    if is_address(path):
        try:
            return _DESCRIBES_MAP.search(RemoteFolder.at(path, MapError).head(_HEAD)) is not None
        except InputError:  # an empty file
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
    """Part ``number``, from 1, of a batch in ``of`` parts; names are assigned by hash."""

    number: int
    of: int

    @classmethod
    def named(cls, text: str) -> Self:
        """Parse ``i/n``: ``3/16`` is ``Shard(3, 16)``."""
        match = re.fullmatch(r"([0-9]{1,9})/([0-9]{1,9})", text.strip())
        if match is None or not 1 <= int(match[1]) <= int(match[2]):
            raise InputError(f"--shard expects I/N with I from 1 to N, such as 3/16; got {text!r}")
        return cls(int(match[1]), int(match[2]))

    def has(self, name: str) -> bool:
        """Whether a name is in this part."""
        digest = hashlib.sha256(name.encode("utf-8", "surrogateescape")).digest()
        return int.from_bytes(digest[:8], "big") % self.of == self.number - 1
