"""The sizes that an MCAP file states, checked before anything is unpacked.

The format is described at https://mcap.dev/spec. ``rosbags`` trusts these sizes.
"""

import struct
from pathlib import Path
from typing import IO

from pgm_places.errors import LogError, printable
from pgm_places.io.input_file import open_input
from pgm_places.io.logs.unpacking import MAX_CHUNK_BYTES, unpacked_size, zstd_module

__all__ = ["check_mcap"]

_MOST_LZ4 = 255
"""The largest factor by which LZ4 can expand its data."""
_MAGIC = b"\x89MCAP0\r\n"
_FOOTER, _CHUNK, _CHUNK_INDEX = 0x02, 0x06, 0x08


def check_mcap(path: Path) -> None:
    """Refuse a file whose records, chunks or index state wrong sizes or positions.

    Raises
    ------
    LogError
        It is damaged or truncated, or has a chunk of more than 256 MiB.
    """
    with open_input(path, LogError, "an MCAP file") as file:
        length = path.stat().st_size
        if file.read(len(_MAGIC)) != _MAGIC:
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
            if kind == _CHUNK:
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
