"""Compiling ahead: what is started, when, and that every rehearsal goes through."""

import subprocess
from pathlib import Path
from typing import Any

import pytest

from pgm_places.cli import ahead
from pgm_places.trained import model_folder


class Helper:
    """Stands in for the second process."""

    started: list[list[str]]

    def __init__(self, command: list[str], **_: Any) -> None:
        self.started.append(command[3:])
        self.ended: list[str] = []

    def terminate(self) -> None:
        self.ended.append("terminate")

    def wait(self) -> None:
        self.ended.append("wait")


@pytest.fixture
def started(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> list[list[str]]:
    """What would be compiled in other processes, with an empty cache."""
    Helper.started = []
    monkeypatch.setattr(subprocess, "Popen", Helper)
    monkeypatch.setenv("PGM_PLACES_CACHE_DIR", str(tmp_path))
    monkeypatch.delenv("NUMBA_DISABLE_JIT", raising=False)
    return Helper.started


def test_known_stages_are_compiled_once(
    started: list[list[str]], monkeypatch: pytest.MonkeyPatch
) -> None:
    with ahead.compiled_ahead(["topology", "their-own", "amn"], n_threads=2):
        assert started == [["topology", "amn"]]
    monkeypatch.setitem(ahead.REHEARSALS, "topology", lambda: None)
    ahead.main(["topology"])
    with ahead.compiled_ahead(["topology", "amn"], n_threads=2):
        assert started[1:] == [["amn"]]


def test_nothing_is_started_for_one_thread(started: list[list[str]]) -> None:
    with ahead.compiled_ahead(["topology"], n_threads=1):
        pass
    assert not started


@pytest.mark.parametrize("without", ["NUMBA_DISABLE_JIT", "PGM_PLACES_CACHE_DIR"])
def test_nothing_is_started_without_compiler_or_cache(
    started: list[list[str]], tmp_path: Path, monkeypatch: pytest.MonkeyPatch, without: str
) -> None:
    (tmp_path / "file").write_text("")
    value = "1" if without == "NUMBA_DISABLE_JIT" else str(tmp_path / "file" / "below")
    monkeypatch.setenv(without, value)
    with ahead.compiled_ahead(["topology"], n_threads=2):
        pass
    assert not started


@pytest.mark.parametrize("name", list(ahead.REHEARSALS))
def test_a_rehearsal_goes_through(name: str) -> None:
    ahead.REHEARSALS[name]()


def test_a_stored_model_tells_its_methods_without_being_loaded(tmp_path: Path) -> None:
    folder = model_folder("default")
    assert ahead.stage_of_model(folder, None) == "potts"
    assert ahead.stage_of_model(folder, "adaboost") == "independent"
    assert ahead.stage_of_model(folder, "no such method") == ""
    assert ahead.stage_of_model(tmp_path, None) == ""
    (tmp_path / "manifest.json").write_text('{"content": {"methods": []}}')
    assert ahead.stage_of_model(tmp_path, None) == ""
