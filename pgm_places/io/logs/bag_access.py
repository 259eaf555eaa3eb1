"""Opening ROS bags: ROS 1 files, ROS 2 folders (sqlite3, MCAP) and single MCAP files.

The ``rosbags`` package does the reading and writing; it needs no ROS. It is the extra ``bags``.
"""

import contextlib
import importlib
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from pgm_places._extras import needed
from pgm_places.errors import LogError, PgmPlacesError, printable
from pgm_places.io.input_file import file_kind, user_path
from pgm_places.io.logs.unpacking import bounded_chunks, plain_storage

_SUFFIXES = (".bag", ".mcap", ".db3")


def is_bag(path: Path | str) -> bool:
    """Whether a path looks like a bag: by its ending, or a folder with a ``metadata.yaml``."""
    path = Path(path)
    return path.suffix.lower() in _SUFFIXES or file_kind(path / "metadata.yaml") == "file"


@contextlib.contextmanager
def open_bag(path: Path | str) -> Iterator[Any]:
    """An open ``rosbags.highlevel.AnyReader``; whatever is wrong with the bag is a LogError.

    Messages are deserialised with the definitions that the bag holds, else with those of ROS 2.

    Raises
    ------
    LogError
        The bag is missing, or it turns out damaged while it is read inside the block.
    InputError
        ``rosbags`` is not installed.
    """
    highlevel = needed("rosbags.highlevel", extra="bags", purpose="reading ROS bags")
    typesys = needed("rosbags.typesys", extra="bags", purpose="reading ROS bags")
    definitions = typesys.get_typestore(typesys.Stores.ROS2_HUMBLE)
    path = user_path(path, LogError)
    if file_kind(path) not in ("file", "folder"):
        raise LogError(f"{path}: no such file or folder; expected a ROS bag")
    if path.suffix == ".db3" and file_kind(path.parent / "metadata.yaml") == "file":
        path = path.parent
    is_folder = file_kind(path) == "folder"
    storage = plain_storage(path) if is_folder else contextlib.nullcontext([path])
    try:
        with storage as files, contextlib.ExitStack() as stack:
            with _without_qos(), bounded_chunks(files):
                reader = highlevel.AnyReader(files, default_typestore=definitions)
                stack.enter_context(reader)
            yield reader
    except LogError as error:
        name = str(path)
        raise error if name in str(error) else LogError(f"{path}: {error}") from None
    except PgmPlacesError:
        raise
    # Damaged bytes make rosbags, the databases below it and whoever uses its messages raise
    # anything at all; wrong sizes even end in MemoryError.
    except Exception as error:
        said = str(error).rstrip(". ")
        reason = f"{type(error).__name__}: {said}" if said else type(error).__name__
        raise LogError(
            f"cannot read the bag {path}: {printable(reason)[:300]}; is it complete? "
            "'rosbag reindex', 'ros2 bag reindex' and 'mcap recover' repair truncated recordings"
        ) from error


@contextlib.contextmanager
def _without_qos() -> Iterator[None]:
    """Leave the publishers' quality of service unread, which nothing here needs.

    It is YAML within the bag, and a few kilobytes of malicious brackets keep the Python parser of
    ``rosbags`` busy for minutes.
    """
    modules: list[Any] = [
        importlib.import_module(f"rosbags.rosbag2.storage_{kind}") for kind in ("mcap", "sqlite3")
    ]
    parsers = [module.parse_qos for module in modules]
    try:
        for module in modules:
            module.parse_qos = lambda _: []
        yield
    finally:
        for module, parse in zip(modules, parsers, strict=True):
            module.parse_qos = parse


def stamp_s(message: Any, recorded_ns: int) -> float:
    """Seconds of a message's header stamp, or of when it was recorded where it has none."""
    header = getattr(message, "header", None)
    if header is None or (header.stamp.sec == 0 and header.stamp.nanosec == 0):
        return recorded_ns * 1e-9
    return float(header.stamp.sec + header.stamp.nanosec * 1e-9)
