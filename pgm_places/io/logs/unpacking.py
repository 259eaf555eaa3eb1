"""Unpacking untrusted data: never more than a limit, whatever the packed bytes claim.

A kilobyte of bz2 or Zstandard can hold a gigabyte of zeros, and ``rosbags`` unpacks without limits.
"""

import bz2
import importlib
import shutil
import sys
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path, PurePosixPath
from typing import Any

from pgm_places.errors import LogError, printable, shown
from pgm_places.io.input_file import file_kind, open_input
from pgm_places.io.strict_yaml import read_yaml

__all__ = ["MAX_CHUNK_BYTES", "plain_storage", "unpacked_size", "zstd_module"]

MAX_CHUNK_BYTES = 256 << 20
"""Of a chunk, unpacked; writers begin a new one after some megabytes."""

MOST_TIMES, FREE_BYTES = 1000, 16 << 20
"""At most 1000 times their size plus 16 MiB once unpacked; bags of scans shrink to a tenth."""

_PIECE = 1 << 20


def zstd_module() -> Any:
    """The module of Zstandard that ``rosbags`` itself unpacks with."""
    return importlib.import_module(
        "compression.zstd" if sys.version_info >= (3, 14) else "backports.zstd"
    )


def unpacked_size(compression: str, data: bytes, most: int) -> int:
    """How many bytes the data of a chunk become, counted up to a limit without keeping them.

    Parameters
    ----------
    compression : {"bz2", "lz4"}
    data : bytes
    most : int
        Counting ends above this.

    Raises
    ------
    ValueError
        The data are damaged or truncated.
    """
    total = 0
    while data and total <= most:
        unpack = _decompressor(compression)
        try:
            while not unpack.eof and total <= most:
                piece = unpack.decompress(data, _PIECE)
                if not piece and unpack.needs_input and not unpack.eof:
                    raise ValueError("it is truncated")
                total, data = total + len(piece), b""
        except (OSError, RuntimeError) as error:
            raise ValueError(str(error)) from None
        data = unpack.unused_data or b""
    return total


def _decompressor(compression: str) -> Any:
    if compression == "bz2":
        return bz2.BZ2Decompressor()
    return importlib.import_module("lz4.frame").LZ4FrameDecompressor()


@contextmanager
def plain_storage(folder: Path) -> Iterator[list[Path]]:
    """The files of a ROS 2 bag's folder, unpacked where they are packed.

    ``rosbags`` is given these instead of the folder, because it reads ``metadata.yaml`` without a
    time limit. Whatever else that file says, such as the topics, the files say too.

    Raises
    ------
    LogError
        ``metadata.yaml`` is not plain YAML of at most 256 KiB, or names no files, one twice or one
        that is missing; a file unpacks to more than 16 MiB and a thousand times its size, or to
        more than the disk has room for; messages are compressed individually.
    """
    metadata = read_yaml(folder / "metadata.yaml", LogError, "metadata of a ROS 2 bag")
    content = metadata.values.get("rosbag2_bagfile_information")
    about = content if isinstance(content, dict) else {}
    mode, names = about.get("compression_mode"), about.get("relative_file_paths")
    if isinstance(mode, str) and mode.lower() == "message":
        raise LogError(
            f"{folder}: its messages are compressed individually, which cannot be read within "
            "limits; convert it with 'ros2 bag convert', without compression or by file"
        )
    if not (isinstance(names, list) and names and all(isinstance(n, str) and n for n in names)):
        raise metadata.fail("relative_file_paths must be a list of names")
    paths = [folder / PurePosixPath(name).name for name in map(str, names)]
    if len(set(paths)) < len(paths):
        raise metadata.fail("relative_file_paths names a file twice")
    if absent := [path for path in paths if file_kind(path) != "file"]:
        raise metadata.fail(f"there is no file {shown(absent[0].name)}; it is part of the bag")
    if not (isinstance(mode, str) and mode.lower() == "file"):
        yield paths
        return
    with tempfile.TemporaryDirectory() as temporary:
        yield [_unpacked(path, Path(temporary)) for path in paths]


def _unpacked(path: Path, folder: Path) -> Path:
    """The file in a folder, which is bounded while it is written."""
    target = folder / path.stem
    room = shutil.disk_usage(folder).free - FREE_BYTES
    zstd = zstd_module()
    total = 0
    try:
        with (
            open_input(path, LogError, "a file of a ROS 2 bag") as file,
            zstd.open(file, "rb") as source,
            target.open("wb") as unpacked,
        ):
            most = FREE_BYTES + MOST_TIMES * path.stat().st_size
            while piece := source.read(_PIECE):
                total += len(piece)
                if total > most:
                    raise LogError(
                        f"{path}: it unpacks to more than {MOST_TIMES} times its size, which no "
                        "recording does"
                    )
                if total > room:
                    raise LogError(
                        f"{path}: there is not enough space to unpack it in {folder.parent}; "
                        "set TMPDIR to "
                        "a folder on a larger disk"
                    )
                unpacked.write(piece)
    except (zstd.ZstdError, EOFError) as error:
        raise LogError(f"{path} is damaged: {printable(str(error))}") from None
    return target
