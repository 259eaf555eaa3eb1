"""Running an experiment: select options, train, label, evaluate."""

import importlib.metadata
import platform
import time
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np

from pgm_places._version import __version__
from pgm_places.errors import ConfigError
from pgm_places.evaluation.evaluation import Evaluation, evaluate
from pgm_places.experiment.comparison import (
    Comparison,
    MethodResult,
    TestDrive,
    TestItem,
    TestMap,
    door_scores,
    history_of,
    learning_of,
    passage_scores,
    score_intervals,
)
from pgm_places.experiment.config_changes import changed_config
from pgm_places.experiment.drives import load_drives
from pgm_places.experiment.experiment import Experiment
from pgm_places.experiment.floor_teaching import taught_floor
from pgm_places.experiment.graph_runs import (
    as_tests,
    label_graphs,
    learn_graphs,
    method_of,
)
from pgm_places.experiment.graphs import SourceGraph, load_graphs
from pgm_places.experiment.maps import load_maps
from pgm_places.experiment.overlap import warn_of_overlap
from pgm_places.experiment.selection import Sources, select
from pgm_places.experiment.setup import (
    AnyMethod,
    check_labeler,
    graph_labelers,
    make_labeler,
    resolved_config,
    step_methods,
)
from pgm_places.experiment.step_runs import StepLabeler, label_drives, learn_steps
from pgm_places.experiment.taught import taught_labeler
from pgm_places.graph.layout import GridLayout
from pgm_places.inference.labeling import Labeling
from pgm_places.labelers.place_labeler import PlaceLabeler, PlaceMethod
from pgm_places.labelers.shared_learning import learned_with
from pgm_places.labelers.structured_labeler import StructuredLabeler
from pgm_places.maps.labelled_map import LabelledMap
from pgm_places.options import option_values
from pgm_places.spaces.door_truth import DoorScores
from pgm_places.unary.halls import HallNames

__all__ = [
    "Trained",
    "TrainedGraphs",
    "TrainedSteps",
    "compare",
    "compare_fitted",
    "train",
    "train_graphs",
    "train_steps",
    "versions",
]

REPORTED_PACKAGES = ("numpy", "scipy", "scikit-learn", "numba", "cvxpy", "osqp", "networkx")


class Trained(NamedTuple):
    """A fitted labeler, and the experiment with the options of its training."""

    experiment: Experiment
    labeler: PlaceLabeler


class TrainedSteps(NamedTuple):
    """A fitted labeler per method, and the experiment with the options they were fitted with."""

    experiment: Experiment
    labelers: Mapping[str, StepLabeler]


class TrainedGraphs(NamedTuple):
    """A fitted labeler per method, and the experiment with the options they were fitted with."""

    experiment: Experiment
    labelers: Mapping[str, StructuredLabeler]


def train(experiment: Experiment) -> Trained:
    """The labeler of the configuration, fitted on its training maps, or trained further on them.

    If the configuration has a table ``[select]``, options are first chosen on the training maps
    alone: the returned experiment has the chosen configuration, and its ``selection`` records the
    candidates.
    """
    check_labeler(experiment.config)
    return _trained(experiment, load_maps(experiment, "train"))


def _trained(experiment: Experiment, maps: Sequence[LabelledMap]) -> Trained:
    if experiment.config.base_model is not None:
        return Trained(experiment, taught_labeler(experiment, maps))
    experiment = _with_chosen_options(experiment, Sources(maps))
    labeler = make_labeler(experiment.config)
    with experiment.learning():
        if labeler.floor is not None:
            labeler.floor = taught_floor(
                labeler.floor,
                maps,
                labeler.label_names,
                experiment.config.floor,
                experiment.progress,
            )
        labeler = labeler.fit(
            maps,
            feature_cache=experiment.feature_cache,
            n_threads=experiment.n_threads,
            progress=experiment.progress,
        )
    return Trained(experiment, labeler)


def train_steps(experiment: Experiment) -> TrainedSteps:
    """A labeler per method of a configuration of drives, fitted on its training maps and drives.

    Options are first chosen as for :func:`train`, on the training drives.
    """
    step_methods(experiment.config)  # refuses bad options before anything is read
    sources = Sources(load_maps(experiment, "train"), load_drives(experiment, "train"))
    return _trained_steps(experiment, sources)


def _trained_steps(experiment: Experiment, sources: Sources) -> TrainedSteps:
    experiment = _with_chosen_options(experiment, sources)
    return TrainedSteps(experiment, learn_steps(experiment, sources.maps, sources.drives))


