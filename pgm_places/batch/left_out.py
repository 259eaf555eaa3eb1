"""Every building left out in turn: trained on the others, tested on it, all results as one."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from pgm_places.batch.workers import Workers
from pgm_places.errors import ConfigError, OutputError
from pgm_places.evaluation.evaluation import Evaluation
from pgm_places.experiment.comparison import Comparison, MethodResult, score_intervals
from pgm_places.experiment.config import ExperimentConfig
from pgm_places.experiment.experiment import Experiment
from pgm_places.experiment.feature_cache import FeatureCache
from pgm_places.experiment.runs import compare
from pgm_places.experiment.sources import load_sources
from pgm_places.experiment.tasks import task_of, tests_of

__all__ = ["FoldTask", "compare_buildings", "compare_fold", "fold_tasks"]


@dataclass(frozen=True, eq=False)
class FoldTask:
    """A building to leave out.

    Parameters
    ----------
    building : str
    config : ExperimentConfig
        Trains on the other buildings and tests on this one.
    folder : Path
        What the configuration's paths are relative to.
    feature_cache : FeatureCache, optional
    n_threads : int
    """

    building: str
    config: ExperimentConfig
    folder: Path
    feature_cache: FeatureCache | None
    n_threads: int


def fold_tasks(experiment: Experiment, *, n_threads: int = 1) -> list[FoldTask]:
    """A task per building of the training maps, drives or graphs.

    Raises
    ------
    ConfigError
        All that can be tested on is of one building.
    """
    config, loaded = experiment.config, load_sources(experiment, "train")
    maps, others = iter(loaded.maps), iter(loaded.all[len(loaded.maps) :])
    is_other = [item.is_drive or item.graph is not None for item in config.train]
    buildings = [(next(others) if other else next(maps)).building for other in is_other]
    sources = list(zip(config.train, buildings, strict=True))
    # Where steps are labelled, maps are learned from and drives are tested on, too.
    names = list(dict.fromkeys(item.building for item in tests_of(config, loaded)))
    if len(names) < 2:
        kind = task_of(config).tests
        table = ", or buildings = 'table.csv'" if kind == "maps" else ""
        raise ConfigError(
            f"--by-building needs {kind} of two buildings in [[train]], and there is one; name the "
            f"building of each {kind.removesuffix('s')}: building = '...'{table}"
        )
    tasks = []
    for name in names:
        fold = replace(
            config,
            train=tuple(item for item, of in sources if of != name),
            test=tuple(
                item
                for (item, of), other in zip(sources, is_other, strict=True)
                if of == name and other == (config.nodes != "cells")
            ),
        )
        cache = experiment.feature_cache
        tasks.append(FoldTask(str(name), fold, experiment.folder, cache, n_threads))
    return tasks


def compare_fold(task: FoldTask) -> Comparison:
    """All methods, trained on the other buildings and run on the one that is left out."""
    experiment = Experiment(
        task.config, task.folder, n_threads=task.n_threads, feature_cache=task.feature_cache
    )
    return compare(experiment)


def compare_buildings(
    experiment: Experiment, workers: Workers, *, n_threads: int = 1
) -> Comparison:
    """All methods of a configuration on each building of its training data, left out in turn.

    Options of ``[select]`` are chosen separately for every building, on the others. ``[[test]]`` is
    not looked at.

    Raises
    ------
    ConfigError
        There are not two buildings.
    OutputError
        A worker died on a building each time.
    """
    task_of(experiment.config).check(experiment.config)
    tasks = fold_tasks(experiment, n_threads=n_threads)
    found: dict[str, Comparison] = {}
    with experiment.progress.stage("buildings left out") as stage:
        for task, result in workers.run(compare_fold, tasks):
            if result is None:
                raise OutputError(
                    f"every worker died while {task.building} was left out: probably killed for "
                    "memory; use fewer --jobs, or set max_examples_per_map"
                )
            found[task.building] = result
            stage.update(len(found) / len(tasks), f"{len(found)} of {len(tasks)}")
    parts = [found[task.building] for task in tasks]
    return _together(experiment, parts)


def _together(experiment: Experiment, parts: Sequence[Comparison]) -> Comparison:
    """The comparisons of all buildings as one."""
    first = parts[0]
    maps = tuple(item for part in parts for item in part.maps)
    seconds: dict[str, float] = {}
    inputs = dict(experiment.inputs)
    for part in parts:
        inputs |= part.inputs
        for name, value in part.stage_seconds.items():
            seconds[name] = seconds.get(name, 0.0) + value
    methods = []
    for number, _ in enumerate(first.methods):
        results = [part.methods[number] for part in parts]
        merged = _merged(results)
        intervals = score_intervals(maps, merged.labelings, len(first.label_names))
        methods.append(replace(merged, intervals=intervals))
    for message in (message for part in parts for message in part.warnings):
        experiment.warn(message)
    return replace(
        first,
        title=f"{first.title}: each of {len(parts)} buildings left out",
        maps=maps,
        methods=tuple(methods),
        stage_seconds=seconds,
        inputs=inputs,
        warnings=tuple(experiment.warnings),
        selection=None,
    )


def _merged(results: Sequence[MethodResult]) -> MethodResult:
    """The results of one method on all buildings; what it learned differs between them."""
    return replace(
        results[0],
        labelings=tuple(item for result in results for item in result.labelings),
        evaluations=tuple(item for result in results for item in result.evaluations),
        evaluation=Evaluation.merged([result.evaluation for result in results]),
        seconds={key: sum(result.seconds[key] for result in results) for key in ("learn", "infer")},
        learned={},
        histories=tuple(item for result in results for item in result.histories),
        learning={},
        doors=tuple(item for result in results for item in result.doors),
    )
