"""Files are flushed to disk before they are moved into place, and afterwards the folders there."""

import os
from collections.abc import Callable
from pathlib import Path

import pytest

from pgm_places.io import staging
from pgm_places.io.atomic import atomic_folder, write_text
from pgm_places.studio.journal import Journal
from tests.faults.sets import write_set

pytestmark = pytest.mark.skipif(os.name != "posix", reason="folders are flushed on POSIX systems")


class Disk:
    """What a power cut would lose: what was moved into a folder before it was flushed.

    Names that were moved into a folder wait until the folder is flushed; nothing may be moved out
    of a folder whose own name still waits.
    """

    def __init__(self, folder: Path, patch: pytest.MonkeyPatch) -> None:
        self.flushed = {path.stat().st_ino for path in folder.rglob("*")}
        self.lost: list[str] = []
        self.waiting: dict[int, list[Path]] = {}
        for name in ("rename", "replace"):
            patch.setattr(os, name, self._watched(getattr(os, name)))
        patch.setattr(staging, "_exchange", self._watched(staging._exchange))
        patch.setattr(os, "fsync", self._flush)

    def _flush(self, number: int) -> None:
        inode = os.fstat(number).st_ino
        self.flushed.add(inode)
        self.waiting.pop(inode, None)

    def _watched(self, move: Callable[[Path, Path], None]) -> Callable[[Path, Path], None]:
        def watched(new: Path, path: Path) -> None:
            is_aside = any(part.endswith(".tmp") for part in path.parts)
            found = [] if is_aside else [new, *new.rglob("*")]
            moved = [item for item in found if item.is_file() or any(item.iterdir())]
            self.lost += [item.name for item in moved if item.stat().st_ino not in self.flushed]
            names = [name for some in self.waiting.values() for name in some]
            self.lost += [name.name for name in names if new.is_relative_to(name)]
            if moved:
                self.waiting.setdefault(path.parent.stat().st_ino, []).append(path)
            move(new, path)

        return watched


def write_a_file(target: Path) -> None:
    write_text(target / "a.txt", "new")


def write_a_folder(target: Path) -> None:
    with atomic_folder(target, replaces=lambda _: True) as folder:
        write_text(folder / "bag" / "one", "new")
        (folder / "a.txt").write_text("new")


def write_our_set(target: Path) -> None:
    write_set(target, "new")


def write_a_set_among_others(target: Path) -> None:
    write_set(target, "new", shared=True)


@pytest.mark.parametrize(
    "write", [write_a_file, write_a_folder, write_our_set, write_a_set_among_others]
)
@pytest.mark.parametrize("before", ["absent", "there", "current"])
def test_a_power_cut_loses_nothing_that_was_moved_into_place(
    write: Callable[[Path], None], before: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    target = tmp_path / "out"
    if before != "absent":
        write_set(target, "old")
        (target / "own").mkdir()
        (target / "own" / "mine.txt").write_text("mine")
    if before == "current":  # files are moved one by one
        monkeypatch.chdir(target)
    with monkeypatch.context() as patch:
        disk = Disk(tmp_path, patch)
        write(target)
    assert (disk.lost, disk.waiting) == ([], {})
    assert (target / "a.txt").read_text() == "new"


def test_an_entry_of_a_journal_is_on_the_disk_before_it_takes_effect(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    flushed = []
    monkeypatch.setattr(os, "fsync", lambda number: flushed.append(os.fstat(number).st_size))
    path = tmp_path / "journal.jsonl"
    journal = Journal(path, {"map": "a"})
    journal.append({"op": "undo"})
    assert flushed[-1] == path.stat().st_size
    journal.close()
