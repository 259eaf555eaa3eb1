"""Saved backends come back the same, and only registered ones are saved or loaded."""

from dataclasses import dataclass
from importlib.metadata import EntryPoint
from pathlib import Path

import numpy as np
import pytest

from pgm_places import LabelGraph, Labeling, LabelingProblem, Status, build, load, save
from pgm_places.errors import ModelFileError, OutputError
from pgm_places.inference.backends import BACKENDS, METHODS, Learnable, backend_names
from pgm_places.persistence.model_folder import load_folder, save_folder
from pgm_places.persistence.stored import read

NAMES = ("room", "corridor")
TRUTH = np.array([0, 0, 0, 1, 1, 1])


@pytest.fixture
def problem() -> LabelingProblem:
    p = np.array([0.8, 0.4, 0.8, 0.2, 0.4, 0.1])
    return LabelingProblem.from_probabilities(
        LabelGraph.from_lattice((6,)), NAMES, np.stack([p, 1 - p], axis=1)
    )


@pytest.mark.parametrize("name", list(BACKENDS))
def test_a_saved_backend_labels_as_before(
    name: str, problem: LabelingProblem, tmp_path: Path
) -> None:
    backend = build(name)
    if isinstance(backend, Learnable):
        backend = backend.fit([problem], [TRUTH])
    save(backend, tmp_path / "model", label_names=NAMES)
    assert read(tmp_path / "model", "backend").label_names == NAMES
    again = load(tmp_path / "model")
    assert type(again) is type(backend)
    assert again.infer(problem).labels.tolist() == backend.infer(problem).labels.tolist()


@dataclass(frozen=True)
class Unregistered:
    """A backend that no entry point names."""

    def infer(self, problem: LabelingProblem) -> Labeling:
        return Labeling(np.zeros(problem.graph.n_nodes, np.int64), Status.CONVERGED)


def test_an_unregistered_backend_is_not_saved(tmp_path: Path) -> None:
    with pytest.raises(OutputError, match=r"Unregistered cannot be saved.*\.inference\.backends"):
        save(Unregistered(), tmp_path / "model")
    assert not (tmp_path / "model").exists()


def test_a_plugin_is_found_by_its_entry_point_saved_and_loaded(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    point = EntryPoint("mine", f"{__name__}:Unregistered", METHODS.group)
    monkeypatch.setattr("importlib.metadata.entry_points", lambda group: [point])
    assert "mine" in backend_names()
    save(build("mine"), tmp_path / "model")
    assert load(tmp_path / "model") == Unregistered()


def test_a_built_in_method_is_found_without_reading_the_entry_points(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """They are read from every installed distribution, which takes most of loading a model."""

    def refuse(group: str) -> list[EntryPoint]:
        raise AssertionError(f"entry points of {group} were read")

    monkeypatch.setattr("importlib.metadata.entry_points", refuse)
    save(build("potts", {"weight": 0.5}), tmp_path / "model")
    assert load(tmp_path / "model") == build("potts", {"weight": 0.5})


@pytest.mark.parametrize(
    ("key", "value", "message"),
    [
        ("kind", "cake", "holds a 'cake' model"),
        ("backend", "os:system", "no method 'os:system' is installed"),
        ("options", {"weight": "much"}, "weight must be a finite number or 'auto', got 'much'"),
        ("learned", 3, "manifest"),
    ],
)
def test_a_spoiled_folder_is_refused(key: str, value: object, message: str, tmp_path: Path) -> None:
    save(build("potts"), tmp_path / "model", label_names=NAMES)
    manifest, arrays = load_folder(tmp_path / "model")
    save_folder(tmp_path / "spoiled", {**manifest, key: value}, arrays)
    with pytest.raises(ModelFileError, match=message):
        load(tmp_path / "spoiled")
