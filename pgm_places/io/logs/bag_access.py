"""Opening ROS bags: ROS 1 files, ROS 2 folders (sqlite3, MCAP) and single MCAP files.

The ``rosbags`` package does the reading and writing; it needs no ROS. It is an extra:
``pip install 'pgm-places[bags]'``.
"""

import contextlib
import sqlite3
import struct
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from pgm_places._extras import needed
from pgm_places.errors import LogError, PgmPlacesError

__all__ = ["is_bag", "open_bag", "stamp_s"]

_SUFFIXES = (".bag", ".mcap", ".db3")


def is_bag(path: Path | str) -> bool:
    """Whether a path looks like a bag: by its ending, or a folder with a ``metadata.yaml``."""
    path = Path(path)
    return path.suffix.lower() in _SUFFIXES or (path / "metadata.yaml").is_file()


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
    path = Path(path)
    if not path.exists():
        raise LogError(f"cannot read the bag {path}: no such file or folder")
    if path.suffix == ".db3" and (path.parent / "metadata.yaml").is_file():
        path = path.parent
    try:
        with highlevel.AnyReader([path], default_typestore=definitions) as reader:
            yield reader
    except PgmPlacesError:
        raise
    except _damage() as error:
        reason = str(error) or type(error).__name__
        raise LogError(
            f"cannot read the bag {path}: {reason}; is it complete? 'rosbag reindex', 'ros2 bag "
            "reindex' and 'mcap recover' repair truncated recordings"
        ) from error


def _damage() -> tuple[type[Exception], ...]:
    """What ``rosbags`` and the databases below it raise on damaged bytes."""
    from rosbags.highlevel import AnyReaderError
    from rosbags.rosbag1 import ReaderError as Ros1Error
    from rosbags.rosbag2 import ReaderError as Ros2Error

    own = (AnyReaderError, Ros1Error, Ros2Error, sqlite3.Error, struct.error)
    parsing = (ValueError, LookupError, AssertionError, OSError)
    try:
        import apsw
    except ImportError:  # some releases use Python's own sqlite3
        return (*own, *parsing)
    return (*own, *parsing, apsw.Error)


def stamp_s(message: Any, recorded_ns: int) -> float:
    """Seconds of a message's header stamp, or of when it was recorded where it has none."""
    header = getattr(message, "header", None)
    if header is None or (header.stamp.sec == 0 and header.stamp.nanosec == 0):
        return recorded_ns * 1e-9
    return float(header.stamp.sec + header.stamp.nanosec * 1e-9)
