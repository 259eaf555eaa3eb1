"""The process around the commands: signals, full disks, the current folder, hostile names."""

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from pgm_places.cli import app, entry
from pgm_places.cli.terminal import complain, say
from tests.cli.conftest import Run

ROOT = Path(__file__).parents[2]
COMMAND = [sys.executable, "-P", "-m", "pgm_places"]
needs_posix = pytest.mark.skipif(os.name != "posix", reason="signals and devices of POSIX")


def environment(**changes: str) -> dict[str, str]:
    return {**os.environ, "PYTHONPATH": str(ROOT), **changes}


def test_nothing_in_a_message_reaches_the_terminal(capsys: pytest.CaptureFixture[str]) -> None:
    say("room\x1b[2J\nnext \u202e line é")
    complain("two\nlines \x07" + "x" * 5000)
    found = capsys.readouterr()
    assert found.out == "room\\x1b[2J\nnext \\u202e line é\n"
    assert found.err.startswith("two\\nlines \\x07xx")
    assert len(found.err) == 2000 + len(" ...\n")


@needs_posix
@pytest.mark.parametrize("arguments", [["--version"], ["--help"], ["doctor"]])
def test_a_full_standard_output_is_one_line(arguments: list[str]) -> None:
    with Path("/dev/full").open("w") as full:
        ended = subprocess.run(
            [*COMMAND, *arguments],
            stdout=full,
            stderr=subprocess.PIPE,
            text=True,
            env=environment(),
            check=False,
        )
    assert ended.returncode == 2
    assert ended.stderr.count("\n") == 1
    assert "No space left on device" in ended.stderr


