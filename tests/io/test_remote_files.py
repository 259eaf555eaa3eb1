"""Requests that a busy server refuses are tried again; no bucket is made; leftovers go."""

import errno
import os
import tempfile
import time
from pathlib import Path
from typing import Any

import pytest

from pgm_places.errors import InputError, OutputError
from pgm_places.io.remote_files import RemoteFolder, is_passing, temporary_folder
from tests.refusals import refused

fsspec = pytest.importorskip("fsspec")
memory = pytest.importorskip("fsspec.implementations.memory")


class Busy(memory.MemoryFileSystem):  # type: ignore[misc,name-defined]
    """A store in memory that refuses the first requests to write, and all to make folders."""

    protocol = "memory"
    refusals = 0

    def put_file(self, local: str, target: str, **_: Any) -> None:
        if Busy.refusals:
            Busy.refusals -= 1
            raise OSError(errno.EBUSY, "Please reduce your request rate.")
        self.pipe_file(target, Path(local).read_bytes())

    def makedirs(self, path: str, exist_ok: bool = False) -> None:
        raise AssertionError("in a store of buckets this would make one")


@pytest.fixture
def waits(monkeypatch: pytest.MonkeyPatch) -> list[float]:
    found: list[float] = []
    monkeypatch.setattr(time, "sleep", found.append)
    return found


def put(folder: Path, refusals: int, *, is_patient: bool = True) -> None:
    (folder / "a").write_text("ours")
    Busy.refusals = refusals
    system = Busy(skip_instance_cache=True)
    RemoteFolder("s3://b/out", system, "/b/out", is_patient).put(folder, ["a"], OutputError)
    assert system.cat_file("/b/out/a") == b"ours"


def test_what_a_busy_server_refuses_is_tried_again_with_growing_waits(
    tmp_path: Path, waits: list[float]
) -> None:
    put(tmp_path, 5)
    assert len(waits) == 5
    assert all(0.5 * 2**n / 2 <= wait <= 0.5 * 2**n for n, wait in enumerate(waits))


def test_a_server_that_stays_busy_is_given_up_after_minutes(
    tmp_path: Path, waits: list[float]
) -> None:
    refused(OutputError, r"s3://b/out: .*reduce your request rate", put, tmp_path, 1000)
    assert 90 <= sum(waits) <= 182
    waits.clear()
    refused(OutputError, "reduce your request rate", put, tmp_path, 1000, is_patient=False)
    assert waits == []


def error(kind: type[Exception], **values: Any) -> Exception:
    made = kind()
    for name, value in values.items():
        setattr(made, name, value)
    return made


@pytest.mark.parametrize(
    ("problem", "expected"),
    [
        (OSError(errno.EBUSY, "slow down"), True),
        (OSError(errno.ENOSPC, "full"), False),
        (FileNotFoundError("no such bucket"), False),
        (PermissionError("InvalidAccessKeyId"), False),
        (ValueError("no address"), False),
        (TimeoutError(), True),
        (ConnectionResetError(), True),
        (error(Exception, status=503), True),
        (error(Exception, code=429), True),
        (error(Exception, status_code=403), False),
        (error(Exception, response={"ResponseMetadata": {"HTTPStatusCode": 500}}), True),
        (error(type("ReadTimeoutError", (Exception,), {})), True),
    ],
)
def test_what_passes_by_itself(problem: Exception, expected: bool) -> None:
    assert is_passing(problem) is expected
    wrapped = RuntimeError("above")
    wrapped.__cause__ = problem
    assert is_passing(wrapped) is expected


def test_the_first_bytes_are_asked_for_by_name(tmp_path: Path) -> None:
    """The third argument of cat_file is a version with some systems, and the start with others."""

    class Versioned(memory.MemoryFileSystem):  # type: ignore[misc,name-defined]
        def cat_file(
            self, path: str, version: object = None, start: Any = None, end: Any = None, **_: Any
        ) -> bytes:
            assert version is None
            return bytes(super().cat_file(path, start=start, end=end))

    system = Versioned(skip_instance_cache=True)
    system.pipe_file("/b/hall.yaml", b"image: hall.png")
    assert RemoteFolder("s3://b/hall.yaml", system, "/b/hall.yaml").head(6) == b"image:"


def test_folders_of_this_machine_are_made(tmp_path: Path) -> None:
    (tmp_path / "a").write_text("ours")
    RemoteFolder.at(f"file://{tmp_path}/new/er").put(tmp_path, ["a"], OutputError)
    assert (tmp_path / "new" / "er" / "a").read_text() == "ours"


def test_a_file_that_is_not_there_leaves_none_here(tmp_path: Path) -> None:
    assert not RemoteFolder.at(f"file://{tmp_path}").fetch("none", tmp_path / "copy")
    assert not (tmp_path / "copy").exists()
    refused(InputError, "none", RemoteFolder.at(f"file://{tmp_path}/none").head, 10)


def test_temporary_folders_of_killed_runs_go_and_those_in_use_stay(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    left = tmp_path / ".pgm-places.0123456789ab.tmp"
    (left / "new").mkdir(parents=True)
    with temporary_folder() as one:
        assert not left.exists()
        assert one.parent.stat().st_mode & 0o777 == 0o700 or os.name != "posix"
        with temporary_folder() as other:
            assert one.exists() and other.exists()
    assert list(tmp_path.iterdir()) == []
