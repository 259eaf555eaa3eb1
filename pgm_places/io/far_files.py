"""Files of other machines by their addresses, such as s3://bucket/maps, through fsspec."""

import contextlib
import re
import time
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from importlib.util import find_spec
from pathlib import Path, PurePosixPath
from typing import Any, Self

from pgm_places._extras import install_command
from pgm_places.errors import InputError, PgmPlacesError, printable
from pgm_places.io.input_file import is_address


def address_of(path: Path | str) -> str:
    """An address as it was written: a path has lost a slash of it, or two.

    Examples
    --------
    >>> address_of(Path("s3://bucket/maps/hall.yaml")), address_of(Path("file:///maps"))
    ('s3://bucket/maps/hall.yaml', 'file:///maps')
    """
    protocol, _, below = str(path).partition(":")
    below = below.lstrip("/")
    return f"{protocol}:///{below}" if protocol in ("file", "local") else f"{protocol}://{below}"


@dataclass(frozen=True, eq=False)
class FarFolder:
    """A folder, or a file, behind an address.

    Parameters
    ----------
    address : str
    system : fsspec.AbstractFileSystem
    path : str
        The same within the system.
    """

    address: str
    system: Any
    path: str

    @classmethod
    def at(cls, path: Path | str, error: type[PgmPlacesError] = InputError) -> Self:
        """What an address names.

        Raises
        ------
        error
            It is no address, fsspec or what it needs for this kind of address is not installed, or
            there is no such kind.
        """
        address = address_of(path)
        if not is_address(address) or find_spec("fsspec") is None:
            raise error(
                f"{address}: an address, not a file on this machine; copy or mount it first, or "
                f"install what reads and writes addresses: {install_command('remote')}"
            )
        with as_errors(address, error):
            from fsspec.core import url_to_fs

            system, inside = url_to_fs(address)
        return cls(address, system, str(inside).rstrip("/"))

    def below(self, name: str) -> "FarFolder":
        """A file or folder in it."""
        return FarFolder(f"{self.address.rstrip('/')}/{name}", self.system, f"{self.path}/{name}")

    @property
    def parent(self) -> "FarFolder":
        """The folder that it is in."""
        address = self.address.rstrip("/").rpartition("/")[0]
        return FarFolder(address, self.system, self.path.rpartition("/")[0])

    def exists(self) -> bool:
        """Whether there is such a file or folder."""
        with as_errors(self.address, InputError):
            return bool(self.system.exists(self.path))

    def is_folder(self) -> bool:
        """Whether it is a folder."""
        with as_errors(self.address, InputError):
            return bool(self.system.isdir(self.path))

    def names(self) -> list[str]:
        """The files below it, by their relative names, sorted."""
        with as_errors(self.address, InputError):
            try:
                found = self.system.find(self.path)
            except FileNotFoundError:
                return []
        start = PurePosixPath(self.path)
        return sorted(str(PurePosixPath(item).relative_to(start)) for item in found)

    def matching(self) -> list[str]:
        """The paths within the system that this one, a pattern, fits."""
        with as_errors(self.address, InputError):
            return sorted(map(str, self.system.glob(self.path)))

    def fetch(self, name: str, local: Path) -> bool:
        """Copy a file from it; whether there is one."""
        with as_errors(f"{self.address}/{name}", InputError):
            local.parent.mkdir(parents=True, exist_ok=True)
            try:
                self.system.get_file(f"{self.path}/{name}", str(local))
            except FileNotFoundError:
                return False
        return True

    def modified_s(self, name: str) -> float:
        """When a file of it was written, in seconds since 1970; now where its system cannot say."""
        with as_errors(f"{self.address}/{name}", InputError):
            try:
                return float(self.system.modified(f"{self.path}/{name}").timestamp())
            except NotImplementedError:
                return time.time()

    def head(self, size: int) -> bytes:
        """The first bytes of a file."""
        with as_errors(self.address, InputError):
            return bytes(self.system.cat_file(self.path, start=0, end=size))

    def put(self, local: Path, names: Iterable[str], error: type[PgmPlacesError]) -> None:
        """Copy files into it, in this order."""
        with as_errors(self.address, error):
            for name in names:
                target = f"{self.path}/{name}"
                self.system.makedirs(target.rpartition("/")[0], exist_ok=True)
                self.system.put_file(str(local / name), target)

    def remove(self, names: Iterable[str], error: type[PgmPlacesError]) -> None:
        """Remove files of it, those that are there."""
        with as_errors(self.address, error):
            for name in names:
                with contextlib.suppress(FileNotFoundError):
                    self.system.rm_file(f"{self.path}/{name}")


@contextlib.contextmanager
def as_errors(address: str, error: type[PgmPlacesError]) -> Iterator[None]:
    """Whatever a file system raises, as one line that names the address."""
    try:
        yield
    except PgmPlacesError:
        raise
    except Exception as problem:
        # Each file system has exceptions of its own, which share no class but this one.
        said = re.sub(r"\s+", " ", str(problem)).strip() or type(problem).__name__
        raise error(f"{address}: {printable(said)[:500]}") from problem