def train_graphs(experiment: Experiment) -> "TrainedGraphs":
    """A labeler per method of a configuration of graphs, fitted on its training graphs.

    Options are first chosen as for :func:`train`, on the training graphs.
    """
    return _trained_graphs(experiment, load_graphs(experiment, "train"))


def _trained_graphs(experiment: Experiment, graphs: Sequence[SourceGraph]) -> "TrainedGraphs":
    experiment = _with_chosen_options(experiment, Sources((), graphs=graphs))
    return TrainedGraphs(experiment, learn_graphs(experiment, graphs))


def _with_chosen_options(experiment: Experiment, sources: Sources) -> Experiment:
    """The experiment with the options that ``[select]`` chooses, if there is such a table."""
    if experiment.config.select is None:
        return experiment
    with experiment.timed("select"):
        found = select(experiment, sources)
    config = changed_config(experiment.config, found.chosen.options)
    return replace(experiment, config=config, selection=found.to_dict())


def compare(experiment: Experiment) -> Comparison:
    """All methods of the configuration, trained on its training maps and run on its test maps.

    Raises
    ------
    ConfigError
        There are no test maps.
    """
    if not experiment.config.test:
        raise ConfigError(
            "a comparison needs at least one [[test]] map, drive or graph; there is none"
        )
    if experiment.config.nodes == "graph":
        return _compare_graphs(experiment)
    if experiment.config.nodes != "cells":
        return _compare_drives(experiment)
    check_labeler(experiment.config)
    # Test maps are read before anything is learned, so that errors in them show at once.
    tests, maps = load_maps(experiment, "test"), load_maps(experiment, "train")
    warn_of_overlap(experiment, maps, tests)
    return compare_fitted(*_trained(experiment, maps), tests)


def compare_fitted(
    experiment: Experiment, labeler: PlaceLabeler, tests: Sequence[LabelledMap]
) -> Comparison:
    """All methods of a fitted labeler on test maps with their labels."""
    hall_names = HallNames.among(experiment.config.labels.names)
    if hall_names is not None:
        tests = [hall_names.fold(item, labeler.halls) for item in tests]
    maps, scored = [], []
    for item in tests:
        with experiment.timed("score cells"):
            graph, scores = labeler.scores(
                item.grid,
                mask=item.cells,
                n_threads=experiment.n_threads,
                progress=experiment.progress,
            )
        assert isinstance(graph.layout, GridLayout)  # from_grid made it
        window = np.ones(item.grid.shape, np.bool_) if item.window is None else item.window
        maps.append(TestMap(item.name, item.grid, item.labels, graph.layout, window))
        scored.append((graph, scores, item.truth(graph)))
    methods = [_run_method(experiment, labeler, name, scored, maps) for name in labeler.methods_]
    return _comparison(experiment, labeler.label_names_, maps, methods, labeler.methods_)


def _compare_drives(experiment: Experiment) -> Comparison:
    """All methods on the steps of the test drives, joined with the cells of their maps or alone."""
    step_methods(experiment.config)  # refuses bad options before anything is read
    drives = load_drives(experiment, "test")
    sources = Sources(load_maps(experiment, "train"), load_drives(experiment, "train"))
    warn_of_overlap(experiment, [*sources.maps, *sources.drives], drives)
    experiment, labelers = _trained_steps(experiment, sources)
    found = label_drives(experiment, labelers, drives)
    names = tuple(experiment.config.labels.names)
    methods = {name: PlaceMethod(item.method_, "laser") for name, item in labelers.items()}
    results = []
    for name, labeler in labelers.items():
        seconds = {"learn": labeler.learn_seconds_, "infer": found.seconds[name]}
        result = method_result(
            name, methods[name], names, found.items, found.labelings[name], seconds
        )
        doors = _passages(experiment, found.items, found.labelings[name])
        results.append(replace(result, doors=doors))
    return _comparison(experiment, names, found.items, results, methods)


def _compare_graphs(experiment: Experiment) -> Comparison:
    """All methods on the nodes of the test graphs."""
    graph_labelers(experiment.config)  # refuses bad options before anything is read
    graphs = load_graphs(experiment, "train")
    tests = load_graphs(experiment, "test", like=graphs)
    warn_of_overlap(experiment, graphs, tests)
    experiment, labelers = _trained_graphs(experiment, graphs)
    names, items = tuple(experiment.config.labels.names), as_tests(tests)
    methods = {n: method_of(experiment.config, n, item) for n, item in labelers.items()}
    results = []
    for name, labeler in labelers.items():
        found, spent = label_graphs(experiment, name, labeler, tests)
        seconds = {"learn": labeler.learn_seconds_, "infer": spent}
        results.append(method_result(name, methods[name], names, items, found, seconds))
    return _comparison(experiment, names, items, results, methods)


