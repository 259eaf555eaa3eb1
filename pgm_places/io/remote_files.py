"""Remote files by address, such as s3://bucket/maps, through fsspec."""

import contextlib
import errno
import random
import re
import tempfile
import time
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from functools import partial
from importlib.util import find_spec
from pathlib import Path
from typing import Any, Self, TypeVar

from pgm_places.errors import InputError, PgmPlacesError, escape_control
from pgm_places.io.input_file import is_address
from pgm_places.io.staging import NEW, as_output_errors, stage
from pgm_places.plugins import install_command
from pgm_places.progress import warn

Found = TypeVar("Found")
Item = TypeVar("Item")

MOST_AT_ONCE = 256
"""Concurrent requests: at 100 ms each, 2,560 a second; S3 accepts 5,500."""

_WAITS_S = (0.5, 1.0, 2.0, 4.0, 8.0, 16.0, 30.0, 30.0, 30.0, 30.0, 30.0)
"""Waits before retrying a request that a busy server refused: three minutes in all."""

_SAID_FROM_S = 4.0
"""The wait in seconds from which on a warning names the request."""

_FOLDERS = frozenset(
    ("file", "local", "sftp", "ssh", "ftp", "smb", "hdfs", "arrow_hdfs", "webhdfs", "dbfs")
)
"""File systems with real folders; on others, creating one could create a bucket."""


def address_of(path: Path | str) -> str:
    """An address as the user wrote it: ``Path`` drops one or two of its slashes.

    Examples
    --------
    >>> address_of(Path("s3://bucket/maps/hall.yaml")), address_of(Path("file:///maps"))
    ('s3://bucket/maps/hall.yaml', 'file:///maps')
    """
    protocol, _, below = str(path).partition(":")
    below = below.lstrip("/")
    return f"{protocol}:///{below}" if protocol in ("file", "local") else f"{protocol}://{below}"


def shown_path(path: Path) -> str:
    """A path, or an address as the user wrote it."""
    return address_of(path) if is_address(path) else str(path)


@dataclass(frozen=True, eq=False)
class RemoteFolder:
    """A folder or a file at a remote address, ``path`` within the fsspec file system ``system``.

    If it is patient, requests that a busy server refuses are retried.
    """

    address: str
    system: Any
    path: str
    is_patient: bool = True

    @classmethod
    def at(cls, path: Path | str, error: type[PgmPlacesError] = InputError) -> Self:
        """The folder or file at an address; ``error`` if its protocol is unknown or missing."""
        address = address_of(path)
        if not is_address(address) or find_spec("fsspec") is None:
            raise error(
                f"{address}: an address, not a file on this machine; copy or mount it first, or "
                f"install what reads and writes addresses: {install_command('remote')}"
            )
        with as_errors(address, error):
            from fsspec.core import url_to_fs

            system, inside = url_to_fs(address, **_options(address))
            system.dircache.use_listings_cache = False  # other machines write there, too
        return cls(address, system, str(inside).rstrip("/"))

    def below(self, name: str) -> "RemoteFolder":
        """A file or folder in this folder."""
        address = f"{self.address.rstrip('/')}/{name}"
        return replace(self, address=address, path=f"{self.path}/{name}")

    @property
    def parent(self) -> "RemoteFolder":
        """The folder that contains it."""
        address = self.address.rstrip("/").rpartition("/")[0]
        return replace(self, address=address, path=self.path.rpartition("/")[0])

    def at_once(self, function: Callable[[Item], Found], items: Iterable[Item]) -> list[Found]:
        """Results of a function that makes requests, for each item, many concurrently."""
        waiting = list(items)
        n = min(len(waiting), MOST_AT_ONCE if self.system.async_impl else 1)
        if n < 2:  # some systems have one connection, which threads cannot share
            return [function(item) for item in waiting]
        with ThreadPoolExecutor(n) as threads:
            return list(threads.map(function, waiting))

    def exists(self) -> bool:
        """Whether the file or folder exists."""
        return bool(self._asked(self.system.exists, self.path))

    def is_folder(self) -> bool:
        """Whether it is a folder."""
        return bool(self._asked(self.system.isdir, self.path))

    def names(self) -> list[str]:
        """The files below it, by their relative names, sorted."""
        return sorted(self._found())

    def states(self) -> dict[str, str]:
        """The files below it by name, each with a text that changes with its content."""
        return {name: repr(sorted(state.items())) for name, state in self._found().items()}

    def _found(self) -> dict[str, dict[str, object]]:
        try:
            entries = self._asked(partial(self.system.find, detail=True), self.path, absent=True)
        except FileNotFoundError:
            return {}
        start = len(self.path.rstrip("/")) + 1
        return {path[start:]: state for path, state in entries.items()}

    def matching(self) -> list[str]:
        """The paths within the file system that match this one, a pattern."""
        return sorted(map(str, self._asked(self.system.glob, self.path)))

    def fetch(self, name: str, local: Path) -> bool:
        """Copy a file from this folder; returns whether it exists."""
        with as_errors(f"{self.address}/{name}", InputError):
            local.parent.mkdir(parents=True, exist_ok=True)
        try:
            self.below(name)._asked(
                self.system.get_file, f"{self.path}/{name}", str(local), absent=True
            )
        except FileNotFoundError:
            local.unlink(missing_ok=True)  # some systems begin a file before they look
            return False
        return True

    def modified_s(self, name: str) -> float:
        """Modification time of a file, in seconds since 1970; now if the system has none."""
        with as_errors(f"{self.address}/{name}", InputError):
            try:
                return float(self._again(self.system.modified, f"{self.path}/{name}").timestamp())
            except NotImplementedError:
                return time.time()

    def head(self, size: int) -> bytes:
        """The first bytes of a file."""
        return bytes(self._asked(partial(self.system.cat_file, start=0, end=size), self.path))

    def put(self, local: Path, names: Iterable[str], error: type[PgmPlacesError]) -> None:
        """Copy files into this folder, in this order."""
        with as_errors(self.address, error):
            for name in names:
                target = f"{self.path}/{name}"
                if not _FOLDERS.isdisjoint(_protocols(self.system)):
                    self._again(self.system.makedirs, target.rpartition("/")[0], True)
                self._again(self.system.put_file, str(local / name), target)

    def remove(self, names: Iterable[str], error: type[PgmPlacesError]) -> None:
        """Remove the named files, if they exist."""
        with as_errors(self.address, error):
            for name in names:
                with contextlib.suppress(FileNotFoundError):
                    self._again(self.system.rm_file, f"{self.path}/{name}")

    def _asked(
        self, request: Callable[..., Found], *arguments: object, absent: bool = False
    ) -> Found:
        """The result of a request; with ``absent``, FileNotFoundError passes."""
        with as_errors(self.address, InputError, absent=absent):
            return self._again(request, *arguments)

    def _again(self, request: Callable[..., Found], *arguments: object) -> Found:
        """The result of a request, retried with growing waits while the server is busy."""
        for wait_s in _WAITS_S if self.is_patient else ():
            try:
                return request(*arguments)
            except Exception as error:
                if not is_passing(error):
                    raise
                if wait_s == _SAID_FROM_S:
                    reason = escape_control(str(error))[:500]
                    warn(f"{self.address}: {reason}; the request is retried")
            # Random waits: workers refused at the same moment must not retry at the same moment.
            time.sleep(wait_s * random.uniform(0.5, 1.0))
        return request(*arguments)


