"""Models whose learned numbers are damaged: refused when read, or in one line when they label."""

import dataclasses
import shutil
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from pgm_places import build, load, save
from pgm_places.errors import InputError, ModelFileError, NotFittedError
from pgm_places.persistence.model_folder import load_folder, save_folder
from tests.persistence.test_stored import STORED, chain


def learned(method: str, folder: Path, **options: Any) -> Path:
    problem = chain()
    assert problem.unary is not None
    backend = build(method, options).fit([problem], [problem.unary.argmax(axis=1)])
    return save(backend, folder / method, label_names=problem.label_names)


def damaged(folder: Path, array: str, at: int, value: float) -> Path:
    """The model with another number in one of its arrays."""
    manifest, arrays = load_folder(folder)
    changed = np.array(arrays[array])
    changed[at] = value
    return save_folder(folder, manifest, {**arrays, array: changed})


def test_bytes_that_are_no_names(tmp_path: Path) -> None:
    folder = damaged(learned("crf", tmp_path), "backend/name_bytes", 2, 0xD4)
    with pytest.raises(ModelFileError, match="does not have the format of this version"):
        load(folder)


@pytest.mark.parametrize("value", [1e30, 1000.0])
def test_a_word_of_the_record_of_learning_that_is_none(value: float, tmp_path: Path) -> None:
    folder = learned("crf", tmp_path)
    place = len(load_folder(folder)[1]["backend/learning"]) - 1
    model = load(damaged(folder, "backend/learning", place, value))
    with pytest.raises(InputError, match="the record's reason must hold -1 to"):
        model.infer(chain())


def test_an_observation_model_that_there_is_not(tmp_path: Path) -> None:
    folder = learned("semi_markov", tmp_path)
    arrays = load_folder(folder)[1]
    for at in range(len(arrays["backend/fitted_observations"])):
        folder = damaged(folder, "backend/fitted_observations", at, 3)
    with pytest.raises(InputError, match=r"fitted_observations must hold 0 to 2"):
        load(folder).infer(chain())


def test_iterations_without_end(tmp_path: Path) -> None:
    shutil.copytree(STORED / "backend_relaxation", tmp_path / "model")
    manifest, arrays = load_folder(tmp_path / "model")
    manifest["learned"] = [*manifest["learned"], "choice"]
    manifest["options"]["max_iterations"] = "auto"
    arrays = {**arrays, "backend/choice": np.array([1e15, 0.0])}
    folder = save_folder(tmp_path / "model", manifest, arrays)
    with pytest.raises(InputError, match="choice must hold 0 to 50"):
        load(folder).infer(chain())


def test_a_hidden_markov_model_without_a_beginning(tmp_path: Path) -> None:
    shutil.copytree(STORED / "backend_hmm", tmp_path / "model")
    manifest, arrays = load_folder(tmp_path / "model")
    manifest["learned"] = [name for name in manifest["learned"] if name != "initial"]
    folder = save_folder(tmp_path / "model", manifest, arrays)
    with pytest.raises(NotFittedError, match="no probabilities of the first label"):
        load(folder).infer(chain())


class TestClassifiers:
    """Those of scikit-learn are asked for one node when they are read."""

    @pytest.fixture
    def folder(self, tmp_path: Path) -> Path:
        shutil.copytree(STORED / "structured_labeler", tmp_path / "model")
        return tmp_path / "model"

    def test_a_label_that_there_is_not(self, folder: Path) -> None:
        spoiled = damaged(folder, "classifier/classes_", 0, 161463326932993)
        with pytest.raises(ModelFileError, match=r"classes_ must hold integers from 0 to 2"):
            load(spoiled)

    @pytest.mark.parametrize("number", ["\0", 0, 10**17, True, None])
    def test_no_number_of_features(self, folder: Path, number: object) -> None:
        manifest, arrays = load_folder(folder)
        manifest["classifier"]["numbers"]["n_features_in_"] = number
        save_folder(folder, manifest, arrays)
        with pytest.raises(ModelFileError, match="n_features_in_ must be 1 to 1000000"):
            load(folder)

    def test_a_problem_with_other_features(self, folder: Path) -> None:
        problem = chain()
        wide = np.ones((problem.graph.n_nodes, 5))
        with pytest.raises(InputError, match=r"trained on 3 features per node.* has 5"):
            load(folder).label(dataclasses.replace(problem, node_features=wide))
