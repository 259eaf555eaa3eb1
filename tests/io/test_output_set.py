"""Sets of files: what they replace, what they refuse, and what they leave alone."""

import json
import os
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from threading import Barrier

import pytest

from pgm_places.errors import OutputError
from pgm_places.io.atomic import atomic_folder, write_text
from pgm_places.io.output_set import RECORD_FILE, claim, output_set
from pgm_places.io.staging import UNFINISHED, stage
from tests.refusals import refused


def write(
    folder: Path, by: str, *names: str, text: str = "ours", force: bool = False
) -> list[Path]:
    with output_set(folder, by, names=names, force=force) as files:
        for name in names:
            path = files.stage / name
            path.parent.mkdir(exist_ok=True)
            path.write_text(text)
    return files.written


def names(folder: Path) -> set[str]:
    return {path.relative_to(folder).as_posix() for path in folder.rglob("*") if path.is_file()}


@pytest.fixture(params=["exchanged", "in place"])
def out(request: pytest.FixtureRequest, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A folder with a set of ours; also where one folder cannot be exchanged for another."""
    if request.param == "in place":

        def refuse(one: Path, other: Path) -> None:
            raise OSError("no such call")

        monkeypatch.setattr("pgm_places.io.staging._exchange", refuse)
    write(tmp_path / "out", "label", "a", "b", "sub/c")
    return tmp_path / "out"


def test_a_new_set_of_the_same_command_replaces_the_old_one(out: Path) -> None:
    (out / "mine").write_text("mine")
    written = write(out, "label", "a", "d", text="new")
    assert written == [out / "a", out / "d"]
    assert names(out) == {"a", "d", "mine", RECORD_FILE}
    assert (out / "a").read_text() == "new"
    assert (out / "mine").read_text() == "mine"
    assert [path.name for path in out.parent.iterdir()] == ["out"]


def test_another_command_adds_to_the_folder_and_takes_over_what_it_writes(out: Path) -> None:
    write(out, "topology", "b", "t")
    assert names(out) == {"a", "b", "sub/c", "t", RECORD_FILE}
    write(out, "label", "a")
    assert names(out) == {"a", "b", "t", RECORD_FILE}


def test_a_folder_that_is_not_ours_is_refused_before_the_work(tmp_path: Path) -> None:
    (tmp_path / "notes.txt").write_text("mine")
    with pytest.raises(OutputError) as caught, output_set(tmp_path, "label"):
        pytest.fail("the work was begun")
    assert str(caught.value) == (
        f"cannot write into {tmp_path}: it holds files that pgm-places did not write, such as "
        "notes.txt; choose another folder, or pass --force to write there anyway"
    )
    write(tmp_path, "label", "a", force=True)
    assert names(tmp_path) == {"a", "notes.txt", RECORD_FILE}


@pytest.mark.parametrize(
    ("content", "what"),
    [
        ("by hand", "it was changed since pgm-places wrote it"),
        (None, "it exists already, and pgm-places did not write it"),
    ],
)
def test_a_file_of_the_user_is_overwritten_with_force_only(
    out: Path, content: str | None, what: str
) -> None:
    path = out / ("a" if content else "d")
    path.write_text("by hand")
    with pytest.raises(OutputError) as caught, output_set(out, "label", names=["a", "d"]):
        pytest.fail("the work was begun")
    assert str(caught.value) == (
        f"cannot overwrite {path}: {what}; choose another folder, move the file away, or pass "
        "--force to overwrite it"
    )
    assert path.read_text() == "by hand"
    write(out, "label", "a", "d", text="new", force=True)
    assert path.read_text() == "new"


def test_a_changed_file_that_would_be_removed_is_refused_too(out: Path) -> None:
    (out / "b").write_text("by hand")
    refused(OutputError, r"cannot overwrite .*b: it was changed since", write, out, "label", "a")
    write(out, "topology", "t")  # which has nothing to do with it
    assert (out / "b").read_text() == "by hand"


def test_a_file_that_came_during_the_work_is_not_overwritten(out: Path) -> None:
    with (
        pytest.raises(OutputError, match=r"cannot overwrite .*d: it exists already"),
        output_set(out, "label") as files,
    ):
        (files.stage / "d").write_text("new")
        (out / "d").write_text("mine")
    assert (out / "d").read_text() == "mine"
    assert (out / "a").read_text() == "ours"


def test_a_shared_folder_may_hold_other_files(tmp_path: Path) -> None:
    (tmp_path / "mine").write_text("mine")
    with output_set(tmp_path, "simulate", shared=True) as files:
        (files.stage / "drive.log").write_text("log")
    assert names(tmp_path) == {"mine", "drive.log", RECORD_FILE}
    with (
        pytest.raises(OutputError, match=r"cannot overwrite .*mine"),
        output_set(tmp_path, "simulate", names=["mine"], shared=True),
    ):
        pass


def test_errors_name_the_file_that_was_to_be(tmp_path: Path) -> None:
    with pytest.raises(OutputError) as caught, output_set(tmp_path / "out", "label") as files:
        raise OutputError(f"cannot write {files.stage / 'a'}: no space")
    assert str(caught.value) == f"cannot write {tmp_path / 'out' / 'a'}: no space"


def test_a_folder_in_the_way_of_a_file_is_refused_even_with_force(out: Path) -> None:
    (out / "d").mkdir()
    with pytest.raises(OutputError, match="a folder of that name is in the way"):
        write(out, "label", "d", force=True)


def test_a_link_leads_to_the_folder_and_stays(out: Path, tmp_path: Path) -> None:
    link = tmp_path / "link"
    link.symlink_to(out)
    write(link, "label", "a", text="new")
    assert link.is_symlink()
    assert (out / "a").read_text() == "new"


def test_the_folder_one_stands_in_stays_the_same_folder(
    out: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(out)
    number = out.stat().st_ino
    write(Path(), "label", "a", text="new")
    assert (out.stat().st_ino, Path("a").read_text()) == (number, "new")


def test_a_folder_keeps_its_permissions_and_the_users_files_their_links(out: Path) -> None:
    out.chmod(0o750)
    (out / "link").symlink_to("mine")
    (out / "mine").write_text("mine")
    number = (out / "mine").stat().st_ino
    write(out, "label", "a", text="new")
    assert out.stat().st_mode & 0o777 == 0o750
    assert (out / "link").readlink() == Path("mine")
    assert (out / "mine").stat().st_ino == number


@pytest.mark.parametrize("name", ["../victim", "sub/../../victim", "/victim"])
def test_a_record_from_a_stranger_reaches_no_file_outside(out: Path, name: str) -> None:
    (out.parent / "victim").write_text("mine")
    record = json.loads((out / RECORD_FILE).read_text())
    record["files"][name] = {**record["files"]["a"], "by": "label"}
    (out / RECORD_FILE).write_text(json.dumps(record))
    with pytest.raises(OutputError, match="did not write"):  # the record counts as damaged
        write(out, "label", "a")
    assert (out.parent / "victim").exists()


@pytest.mark.parametrize("removed", ["../victim", "link/victim"])
def test_an_unfinished_swap_from_a_stranger_reaches_no_file_outside(
    out: Path, removed: str
) -> None:
    (out.parent / "victim").write_text("mine")
    (out / "link").symlink_to(out.parent)
    (out / UNFINISHED / "new").mkdir(parents=True)
    (out / UNFINISHED / "removed.json").write_text(json.dumps([removed]))
    refused(OutputError, "points outside the folder", write, out, "label", "a")
    assert (out.parent / "victim").exists()


@pytest.mark.parametrize("removed", ['["a"', "{}", "[1]", '["\\u0000"]', '["\\ud800"]', "[" * 9999])
def test_an_unfinished_swap_that_is_damaged_changes_nothing(out: Path, removed: str) -> None:
    write(out, "label", "a")
    (out / UNFINISHED / "new").mkdir(parents=True)
    (out / UNFINISHED / "new" / "a").write_text("other")
    (out / UNFINISHED / "removed.json").write_text(removed)
    with pytest.raises(
        OutputError, match=r"removed\.json is damaged; remove .* to continue without"
    ):
        write(out, "label", "a")
    assert (out / "a").read_text() != "other"


def test_leftovers_of_killed_runs_go_and_folders_like_them_stay(out: Path) -> None:
    for name in (".out.0123456789ab.tmp", ".out.0123456789ab.old", ".out.mine.tmp"):
        (out.parent / name).mkdir()
    (out.parent / ".other.0123456789ab.tmp").mkdir()
    write(out, "label", "a")
    left = {path.name for path in out.parent.iterdir()}
    assert left == {"out", ".out.mine.tmp", ".other.0123456789ab.tmp"}


def test_a_claimed_folder_is_ours(tmp_path: Path) -> None:
    claim(tmp_path / "out")
    (tmp_path / "out" / "kept").mkdir()
    write(tmp_path / "out", "label", "a")
    claim(tmp_path / "out")
    assert names(tmp_path / "out") == {"a", RECORD_FILE}
    (tmp_path / "mine").mkdir()
    (tmp_path / "mine" / "x").touch()
    refused(OutputError, "such as x", claim, tmp_path / "mine")


@pytest.mark.skipif(os.name != "posix", reason="needs an exchange of folders")
def test_a_file_that_comes_while_links_are_made_stays(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    from pgm_places.io import staging

    out = tmp_path / "out"
    write(out, "label", "a")
    exchange = staging._exchange

    def late(new: Path, target: Path) -> None:
        (target / "late").write_text("mine")
        exchange(new, target)

    monkeypatch.setattr(staging, "_exchange", late)
    write(out, "label", "a", text="new")
    assert (out / "late").read_text() == "mine"
    assert (out / "a").read_text() == "new"


def test_what_is_written_with_a_set_is_flushed_to_disk_once_before_it_stands_there(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    out, flushed = tmp_path / "out", list[int]()

    def note(number: int) -> None:
        assert not out.exists() or os.path.samestat(os.fstat(number), tmp_path.stat())
        flushed.append(os.fstat(number).st_ino)

    monkeypatch.setattr(os, "fsync", note)
    with output_set(out, "label") as files:
        write_text(files.stage / "one", "1")
        with atomic_folder(files.stage / "two") as folder:
            write_text(folder / "three", "3")
        assert flushed == []
    inside = [path.stat().st_ino for path in (out, *out.rglob("*"))]
    assert len(inside) == 5  # with the folders and the record
    assert sorted(flushed) == sorted([*inside, tmp_path.stat().st_ino])


def test_a_new_folder_may_be_claimed_by_many_at_once(tmp_path: Path) -> None:
    n = 4
    barrier = Barrier(n, timeout=60)

    def claims(_: int) -> None:
        for number in range(30):
            barrier.wait()
            try:
                claim(tmp_path / str(number))
            except OutputError:
                barrier.abort()
                raise
            (tmp_path / str(number) / "results").mkdir(exist_ok=True)

    with ThreadPoolExecutor(n) as threads:
        list(threads.map(claims, range(n)))
    for number in range(30):
        assert {path.name for path in (tmp_path / str(number)).iterdir()} == {
            RECORD_FILE,
            "results",
        }


def test_a_folder_that_another_process_is_about_to_claim_is_not_foreign(tmp_path: Path) -> None:
    with stage(tmp_path, RECORD_FILE):
        claim(tmp_path)
    (tmp_path / RECORD_FILE).unlink()
    (tmp_path / "notes.txt").write_text("mine")
    with stage(tmp_path, RECORD_FILE), pytest.raises(OutputError, match=r"such as notes\.txt"):
        claim(tmp_path)