def _passages(
    experiment: Experiment, items: Sequence[TestItem], labelings: Sequence[Labeling]
) -> tuple[DoorScores, ...]:
    """The doorways passed through on each drive, where nothing but steps was labelled."""
    names, doorway = experiment.config.labels.names, experiment.config.topology.doorway_label
    drives = [item for item in items if isinstance(item, TestDrive)]
    if doorway not in names or len(drives) < len(items):
        return ()
    return tuple(
        passage_scores(item, found, names.index(doorway))
        for item, found in zip(drives, labelings, strict=True)
    )


def _comparison(
    experiment: Experiment,
    label_names: tuple[str, ...],
    items: Sequence[TestItem],
    results: Sequence[MethodResult],
    methods: Mapping[str, AnyMethod],
) -> Comparison:
    config = experiment.config
    shared = learned_with({name: (item.backend, item.unary) for name, item in methods.items()})
    results = [replace(item, learned_with=shared.get(item.id)) for item in results]
    return Comparison(
        title=config.title or ("Node" if config.nodes == "graph" else "Place") + " labelling",
        label_names=label_names,
        maps=tuple(items),
        methods=tuple(results),
        stage_seconds=dict(experiment.seconds),
        config=resolved_config(config, methods),
        versions=versions(),
        inputs=dict(experiment.inputs),
        warnings=tuple(experiment.warnings),
        selection=experiment.selection,
    )


def _run_method(
    experiment: Experiment,
    labeler: PlaceLabeler,
    name: str,
    scored: Sequence[Any],
    maps: Sequence[TestMap],
) -> MethodResult:
    method = labeler.method(name)
    labelings = []
    start = time.perf_counter()
    with experiment.progress.stage(f"labelling with {name}") as stage:
        for index, (graph, scores, truth) in enumerate(scored):
            labelings.append(labeler.infer(graph, scores, method=name, truth=truth))
            stage.update((index + 1) / len(scored))
    spent = time.perf_counter() - start
    result = method_result(
        name,
        method,
        labeler.label_names_,
        maps,
        labelings,
        {"learn": labeler.learn_seconds_.get(name, 0.0), "infer": spent},
    )
    doors = _doors(experiment, labeler, method.unary, scored, maps, labelings)
    return replace(result, doors=doors)


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
        evaluate(item.node_truth, found.labels, label_names, beliefs=found.beliefs)
        for item, found in zip(items, labelings, strict=True)
    ]
    # Recording the accuracy of every iteration is not part of the method.
    recording = sum(float(item.info.get("recording_seconds", 0.0)) for item in labelings)
    return MethodResult(
        id=name,
        name=type(method.backend).__name__,
        options={"unary": method.unary, **option_values(method.backend)},
        labelings=tuple(labelings),
        evaluations=tuple(evaluations),
        evaluation=Evaluation.merged(evaluations),
        seconds={**seconds, "infer": seconds["infer"] - recording},
        learned=dict(getattr(method.backend, "summary", None) or {}),
        intervals=score_intervals(items, labelings, len(label_names)),
        histories=tuple(history_of(labeling) for labeling in labelings),
        learning=learning_of(method.backend),
    )


def _doors(
    experiment: Experiment,
    labeler: PlaceLabeler,
    unary: str,
    scored: Sequence[Any],
    maps: Sequence[TestMap],
    labelings: Sequence[Labeling],
) -> tuple[DoorScores, ...]:
    """The doors of each map that a method found, if there is a label for doorways."""
    names, doorway = labeler.label_names_, experiment.config.topology.doorway_label
    if doorway not in names:
        return ()
    model = labeler.unary_model_.space
    by_gates = unary in ("space", "floor") and model is not None and model.gates is not None
    return tuple(
        door_scores(item, found, names.index(doorway), scores.spaces if by_gates else None)
        for item, found, (_, scores, _) in zip(maps, labelings, scored, strict=True)
    )


def versions() -> Mapping[str, str]:
    """The versions of everything that a result depends on."""
    found = {"pgm-places": __version__, "python": platform.python_version()}
    for package in REPORTED_PACKAGES:
        try:
            found[package] = importlib.metadata.version(package)
        except importlib.metadata.PackageNotFoundError:
            found[package] = "not installed"
    return found
