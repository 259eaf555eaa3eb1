"""A fitted StructuredLabeler as a folder: manifest.json and arrays.safetensors, data only."""

import dataclasses
from pathlib import Path
from typing import Any

from pgm_places.errors import ConfigError, ModelFileError, NotFittedError
from pgm_places.labelers.structured_labeler import StructuredLabeler
from pgm_places.persistence.backend import Arrays, get_backend, put_backend
from pgm_places.persistence.estimator import get_estimator, put_estimator, unfitted
from pgm_places.persistence.model_folder import load_folder, save_folder

__all__ = ["load_structured_labeler", "save_structured_labeler"]

KIND = "structured-labeler"

OPTIONS = ("learn_on", "n_folds", "min_probability", "metric")


def save_structured_labeler(folder: Path | str, labeler: StructuredLabeler) -> Path:
    """The folder with a fitted labeler in it: its classifier and its backend; no pickle.

    Parameters
    ----------
    folder : Path
        Absent, empty, or a model, which is then replaced.
    labeler : StructuredLabeler
        Fitted. Its classifier is None or one whose state is plain numbers: see
        :data:`pgm_places.persistence.estimator.ESTIMATORS`.

    Raises
    ------
    NotFittedError
        It has not learned.
    OutputError
        The classifier cannot be stored, the backend's class is not registered, or the folder cannot
        be written.
    """
    if not hasattr(labeler, "backend_"):
        raise NotFittedError("only a fitted StructuredLabeler can be saved; call fit(X, y) first")
    arrays: Arrays = {}
    classifier = None
    if labeler.classifier is not None:
        classifier = put_estimator(arrays, "classifier", labeler.classifier_)
    manifest = {
        "kind": KIND,
        "label_names": list(labeler.label_names_),
        "options": {name: getattr(labeler, name) for name in OPTIONS},
        "classifier": classifier,
        "backend": put_backend(arrays, "backend", labeler.backend_),
    }
    return save_folder(folder, manifest, arrays)


def load_structured_labeler(folder: Path | str) -> StructuredLabeler:
    """The fitted labeler in a folder.

    Raises
    ------
    ModelFileError
        The folder is missing, damaged, of another kind, its backend is not installed, or another
        version of scikit-learn wrote it.
    """
    manifest, arrays = load_folder(folder)
    if manifest.get("kind") != KIND:
        raise ModelFileError(
            f"{folder} holds a {manifest.get('kind')!r} model; a {KIND!r} is wanted"
        )
    try:
        return _labeler(manifest, arrays)
    except ModelFileError as error:
        raise ModelFileError(f"{folder}: {error}") from None
    except ConfigError as error:
        raise ModelFileError(f"{folder}/manifest.json: {error}") from None
    except (KeyError, TypeError, ValueError, AttributeError) as error:
        raise ModelFileError(
            f"{folder}/manifest.json is not what this version writes ({error!r}); save it again"
        ) from None


def _labeler(manifest: dict[str, Any], arrays: Arrays) -> StructuredLabeler:
    backend = get_backend(arrays, "backend", manifest["backend"], where="backend")
    # Without what was learned: the options to search over, or to fit again with.
    learned = [item.name for item in dataclasses.fields(backend) if item.metadata.get("learned")]
    before = dataclasses.replace(backend, **dict.fromkeys(learned))
    record = manifest["classifier"]
    options = {name: manifest["options"][name] for name in OPTIONS}
    labeler = StructuredLabeler(before, None if record is None else unfitted(record), **options)
    labeler.check_options()
    labeler.label_names_ = tuple(str(name) for name in manifest["label_names"])
    labeler.backend_ = backend
    if record is not None:
        labeler.classifier_ = get_estimator(arrays, "classifier", record)
    return labeler