@pytest.mark.parametrize(
    ("problem", "code", "message"),
    [
        (BrokenPipeError, 128 + 13, ""),
        (MemoryError, 4, "out of memory; use a coarser resolution_m or a smaller window\n"),
    ],
)
def test_a_pipe_that_nobody_reads_and_too_little_memory(
    problem: type[BaseException],
    code: int,
    message: str,
    run: Run,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    def fail(_: object) -> None:
        raise problem

    monkeypatch.setattr(app, "run", fail)
    found, _, error = run("where", "out", 0, 0)
    assert (found, error) == (code, message and f"pgm-places: {message}")
    codes = (entry.EXIT_NOT_FOUND, entry.EXIT_OUT_OF_MEMORY, entry.EXIT_UNREAD)
    assert codes == (1, 4, 141)


def closed(streams: str, *arguments: object) -> subprocess.CompletedProcess[str]:
    """A command without some of its streams, such as ``>&- 2>&-``."""
    return subprocess.run(
        ["sh", "-c", f'"$@" {streams}', "sh", *COMMAND, *map(str, arguments)],
        capture_output=True,
        text=True,
        env=environment(),
        check=False,
    )


@needs_posix
@pytest.mark.parametrize("streams", [">&-", "2>&-", "<&- >&- 2>&-"])
@pytest.mark.parametrize(
    ("arguments", "code"), [(["--version"], 0), (["--help"], 0), (["where", "none", "0", "0"], 2)]
)
def test_closed_streams_are_as_good_as_unread(
    streams: str, arguments: list[str], code: int
) -> None:
    ended = closed(streams, *arguments)
    assert ended.returncode == code
    assert bool(ended.stdout) == (streams == "2>&-" and code == 0)
    assert ended.stderr.count("\n") == (streams == ">&-" and code == 2)


@needs_posix
def test_without_streams_files_are_written_as_with_them(building: Path) -> None:
    written = []
    for number, streams in enumerate(("", "<&- >&- 2>&-")):
        out = building / f"out{number}"
        arguments = ("topology", building / "labels.png", building / "map.yaml", "-o", out)
        assert closed(streams, *arguments).returncode == 0
        files = (path for path in out.rglob("*") if path.is_file())
        written.append({path.relative_to(out): path.read_bytes() for path in files})
    assert written[0] == written[1]


def test_no_file_of_the_current_folder_is_imported(tmp_path: Path) -> None:
    for name in ("numpy", "yaml"):
        (tmp_path / f"{name}.py").write_text("raise SystemExit('a stranger ran')")
    ended = subprocess.run(
        [*COMMAND[:1], "-m", "pgm_places", "--help"],
        cwd=tmp_path,
        capture_output=True,
        text=True,
        env=environment(),
        check=False,
    )
    assert (ended.returncode, ended.stderr) == (0, "")


WORKERS = """
from pgm_places.batch.local_workers import LocalWorkers
assert [result for _, result in LocalWorkers(1).run(abs, [-3])] == [3]
"""
MAP_PROCESS = """
import time
from pgm_places.live.map_process import MapProcess
desk = MapProcess("none")
desk.submit(b"")
while (answer := desk.answer()) is None:
    time.sleep(0.01)
desk.close()
assert "none" in answer
"""


@pytest.mark.parametrize(
    "command",
    [
        pytest.param([*COMMAND, "--help"], id="command"),
        pytest.param([sys.executable, "-P", "-c", WORKERS], id="workers"),
        pytest.param([sys.executable, "-P", "-c", MAP_PROCESS], id="live"),
    ],
)
def test_no_process_takes_a_module_of_the_current_folder_for_a_library(
    command: list[str], tmp_path: Path
) -> None:
    ran = tmp_path / "ran"
    poison = f"open({str(ran)!r}, 'a').write(__name__)\nraise SystemExit(1)"
    for name in {*sys.stdlib_module_names, "joblib", "numpy", "yaml"}:
        (tmp_path / f"{name}.py").write_text(poison)
    ended = subprocess.run(
        command,
        cwd=tmp_path,
        input="",
        capture_output=True,
        text=True,
        env=environment(),
        check=False,
    )
    assert not ran.exists(), ran.read_text()
    assert (ended.returncode, ended.stderr) == (0, "")


@needs_posix
@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_an_interrupt_of_the_imports_ends_in_good_order(
    number: signal.Signals, tmp_path: Path
) -> None:
    (tmp_path / "numpy.py").write_text(
        "print('importing', flush=True)\nimport time\ntime.sleep(60)"
    )
    process = subprocess.Popen(
        [*COMMAND, "where", ".", "0", "0"],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        env=environment(PYTHONPATH=f"{tmp_path}:{ROOT}"),
    )
    assert process.stdout is not None
    assert process.stdout.readline() == "importing\n"
    process.send_signal(number)
    _, error = process.communicate()
    assert process.returncode == 128 + number
    assert error == "pgm-places: interrupted; no file is left half-written\n"


@needs_posix
@pytest.mark.parametrize("name", ["SIGTERM", "SIGHUP"])
def test_a_signal_to_end_is_an_interrupt(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    def unheard(*_: object) -> None:
        raise AssertionError("the command did not hear it")

    number = getattr(signal, name)
    before = signal.signal(number, unheard)  # nohup may have it ignored
    cleaned = []

    def run() -> None:
        try:
            signal.raise_signal(number)
        finally:
            cleaned.append(True)

    monkeypatch.setattr(entry, "_run", run)
    try:
        with pytest.raises(SystemExit) as ended:
            entry.main()
        assert (ended.value.code, cleaned) == (128 + number, [True])
        assert signal.getsignal(number) == unheard
    finally:
        signal.signal(number, before)


@pytest.mark.parametrize("state", ["missing", "stale"])
def test_kernels_that_are_missing_or_old_are_one_line(state: str) -> None:
    # Either no module of that name can be imported, or it lacks what the sources ask for.
    module = "None" if state == "missing" else "types.ModuleType('pgm_places._core')"
    code = (
        "import sys, types\n"
        f"sys.modules['pgm_places._core'] = {module}\n"
        "def run(): import pgm_places.solvers.adjacency\n"
        "from pgm_places.cli import entry\n"
        "entry._run = run\n"
        "entry.main()\n"
    )
    done = subprocess.run([sys.executable, "-c", code], check=False, capture_output=True, text=True)
    assert done.returncode == entry.EXIT_BAD_INPUT
    assert done.stderr.startswith("pgm-places: the compiled kernels are missing, or older")
    assert len(done.stderr.splitlines()) == 1


@needs_posix
def test_the_second_process_ends_with_the_first() -> None:
    helper = (
        "import time\n"
        "from pgm_places.batch.limits import end_with_parent\n"
        "end_with_parent()\n"
        "print('watching', flush=True)\n"
        "time.sleep(60)\n"
    )
    parent = subprocess.Popen(
        [
            sys.executable,
            "-c",
            "import subprocess, sys\n"
            f"helper = subprocess.Popen([sys.executable, '-c', {helper!r}])\n"
            "print(helper.pid, flush=True)\n"
            "helper.wait()\n",
        ],
        stdout=subprocess.PIPE,
        text=True,
        env=environment(),
    )
    assert parent.stdout is not None
    number = int(parent.stdout.readline())
    assert parent.stdout.readline() == "watching\n"
    parent.kill()
    parent.wait()
    deadline = time.monotonic() + 30
    while is_running(number) and time.monotonic() < deadline:
        time.sleep(0.1)
    assert not is_running(number)
    parent.stdout.close()


def is_running(number: int) -> bool:
    """Whether there is such a process, and not only its remains that nobody has fetched."""
    try:
        return Path(f"/proc/{number}/stat").read_text().rpartition(")")[2].split()[0] != "Z"
    except FileNotFoundError:
        return False


def test_too_many_threads_are_refused_before_the_work(building: Path, run: Run) -> None:
    code, _, error = run("label", building / "map.yaml", "-o", "out", "--threads", "100000", "-q")
    assert code == 2
    *before, refused = error.splitlines()
    assert refused == "pgm-places: the number of threads must be from 1 to 1024, got 100000"
    assert all(line.startswith("warning: resampled from 0.1 m") for line in before)


def test_hostile_names_of_labels_are_refused_in_one_line(building: Path, run: Run) -> None:
    names = (building / "labels.yaml").read_text()
    (building / "labels.yaml").write_text(names.replace('"room"', '"\\e[2Jroom"'))
    arguments = ("topology", building / "labels.png", building / "map.yaml", "-o", building / "out")
    code, _, error = run(*arguments, "-q")
    assert code == 2
    assert "must not hold control characters, got '\\x1b[2Jroom'" in error
    assert "\x1b" not in error


def test_the_end_of_a_process_is_not_spent_on_garbage() -> None:
    code = (
        "import atexit, gc, sys\n"
        "atexit.register(lambda: print(gc.get_freeze_count() > 10_000))\n"
        "sys.argv = ['pgm-places', '--version']\n"
        "from pgm_places.cli.entry import main\n"
        "main()"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.endswith("True\n")
