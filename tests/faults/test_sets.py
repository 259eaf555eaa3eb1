"""A set of files survives kills, full disks and other writers as the old one or the new one."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from pgm_places.errors import OutputError
from pgm_places.io.output_set import output_set
from tests.faults.sets import content, whole, write_set
from tests.faults.steps import fill_disk, leftovers, step

ROOT = Path(__file__).parents[2]
ROUNDS = 20 if os.environ.get("PGM_PLACES_KILLS") else 6
posix = pytest.mark.skipif(os.name != "posix", reason="needs fork and signals")


def run_module(name: str, *arguments: object) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, "-m", f"tests.faults.{name}", *map(str, arguments)]
    return subprocess.run(command, cwd=ROOT, check=False, capture_output=True, text=True)


@posix
@pytest.mark.parametrize("mode", ["absent", "exchanged", "current", "shared"])
def test_a_kill_at_any_step_leaves_the_old_set_or_the_new_one(tmp_path: Path, mode: str) -> None:
    done = run_module("killed_sets", tmp_path, mode)
    assert done.returncode == 0, done.stderr
    assert int(done.stdout) > 3  # of steps; 'make faults' takes every one


@posix
def test_a_kill_while_a_folder_is_claimed_does_not_bar_it(tmp_path: Path) -> None:
    done = run_module("killed_sets", tmp_path, "claimed")
    assert done.returncode == 0, done.stderr
    assert int(done.stdout) > 3


@pytest.mark.parametrize("shared", [False, True])
def test_a_disk_that_is_full_at_any_step_leaves_the_old_set_or_the_new_one(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, shared: bool
) -> None:
    monkeypatch.setattr(os, "fsync", lambda number: None)  # no power fails here, and it is slow
    target = tmp_path / "out"
    number, n_steps, n_errors = 0, 1, 0
    while number < n_steps:
        number += 1
        shutil.rmtree(target, ignore_errors=True)
        write_set(target, "old", shared=shared)
        (target / "mine.txt").write_text("mine")
        errors = []
        with step(number, fill_disk) as steps:
            try:
                write_set(target, "new", shared=shared)
            except OutputError as error:
                errors.append(str(error))
            n_steps = max(n_steps, steps.count)
        if errors:
            assert "No space left on device" in errors[0]
        left = whole(target, "mine.txt")
        assert left == ("old" if errors else "new") or shared
        n_errors += len(errors)
    assert n_errors > 10
    write_set(target, "new", shared=shared)
    assert not leftovers(target)


@posix
def test_a_small_disk_that_really_fills(tmp_path: Path) -> None:
    code = (
        "import sys; from pathlib import Path; from pgm_places.errors import OutputError\n"
        "from pgm_places.io.atomic import write_bytes\n"
        "from pgm_places.io.output_set import output_set\n"
        "from tests.faults.sets import whole, write_set\n"
        "folder = Path(sys.argv[1]) / 'out'\n"
        "write_set(folder, 'old')\n"
        "try:\n"
        "    with output_set(folder, 'test') as files:\n"
        "        for number in range(64):\n"
        "            write_bytes(files.stage / f'{number}.txt', bytes(8192))\n"
        "except OutputError as error:\n"
        "    assert 'No space left on device' in str(error), error\n"
        "    assert str(files.stage) not in str(error), error\n"
        "    print(whole(folder))\n"
    )
    mount = f'mount -t tmpfs -o size=128k tmpfs "{tmp_path}" && exec "$0" -c "$1" "{tmp_path}"'
    command = ["unshare", "--map-root-user", "--mount", "sh", "-c", mount, sys.executable, code]
    if shutil.which("unshare") is None:
        pytest.skip("there is no unshare, which mounts a small disk")
    done = subprocess.run(command, cwd=ROOT, check=False, capture_output=True, text=True)
    if "mount:" in done.stderr or "unshare:" in done.stderr:
        pytest.skip(f"a small disk cannot be mounted here: {done.stderr.strip()}")
    assert (done.stdout, done.stderr) == ("old\n", "")


@posix
@pytest.mark.parametrize("shared", ["", "shared"])
def test_writers_at_once_do_not_mix(tmp_path: Path, shared: str) -> None:
    target = tmp_path / "out"
    code = (
        "import sys; from pathlib import Path; from tests.faults.sets import write_set\n"
        f"for _ in range({ROUNDS}):\n"
        "    write_set(Path(sys.argv[1]), sys.argv[2], shared=bool(sys.argv[3]))\n"
    )
    writers = [
        subprocess.Popen(
            [sys.executable, "-c", code, str(target), name, shared],
            cwd=ROOT,
            stderr=subprocess.PIPE,
            text=True,
        )
        for name in ("old", "new", "old")
    ]
    errors = [writer.communicate()[1] for writer in writers]
    assert errors == ["", "", ""]
    assert whole(target) in ("old", "new")
    assert not leftovers(target)


def test_an_error_in_the_middle_changes_nothing(tmp_path: Path) -> None:
    write_set(tmp_path / "out", "old")
    with pytest.raises(KeyboardInterrupt), output_set(tmp_path / "out", "test") as files:
        (files.stage / "a.txt").write_text("half")
        raise KeyboardInterrupt
    assert whole(tmp_path / "out") == "old"
    with pytest.raises(ZeroDivisionError), output_set(tmp_path / "a" / "b", "test"):
        raise ZeroDivisionError
    assert not (tmp_path / "a").exists()


def test_folders_of_runs_that_are_still_busy_are_not_taken_for_leftovers(tmp_path: Path) -> None:
    with output_set(tmp_path / "out", "test") as slow:
        (slow.stage / "a.txt").write_text("new")
        (slow.stage / "b.txt").write_text("new")
        (slow.stage / "bag").mkdir()
        (slow.stage / "bag" / "one").write_text("new")
        write_set(tmp_path / "out", "old")
        assert whole(tmp_path / "out") == "old"
    assert whole(tmp_path / "out") == "new"
    assert content(tmp_path / "out").keys() == {"a.txt", "b.txt", "bag/one"}