def _options(address: str) -> dict[str, object]:
    """Options of S3: as many connections as requests; its default is ten."""
    if not address.startswith(("s3:", "s3a:")):
        return {}
    from fsspec.config import conf

    settings = conf.get("s3", {}).get("config_kwargs", {})
    return {"config_kwargs": {"max_pool_connections": MOST_AT_ONCE, **settings}}


def _protocols(system: Any) -> tuple[str, ...]:
    return (system.protocol,) if isinstance(system.protocol, str) else tuple(system.protocol)


_PASSING_STATUS = frozenset((408, 409, 425, 429, 500, 502, 503, 504))
_PASSING_NUMBERS = frozenset(
    getattr(errno, name, errno.EBUSY)
    for name in (
        *("EBUSY", "EAGAIN", "EREMOTEIO", "ETIMEDOUT", "EPIPE", "ECONNRESET", "ECONNREFUSED"),
        *("ECONNABORTED", "ENETUNREACH", "EHOSTUNREACH", "ENETDOWN", "EHOSTDOWN"),
    )
)


def is_passing(error: BaseException) -> bool:
    """Whether an error is temporary (such as status 503), by status code or class name."""
    step: BaseException | None = error
    while step is not None:
        response = getattr(step, "response", None)  # of botocore
        metadata = response.get("ResponseMetadata", {}) if isinstance(response, dict) else {}
        numbers = (getattr(step, key, None) for key in ("status", "status_code", "code"))
        if _PASSING_STATUS.intersection(
            number for number in (*numbers, metadata.get("HTTPStatusCode")) if type(number) is int
        ):
            return True
        if isinstance(step, OSError) and step.errno in _PASSING_NUMBERS:
            return True
        names = " ".join(kind.__name__ for kind in type(step).__mro__)
        if re.search("Timeout|Connection|Disconnected|IncompleteRead", names):
            return True
        step = step.__cause__
    return False


def is_there(path: Path | str) -> bool:
    """Whether a local or remote file or folder exists, False if that cannot be determined."""
    if not is_address(path):
        return Path(path).exists()
    try:
        return RemoteFolder.at(path).exists()
    except InputError:
        return True


@contextlib.contextmanager
def temporary_folder() -> Iterator[Path]:
    """A private temporary folder; leftovers of killed runs are removed, too."""
    parent = Path(tempfile.gettempdir())
    with contextlib.ExitStack() as ends:
        with as_output_errors(parent):
            folder = ends.enter_context(stage(parent, "pgm-places"))
            folder.chmod(0o700)
            (folder / NEW).mkdir()  # the stage itself is locked; callers may lock this folder
        yield folder / NEW


@contextlib.contextmanager
def as_errors(address: str, error: type[PgmPlacesError], *, absent: bool = False) -> Iterator[None]:
    """Turn exceptions into one line with the address; with ``absent``, not FileNotFoundError."""
    try:
        yield
    except PgmPlacesError:
        raise
    except FileNotFoundError as problem:
        if absent:
            raise
        raise error(f"{address}: {escape_control(str(problem))[:500]}") from problem
    except Exception as problem:
        # The exceptions of file systems have no common base class but this one.
        text = re.sub(r"\s+", " ", str(problem)).strip() or type(problem).__name__
        raise error(f"{address}: {escape_control(text)[:500]}") from problem
