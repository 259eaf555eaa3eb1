"""Unpacking untrusted data: never more than a limit, whatever the packed bytes claim.

A kilobyte of bz2 or Zstandard can hold a gigabyte of zeros, and ``rosbags`` unpacks without limits.
"""

import bz2
import importlib
import shutil
import struct
import sys
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path, PurePosixPath
from typing import IO, Any

from pgm_places.errors import LogError, printable, shown
from pgm_places.io.input_file import file_kind, open_input
from pgm_places.io.strict_yaml import read_yaml

__all__ = [
    "MAX_CHUNK_BYTES",
    "check_mcap",
    "check_ros1",
    "plain_storage",
    "unpacked_size",
    "zstd_module",
]


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


_MAGIC = b"#ROSBAG V2.0\n"

_FILE, _CHUNK, _CHUNK_INFO = b"\x03", b"\x05", b"\x06"

_MAX_HEADER = 16 << 20


def check_ros1(path: Path) -> None:
    """Refuse a bag whose records state wrong sizes, or whose chunks unpack to too much.

    Raises
    ------
    LogError
        It is damaged or truncated; a chunk has more than 256 MiB, or all together more than 16 MiB
        and a thousand times the file's size.
    """
    length = path.stat().st_size
    starts, chunks, index, named = {0, length}, set(), set(), set()
    total = 0
    with open_input(path, LogError, "a ROS 1 bag") as file:
        if file.read(len(_MAGIC)) != _MAGIC:
            raise LogError(f"{path} is not a ROS 1 bag of version 2.0")
        while (start := file.tell()) < length:
            record = _Record(path, file, length)
            starts.add(start)
            if record.kind == _FILE:
                index.add(record.number(b"index_pos", 8))
            elif record.kind == _CHUNK:
                chunks.add(start)
                total += _chunk_size(record, file)
            elif record.kind == _CHUNK_INFO:
                named.add(record.number(b"chunk_pos", 8))
                if record.number(b"count", 4) * 8 != record.size:
                    raise LogError(f"{record.where} is damaged")
            file.seek(record.end)
            if total > FREE_BYTES + MOST_TIMES * length:
                raise LogError(
                    f"{path}: it unpacks to more than {MOST_TIMES} times its size, which no "
                    "recording does"
                )
    if not (index <= starts and named <= chunks):
        wrong = min((index - starts) | (named - chunks))
        raise LogError(f"{path}: its index names a record at byte {wrong}; none is")


class _Record:
    """The header of a record, and where its data begin and end."""

    def __init__(self, path: Path, file: IO[bytes], length: int) -> None:
        self.where = f"{path}: the record at byte {file.tell()}"
        self.fields = dict(self._fields(self._sized(file, length)))
        self.kind = self.fields.get(b"op")
        (self.size,) = struct.unpack("<L", self._exactly(file, 4))
        self.end = file.tell() + self.size
        if self.end > length:
            raise LogError(
                f"{self.where} states {self.size} bytes, but the file ends before that; is it "
                "complete? "
                "'rosbag reindex' repairs truncated recordings"
            )

    def number(self, name: bytes, n_bytes: int) -> int:
        """A number of the header."""
        value = self.fields.get(name, b"")
        if len(value) != n_bytes:
            raise LogError(f"{self.where} is damaged")
        return int.from_bytes(value, "little")

    def _sized(self, file: IO[bytes], length: int) -> bytes:
        (size,) = struct.unpack("<L", self._exactly(file, 4))
        if size > min(length, _MAX_HEADER):
            raise LogError(f"{self.where} is damaged")
        return self._exactly(file, size)

    def _exactly(self, file: IO[bytes], n_bytes: int) -> bytes:
        data = file.read(n_bytes)
        if len(data) != n_bytes:
            raise LogError(f"{self.where} is truncated; 'rosbag reindex' repairs such recordings")
        return data

    def _fields(self, header: bytes) -> Iterator[tuple[bytes, bytes]]:
        at = 0
        while at < len(header):
            size = int.from_bytes(header[at : at + 4], "little")
            name, _, value = header[at + 4 : at + 4 + size].partition(b"=")
            yield name, value
            at += 4 + size


