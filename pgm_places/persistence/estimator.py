"""Fitted scikit-learn estimators as plain data: those whose state is numbers, and pipelines.

scikit-learn itself stores estimators by pickle, which runs code of the file's choosing. Here a
class is known by name, its parameters are JSON, and what it has learned are arrays and numbers.

skops stores more classes, but what it loads is chosen by type names in the file against a list of
trusted ones, its archive would stand beside the manifest that says what a model is, and these few
classes would still have to be read from the models that earlier versions saved.
"""

import importlib
import inspect
from collections.abc import Mapping
from typing import Any

import numpy as np

from pgm_places.errors import ModelFileError, OutputError
from pgm_places.models.decision_list import DecisionListClassifier
from pgm_places.persistence.model_folder import Arrays, below, put_below

ESTIMATORS: Mapping[str, str] = {
    "DecisionListClassifier": "pgm_places.models.decision_list",
    "GaussianNB": "sklearn.naive_bayes",
    "LinearDiscriminantAnalysis": "sklearn.discriminant_analysis",
    "LogisticRegression": "sklearn.linear_model",
    "MinMaxScaler": "sklearn.preprocessing",
    "Pipeline": "sklearn.pipeline",
    "StandardScaler": "sklearn.preprocessing",
}
"""What can be stored: class to module."""

Record = dict[str, object]

_PLAIN = (bool, int, float, str, type(None))


def dump_estimator(arrays: Arrays, prefix: str, estimator: Any) -> Record:
    """A fitted estimator as plain data; its arrays go into ``arrays`` under the prefix.

    Raises
    ------
    OutputError
        Its class is none of ``ESTIMATORS``, or a parameter is not a plain value.
    """
    name = type(estimator).__name__
    if ESTIMATORS.get(name) is None or type(estimator) is not _class(name):
        raise OutputError(
            f"{name} cannot be saved: its state is not plain numbers. What can be: "
            f"{', '.join(sorted(ESTIMATORS))}. For another classifier, save what it says: make "
            "problems with LabelingProblem.from_probabilities, and give StructuredLabeler no "
            "classifier"
        )
    if name == "Pipeline":
        steps = [
            [label, dump_estimator(arrays, f"{prefix}/{label}", step)]
            for label, step in estimator.steps
        ]
        return {"class": name, "steps": steps}
    params = {key: _plain(name, key, value) for key, value in _changed_params(estimator).items()}
    record: Record = {"class": name, "params": params}
    if isinstance(estimator, DecisionListClassifier):
        meta, parts = estimator.to_arrays()
        put_below(arrays, prefix, parts)
        return {**record, "list": meta}
    return {**record, **_dump_state(arrays, prefix, estimator)}


def load_estimator(arrays: Arrays, prefix: str, record: Mapping[str, Any]) -> Any:
    """The fitted estimator that :func:`dump_estimator` described.

    Raises
    ------
    ModelFileError
        The record names another class, or does not fit this version's.
    """
    if record["class"] == "Pipeline":
        steps = [
            (label, load_estimator(arrays, f"{prefix}/{label}", part))
            for label, part in record["steps"]
        ]
        return _class("Pipeline")(steps)
    estimator = unfitted_estimator(record)
    own = below(arrays, prefix)
    if isinstance(estimator, DecisionListClassifier):
        fitted = DecisionListClassifier.from_arrays(record["list"], own)
        return fitted.set_params(**record["params"])
    learned = {**{key: own[key] for key in record["arrays"]}, **record["numbers"]}
    for key, value in learned.items():
        if not key.endswith("_") or key.startswith("_"):
            raise ModelFileError(f"{type(estimator).__name__} learns no {key!r}")
        setattr(estimator, key, np.asarray(value) if isinstance(value, list) else value)
    return estimator


def unfitted_estimator(record: Mapping[str, Any]) -> Any:
    """The estimator of a record before it was fitted.

    Raises
    ------
    ModelFileError
        The record names another class or parameter than this version knows.
    """
    name = record["class"]
    if name not in ESTIMATORS:
        raise ModelFileError(f"a classifier {name!r} cannot be loaded; known: {list(ESTIMATORS)}")
    if name == "Pipeline":
        return _class(name)([(label, unfitted_estimator(part)) for label, part in record["steps"]])
    try:
        return _class(name)(**record["params"])
    except TypeError as error:
        raise ModelFileError(
            f"the installed scikit-learn's {name} does not take the stored parameters ({error}); "
            "install the version that the model was saved with, or fit again"
        ) from None


def _class(name: str) -> Any:
    return getattr(importlib.import_module(ESTIMATORS[name]), name)


def _changed_params(estimator: Any) -> dict[str, Any]:
    """The parameters that are not at their defaults, which differ between versions."""
    defaults = inspect.signature(type(estimator)).parameters
    return {
        key: value
        for key, value in estimator.get_params(deep=False).items()
        if value is not defaults[key].default and not np.array_equal(value, defaults[key].default)
    }


def _plain(name: str, key: str, value: Any) -> Any:
    if isinstance(value, np.ndarray | np.generic):
        value = value.tolist()
    parts = value if isinstance(value, list | tuple) else [value]
    if not all(isinstance(part, _PLAIN) for part in parts):
        raise OutputError(
            f"{name} cannot be saved: its parameter {key} is a {type(value).__name__}; use "
            "numbers, strings or lists of them"
        )
    return list(value) if isinstance(value, tuple) else value


def _dump_state(arrays: Arrays, prefix: str, estimator: object) -> Record:
    """The attributes that fitting set, which scikit-learn names with a trailing underscore."""
    names, numbers = [], {}
    for key, value in vars(estimator).items():
        if not key.endswith("_") or key.startswith("_"):
            continue
        if isinstance(value, np.ndarray) and value.dtype.kind in "biuf":
            arrays[f"{prefix}/{key}"] = value
            names.append(key)
        else:
            numbers[key] = _plain(type(estimator).__name__, key, value)
    if not names:
        raise OutputError(f"{type(estimator).__name__} cannot be saved before it is fitted")
    return {"arrays": names, "numbers": numbers}
