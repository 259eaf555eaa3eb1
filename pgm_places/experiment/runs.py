"""Running an experiment: select options, train, label, evaluate."""

import importlib.metadata
import platform
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

from pgm_places._version import __version__
from pgm_places.errors import ConfigError
from pgm_places.evaluation.evaluation import Evaluation, evaluate
from pgm_places.experiment import comparison
from pgm_places.experiment.comparison import Comparison, MethodResult
from pgm_places.experiment.config_changes import changed_config
from pgm_places.experiment.evaluated_items import TestItem
from pgm_places.experiment.experiment import Experiment
from pgm_places.experiment.selection import select, selected_words
from pgm_places.experiment.setup import AnyMethod, resolved_config
from pgm_places.experiment.sources import Source, Sources, load_sources
from pgm_places.experiment.splits import warn_of_overlap
from pgm_places.experiment.tasks import Task, Trained, label_tests, learned, task_of, tests_of
from pgm_places.inference.labeling import Labeling
from pgm_places.labelers.labeler import learned_with
from pgm_places.options import option_values

REPORTED_PACKAGES = ("numpy", "scipy", "scikit-learn", "cvxpy", "osqp", "networkx")


def train(experiment: Experiment, *, to_save: bool = False) -> Trained:
    """Fit the methods of the configuration, or train its base model further.

    With a table ``[select]``, options are first chosen on the training data: the returned
    experiment has the chosen configuration, and its ``selection`` records the candidates. With
    ``to_save``, a model that cannot be saved is an error before training.
    """
    task = task_of(experiment.config)
    if to_save:
        task.check_savable()
    return _trained(task, experiment, load_sources(experiment, "train"))


def _trained(task: Task, experiment: Experiment, sources: Sources) -> Trained:
    if experiment.config.select is not None:
        with experiment.timed("select"):
            selection = select(experiment, sources)
        config = changed_config(experiment.config, selection.chosen.options)
        experiment = replace(experiment, config=config, selection=selection.to_dict())
        task = task_of(config)
    return learned(task, experiment, sources)


def compare(experiment: Experiment) -> Comparison:
    """Train all methods of the configuration and evaluate them on its test data.

    ConfigError if there are no test data.
    """
    if not experiment.config.test:
        raise ConfigError(
            "a comparison needs at least one [[test]] map, drive or graph; there is none"
        )
    task = task_of(experiment.config)
    # Test data are read before training, so that errors in them are reported early.
    sources = load_sources(experiment, "train")
    tests = load_sources(experiment, "test", like=sources)
    warn_of_overlap(experiment, sources.all, tests.all)
    return compare_fitted(_trained(task, experiment, sources), tests_of(experiment.config, tests))


def compare_fitted(trained: Trained, tests: Sequence[Source]) -> Comparison:
    """Evaluate fitted methods on maps, drives or graphs with true labels."""
    experiment, methods, names = trained.experiment, trained.methods, trained.label_names
    labelled = label_tests(trained, tests)
    shared = learned_with(
        {name: (method.backend, method.unary) for name, method in methods.items()}
    )
    results = []
    for name, method in methods.items():
        learn = _learning_seconds(name, trained.labelers[name])
        seconds = {"learn": learn, "infer": labelled.seconds[name]}
        tested = labelled.items, labelled.labelings[name]
        result = method_result(name, method, names, *tested, seconds)
        method_choices = getattr(trained.labelers[name], "method_choices", {})
        result = replace(result, choices={**result.choices, **method_choices})
        results.append(replace(result, doors=labelled.doors[name], learned_with=shared.get(name)))
    config = experiment.config
    choices = selected_words(experiment.selection)
    for labeler in trained.labelers.values():
        choices |= getattr(labeler, "choices", {})
    return Comparison(
        title=config.title or ("Node" if config.nodes == "graph" else "Place") + " labelling",
        label_names=names,
        maps=labelled.items,
        methods=tuple(results),
        stage_seconds=dict(experiment.seconds),
        config=resolved_config(config, methods),
        versions=versions(),
        inputs=dict(experiment.inputs),
        warnings=tuple(experiment.warnings),
        selection=experiment.selection,
        choices=choices,
        gates=labelled.gates,
    )


def _learning_seconds(name: str, labeler: Any) -> float:
    """The training time of a method; a PlaceLabeler has the times of all its methods."""
    seconds = labeler.learn_seconds_
    return float(seconds.get(name, 0.0) if isinstance(seconds, Mapping) else seconds)


def method_result(
    name: str,
    method: AnyMethod,
    label_names: tuple[str, ...],
    items: Sequence[TestItem],
    labelings: Sequence[Labeling],
    seconds: Mapping[str, float],
) -> MethodResult:
    """The result of a fitted method from its labelling of each test item, without doors."""
    evaluations = [
        evaluate(item.node_truth, labeling.labels, label_names, beliefs=labeling.beliefs)
        for item, labeling in zip(items, labelings, strict=True)
    ]
    # The time to record the accuracy of every iteration does not count.
    recording = sum(float(each.info.get("recording_seconds", 0.0)) for each in labelings)
    return MethodResult(
        id=name,
        name=type(method.backend).__name__,
        options={"unary": method.unary, **option_values(method.backend)},
        labelings=tuple(labelings),
        evaluations=tuple(evaluations),
        evaluation=Evaluation.merged(evaluations),
        seconds={**seconds, "infer": seconds["infer"] - recording},
        learned=dict(getattr(method.backend, "summary", None) or {}),
        intervals=comparison.score_intervals(items, [labelings], len(label_names)),
        histories=tuple(comparison.history_of(labeling) for labeling in labelings),
        learning=comparison.learning_of(method.backend),
        choices=dict(getattr(method.backend, "choices", {})),
    )


def versions() -> Mapping[str, str]:
    """The versions of this package, Python and the main dependencies."""
    installed = {"pgm-places": __version__, "python": platform.python_version()}
    for package in REPORTED_PACKAGES:
        try:
            installed[package] = importlib.metadata.version(package)
        except importlib.metadata.PackageNotFoundError:
            installed[package] = "not installed"
    return installed
