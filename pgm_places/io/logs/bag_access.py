"""Opening ROS bags: ROS 1 files, ROS 2 folders (sqlite3, MCAP) and single MCAP files.

The ``rosbags`` package does the reading and writing; it needs no ROS. It is the extra ``bags``.
"""

import bz2
import contextlib
import importlib
import shutil
import sys
import tempfile
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from functools import partial
from pathlib import Path, PurePosixPath
from typing import Any

from pgm_places.errors import LogError, PgmPlacesError, escape_control, quoted
from pgm_places.io.input_file import file_kind, open_input, user_path
from pgm_places.io.strict_yaml import read_yaml
from pgm_places.plugins import needed

MAX_CHUNK_BYTES = 256 << 20
"""The largest unpacked chunk; writers begin a new one after some megabytes."""

MOST_TIMES, FREE_BYTES = 1000, 16 << 20
"""The largest allowed ratio of unpacked to packed size; bags of scans have about 10."""

_PIECE = 1 << 20


def zstd_module() -> Any:
    """The Zstandard module that ``rosbags`` uses."""
    return importlib.import_module(
        "compression.zstd" if sys.version_info >= (3, 14) else "backports.zstd"
    )


def unpacked(compression: str, data: bytes, *, _most: int = MAX_CHUNK_BYTES) -> bytes:
    """The data of a chunk that is compressed with "bz2", "lz4" or "zstd": at most 256 MiB.

    Raises LogError if they are larger or truncated, and the library's exceptions if damaged.
    """
    pieces: list[bytes] = []
    size = 0
    while data:
        decompressor = _decompressor(compression)
        while not decompressor.eof:
            piece = decompressor.decompress(data, _PIECE)
            if not piece and decompressor.needs_input and not decompressor.eof:
                raise LogError(f"a chunk of {compression} is truncated")
            pieces.append(piece)
            size, data = size + len(piece), b""
            if size > _most:
                raise LogError(f"a chunk unpacks to more than {_most} bytes")
        data = decompressor.unused_data or b""
    return b"".join(pieces)


@contextmanager
def bounded_chunks(files: Sequence[Path]) -> Iterator[None]:
    """Replace the decompressors of ``rosbags``, which have no size limits, while a bag is opened.

    All chunks of a ROS 1 bag together may unpack to 16 MiB plus a thousand times its size. MCAP
    chunks are unpacked later, when they are read, so those decompressors remain replaced: several
    bags may be open at once.
    """
    left = [FREE_BYTES + MOST_TIMES * sum(file.stat().st_size for file in files)]

    def within_budget(compression: str, data: bytes) -> bytes:
        content = unpacked(compression, data)
        left[0] -= len(content)
        if left[0] < 0:
            raise LogError(
                f"it unpacks to more than {MOST_TIMES} times its size, which no recording does"
            )
        return content

    mcap = importlib.import_module("rosbags.rosbag2.storage_mcap").DECOMPRESSORS
    mcap.update({name: lambda data, _, n=name: unpacked(n, data) for name in ("lz4", "zstd")})
    ros1 = importlib.import_module("rosbags.rosbag1.reader").decompressors
    before = dict(ros1)
    ros1.update({name: partial(within_budget, name) for name in ("bz2", "lz4")})
    try:
        yield
    finally:
        ros1.update(before)


def _decompressor(compression: str) -> Any:
    if compression == "bz2":
        return bz2.BZ2Decompressor()
    if compression == "lz4":
        return importlib.import_module("lz4.frame").LZ4FrameDecompressor()
    return zstd_module().ZstdDecompressor()


@contextmanager
def plain_storage(folder: Path) -> Iterator[list[Path]]:
    """The files in the folder of a ROS 2 bag, decompressed if needed, within limits of size.

    ``rosbags`` gets these instead of the folder, because it parses ``metadata.yaml`` without a time
    limit. The files repeat all other content of ``metadata.yaml``, such as the topics.
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
        raise metadata.fail(f"there is no file {quoted(absent[0].name)}; it is part of the bag")
    if not (isinstance(mode, str) and mode.lower() == "file"):
        yield paths
        return
    with tempfile.TemporaryDirectory() as temporary:
        yield [_unpacked(path, Path(temporary)) for path in paths]


def _unpacked(path: Path, folder: Path) -> Path:
    """Decompress a file into a folder, within limits; its path."""
    target = folder / path.stem
    free_bytes = shutil.disk_usage(folder).free - FREE_BYTES
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
                if total > free_bytes:
                    raise LogError(
                        f"{path}: there is not enough space to unpack it in {folder.parent}; "
                        "set TMPDIR to "
                        "a folder on a larger disk"
                    )
                unpacked.write(piece)
    except (zstd.ZstdError, EOFError) as error:
        raise LogError(f"{path} is damaged: {escape_control(str(error))}") from None
    return target


_SUFFIXES = (".bag", ".mcap", ".db3")


def is_bag(path: Path | str) -> bool:
    """Whether a path looks like a bag: by its ending, or a folder with a ``metadata.yaml``."""
    path = Path(path)
    return path.suffix.lower() in _SUFFIXES or file_kind(path / "metadata.yaml") == "file"


@contextlib.contextmanager
def open_bag(path: Path | str) -> Iterator[Any]:
    """An open ``rosbags.highlevel.AnyReader``; all errors of the bag are LogErrors.

    Messages are deserialised with the bag's own definitions, else with those of ROS 2.
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
    for file in path.iterdir() if is_folder else [path]:
        if file_kind(file) == "file":
            open_input(file, LogError, "a ROS bag").close()  # detects a pointer of Git LFS
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
    # Damaged bytes make rosbags, its databases and users of its messages raise any exception;
    # wrong sizes even end in MemoryError.
    except Exception as error:
        text = str(error).rstrip(". ")
        reason = f"{type(error).__name__}: {text}" if text else type(error).__name__
        raise LogError(
            f"cannot read the bag {path}: {escape_control(reason)[:300]}; is it complete? "
            "'rosbag reindex', 'ros2 bag reindex' and 'mcap recover' repair truncated recordings"
        ) from error


@contextlib.contextmanager
def _without_qos() -> Iterator[None]:
    """Skip the publishers' quality of service, which is not needed here.

    A few kilobytes of malicious YAML in it occupy the parser of ``rosbags`` for minutes.
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
    """Header stamp of a message in seconds, or its recording time if it has none."""
    header = getattr(message, "header", None)
    if header is None or (header.stamp.sec == 0 and header.stamp.nanosec == 0):
        return recorded_ns * 1e-9
    return float(header.stamp.sec + header.stamp.nanosec * 1e-9)
