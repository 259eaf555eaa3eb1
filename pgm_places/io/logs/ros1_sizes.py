"""The sizes that a ROS 1 bag states, checked before anything is unpacked.

The format is described at https://wiki.ros.org/Bags/Format/2.0. ``rosbags`` trusts the positions in
the index, and unpacks chunks without a limit.
"""

import struct
from collections.abc import Iterator
from pathlib import Path
from typing import IO

from pgm_places.errors import LogError, printable
from pgm_places.io.input_file import open_input
from pgm_places.io.logs.unpacking import FREE_BYTES, MAX_CHUNK_BYTES, MOST_TIMES, unpacked_size

__all__ = ["check_ros1"]

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