def _chunk_size(record: _Record, file: IO[bytes]) -> int:
    """The size of a chunk once unpacked, if it is the one that it states."""
    stated = record.number(b"size", 4)
    compression = record.fields.get(b"compression", b"").decode("latin-1")
    if stated > MAX_CHUNK_BYTES:
        raise LogError(f"{record.where} states {stated} bytes; at most {MAX_CHUNK_BYTES} are read")
    if compression == "none":
        return record.size
    if compression not in ("bz2", "lz4"):
        raise LogError(f"{record.where} is compressed by {printable(compression)}")
    try:
        found = unpacked_size(compression, file.read(record.size), stated)
    except ValueError as error:
        raise LogError(f"{record.where} is damaged: {printable(str(error))}") from None
    if found != stated:
        more = "more" if found > stated else found
        raise LogError(f"{record.where} states {stated} bytes, but its data unpack to {more}")
    return found


_MOST_LZ4 = 255
"""The largest factor by which LZ4 can expand its data."""

_MCAP_MAGIC = b"\x89MCAP0\r\n"

_FOOTER, _MCAP_CHUNK, _CHUNK_INDEX = 0x02, 0x06, 0x08


def check_mcap(path: Path) -> None:
    """Refuse a file whose records, chunks or index state wrong sizes or positions.

    Raises
    ------
    LogError
        It is damaged or truncated, or has a chunk of more than 256 MiB.
    """
    with open_input(path, LogError, "an MCAP file") as file:
        length = path.stat().st_size
        if file.read(len(_MCAP_MAGIC)) != _MCAP_MAGIC:
            raise LogError(f"{path} is not an MCAP file")
        chunks, indexed = set(), set()
        while len(head := file.read(9)) == 9:
            kind, size = struct.unpack("<BQ", head)
            start = file.tell()
            if size > length - start:
                raise LogError(
                    f"{path}: the record at byte {start - 9} states {size} bytes, but the file "
                    "ends before that; is it complete? 'mcap recover' repairs truncated recordings"
                )
            if kind == _MCAP_CHUNK:
                _check_chunk(path, file, size)
                chunks.add(start - 9)
            elif kind == _CHUNK_INDEX and size >= 24:
                indexed.add(struct.unpack("<QQQ", file.read(24))[2])
            elif kind == _FOOTER:
                break
            file.seek(start + size)
    if not indexed <= chunks:
        raise LogError(f"{path}: its index names a chunk at byte {min(indexed - chunks)}; none is")


def _check_chunk(path: Path, file: IO[bytes], size: int) -> None:
    where = f"{path}: the chunk at byte {file.tell() - 9}"
    fixed = file.read(32)
    if len(fixed) < 32 or size < 40:
        raise LogError(f"{where} is damaged")
    _, _, unpacked, _, name_length = struct.unpack("<QQQII", fixed)
    if unpacked > MAX_CHUNK_BYTES:
        raise LogError(f"{where} states {unpacked} bytes; at most {MAX_CHUNK_BYTES} are read")
    if name_length > min(size - 40, 100):
        raise LogError(f"{where} is damaged")
    compression = file.read(name_length)
    (packed,) = struct.unpack("<Q", file.read(8))
    if packed > size - 40 - name_length:
        raise LogError(f"{where} states {packed} bytes, but has {size - 40 - name_length}")
    if compression == b"zstd":
        _check_frame(where, file.read(packed), unpacked)
    elif compression == b"lz4" and packed * _MOST_LZ4 > MAX_CHUNK_BYTES:
        _check_lz4(where, file.read(packed), unpacked)
    elif compression not in (b"", b"lz4"):
        raise LogError(f"{where} is compressed by {printable(compression.decode('latin-1'))}")


def _check_frame(where: str, data: bytes, unpacked: int) -> None:
    """One frame that states its size, which the decoder then holds it to."""
    zstd = zstd_module()
    try:
        stated = zstd.get_frame_info(data).decompressed_size
        is_whole = zstd.get_frame_size(data) == len(data)
    except zstd.ZstdError as error:
        raise LogError(f"{where} is damaged: {error}") from None
    if stated != unpacked or not is_whole:
        raise LogError(f"{where} states {unpacked} bytes, but its data state {stated}")


def _check_lz4(where: str, data: bytes, unpacked: int) -> None:
    try:
        found = unpacked_size("lz4", data, unpacked)
    except ValueError as error:
        raise LogError(f"{where} is damaged: {printable(str(error))}") from None
    if found > unpacked:
        raise LogError(f"{where} states {unpacked} bytes, but its data unpack to more")
