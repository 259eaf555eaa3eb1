"""Output that is complete or absent."""

import os
from pathlib import Path

import pytest

from pgm_places.errors import OutputError
from pgm_places.io.atomic import (
    atomic_file,
    atomic_folder,
    check_folder_target,
    tidy,
    write_bytes,
    write_text,
)
from pgm_places.io.staging import NEW, UNFINISHED


def names(folder: Path) -> list[str]:
    return sorted(item.name for item in folder.iterdir())


def test_files_are_written_with_their_folders(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = write_text(tmp_path / "a" / "b" / "x.txt", "grün\n")
    assert path.read_bytes() == "grün\n".encode()
    write_bytes(path, b"new")
    assert path.read_bytes() == b"new"
    monkeypatch.chdir(path.parent)
    check_folder_target("new")
    write_text("y.txt", "y")
    assert names(path.parent) == ["x.txt", "y.txt"]


def test_an_interruption_leaves_what_was_there(tmp_path: Path) -> None:
    path = write_text(tmp_path / "out" / "old", "old")
    with pytest.raises(KeyboardInterrupt), atomic_file(path) as temporary:
        temporary.write_text("half")
        raise KeyboardInterrupt
    with (
        pytest.raises(KeyboardInterrupt),
        atomic_folder(path.parent, replaces=lambda _: True) as temporary,
    ):
        (temporary / "new").write_text("half")
        raise KeyboardInterrupt
    assert path.read_text() == "old"
    assert names(tmp_path) == ["out"] and names(path.parent) == ["old"]


def test_a_folder_is_filled_and_replaced_only_where_allowed(tmp_path: Path) -> None:
    folder = tmp_path / "deep" / "out"
    folder.mkdir(parents=True)
    with atomic_folder(folder) as temporary:
        (temporary / "one").write_text("1")
    with atomic_folder(folder, replaces=lambda path: (path / "one").exists()) as temporary:
        (temporary / "two").write_text("2")
    assert (names(folder), names(folder.parent)) == (["two"], ["out"])
    with pytest.raises(OutputError, match="out: it exists and holds other files; choose another"):
        atomic_folder(folder).__enter__()
    check_folder_target(tmp_path / "absent")


def test_what_is_in_the_way_is_named(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    (tmp_path / "folder").mkdir()
    (tmp_path / "link").symlink_to(tmp_path / "folder")
    with pytest.raises(OutputError, match="a folder of that name is in the way"):
        write_text(tmp_path / "folder", "")
    with pytest.raises(OutputError, match="file is a file, not a folder; choose another path"):
        write_text(tmp_path / "file" / "x.txt", "")
    (tmp_path / "nowhere").symlink_to(tmp_path / "absent")
    for name in ("file", "nowhere"):
        with pytest.raises(OutputError, match=f"{name}: a file of that name is in the way"):
            check_folder_target(tmp_path / name)
    check_folder_target(tmp_path / "link")


def test_a_refused_write_names_the_reason(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(self: Path, data: bytes) -> int:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(Path, "write_bytes", refuse)
    with pytest.raises(OutputError, match=r"x\.txt: No space left on device; check the permission"):
        write_text(tmp_path / "x.txt", "text")
    assert names(tmp_path) == []
    monkeypatch.setattr(os, "access", lambda path, mode: False)  # as for anyone but root
    with pytest.raises(OutputError, match="Permission denied; check the permissions"):
        check_folder_target(tmp_path / "model")


def test_an_interrupted_swap_takes_nothing_from_behind_a_link(tmp_path: Path) -> None:
    home, target = tmp_path / "home", tmp_path / "results"
    home.mkdir()
    (home / "id_rsa").write_text("secret")
    (target / UNFINISHED).mkdir(parents=True)
    (target / UNFINISHED / NEW).symlink_to(home)
    with pytest.raises(OutputError, match="new: it is a symbolic link; remove it"):
        tidy(target)
    assert (home / "id_rsa").read_text() == "secret"
