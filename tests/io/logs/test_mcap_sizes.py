"""MCAP files that lie about sizes: refused before anything is unpacked."""

import struct
from pathlib import Path

import pytest
from backports import zstd

from pgm_places import ScanGeometry
from pgm_places.errors import LogError
from pgm_places.io.logs.bags import read_bag
from pgm_places.io.logs.trajectories import write_trajectory
from pgm_places.io.logs.unpacking import MAX_CHUNK_BYTES, check_mcap
from tests.io.logs.log_files import drive

MAGIC = b"\x89MCAP0\r\n"


def record(kind: int, content: bytes, size: int | None = None) -> bytes:
    return struct.pack("<BQ", kind, len(content) if size is None else size) + content


def chunk(unpacked: int, compression: bytes, data: bytes, packed: int | None = None) -> bytes:
    head = struct.pack("<QQQII", 0, 0, unpacked, 0, len(compression)) + compression
    return record(6, head + struct.pack("<Q", len(data) if packed is None else packed) + data)


def index(start: int) -> bytes:
    return record(8, struct.pack("<QQQQ", 0, 0, start, 50))


BOMB = zstd.compress(bytes(50_000_000))


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (b"", "is not an MCAP file"),
        (record(1, b"", size=2**64 - 1), "the record at byte 8 states 18446744073709551615 bytes"),
        (chunk(MAX_CHUNK_BYTES + 1, b"", b""), "at most 268435456 are read"),
        (chunk(5, b"", b"", packed=2**63), "states 9223372036854775808 bytes, but has 0"),
        (chunk(1000, b"zstd", BOMB), "states 1000 bytes, but its data state 50000000"),
        (chunk(1000, b"zstd", zstd.compress(bytes(1000)) + BOMB), "states 1000 bytes, but"),
        (chunk(1000, b"zstd", b"nonsense"), "is damaged"),
        (chunk(0, b"rar", b""), "is compressed by rar"),
        (record(6, b"short"), "is damaged"),
        (chunk(0, b"", b"") + index(9), "its index names a chunk at byte 9; none is"),
    ],
)
def test_sizes_that_lie_are_refused(content: bytes, message: str, tmp_path: Path) -> None:
    path = tmp_path / "a.mcap"
    path.write_bytes(content and MAGIC + content)
    with pytest.raises(LogError) as caught:
        read_bag(path)
    assert message in str(caught.value)


def test_what_is_written_is_right(tmp_path: Path) -> None:
    check_mcap(write_trajectory(tmp_path / "a.mcap", drive(ScanGeometry.half_circle(4), 5)))
    (tmp_path / "b.mcap").write_bytes(MAGIC + chunk(1000, b"zstd", zstd.compress(bytes(1000))))
    check_mcap(tmp_path / "b.mcap")
