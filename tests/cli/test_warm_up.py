"""Warm-up: what is started, when, and that every stage runs through."""

import subprocess
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import pytest

from pgm_places.cli import warm_up as module
from pgm_places.kernels import shipped_code


class Helper:
    """Stands in for the second process; what is written to one that has ended is lost."""

    asked: list[list[str]]

    def __init__(self, command: Sequence[str], **_: Any) -> None:
        assert command is module.COMMAND
        self.asked.append([])
        self.stdin = self
        self.closed = self.ended = False

    def write(self, text: str) -> None:
        if self.ended:
            raise BrokenPipeError
        self.asked[-1] += text.splitlines()

    def flush(self) -> None:
        pass

    def close(self) -> None:
        self.closed = True

    def terminate(self) -> None:
        self.ended = True

    def wait(self) -> None:
        assert self.ended


@pytest.fixture
def asked(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> list[list[str]]:
    """What each second process is to compile, with an empty cache."""
    Helper.asked = []
    monkeypatch.setattr(subprocess, "Popen", Helper)
    monkeypatch.setenv("PGM_PLACES_CACHE_DIR", str(tmp_path))
    monkeypatch.delenv("NUMBA_DISABLE_JIT", raising=False)
    return Helper.asked


def test_known_stages_are_compiled_once(
    asked: list[list[str]], monkeypatch: pytest.MonkeyPatch
) -> None:
    with module.WarmUp(["topology", "their-own", "amn"], n_threads=2):
        assert asked == [["topology", "amn"]]
    monkeypatch.setitem(module.STAGES, "topology", lambda: None)
    module.main(["topology\n"])
    with module.WarmUp(["topology", "amn"], n_threads=2):
        assert asked[1:] == [["amn"]]


def test_stages_that_become_known_later_go_to_the_same_process(asked: list[list[str]]) -> None:
    with module.WarmUp(n_threads=2) as warm_up:
        assert not asked
        warm_up.compile(["features"])
        warm_up.compile(["potts", "topology"])
        assert asked == [["features", "potts", "topology"]]
    warm_up.compile(["amn"])  # nobody is there to hear it
    assert asked == [["features", "potts", "topology"]]


def test_nothing_is_started_for_one_thread(asked: list[list[str]]) -> None:
    with module.WarmUp(["topology"], n_threads=1):
        pass
    assert not asked


@pytest.mark.parametrize("without", ["NUMBA_DISABLE_JIT", "PGM_PLACES_CACHE_DIR"])
def test_nothing_is_started_without_compiler_or_cache(
    asked: list[list[str]], tmp_path: Path, monkeypatch: pytest.MonkeyPatch, without: str
) -> None:
    (tmp_path / "file").write_text("")
    value = "1" if without == "NUMBA_DISABLE_JIT" else str(tmp_path / "file" / "below")
    monkeypatch.setenv(without, value)
    with module.WarmUp(["topology"], n_threads=2):
        pass
    assert not asked


def test_nothing_is_started_where_a_wheel_brought_machine_code(
    asked: list[list[str]], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(shipped_code, "shipped_folder", lambda: tmp_path)
    with module.WarmUp(["topology"], n_threads=2):
        pass
    assert not asked


@pytest.mark.parametrize("name", list(module.STAGES))
def test_a_stage_runs_through(name: str) -> None:
    module.STAGES[name]()


def test_a_second_process_compiles_what_it_is_told(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("PGM_PLACES_CACHE_DIR", str(tmp_path))
    monkeypatch.delenv("NUMBA_DISABLE_JIT", raising=False)
    subprocess.run(module.COMMAND, input="potts\n", text=True, check=True)
    assert [path.name.partition("-")[0] for path in tmp_path.rglob("potts-*")] == ["potts"]
