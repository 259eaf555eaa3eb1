"""A comparison over several runs: every split of the data with every seed."""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import product
from pathlib import Path

from pgm_places.batch.local_workers import Workers
from pgm_places.errors import OutputError
from pgm_places.experiment.comparison import Comparison, over_seeds, over_splits
from pgm_places.experiment.config import ExperimentConfig
from pgm_places.experiment.config_changes import seeded_config
from pgm_places.experiment.experiment import Experiment, FeatureCache
from pgm_places.experiment.runs import compare
from pgm_places.experiment.splits import Split, splits_of
from pgm_places.experiment.tasks import task_of


@dataclass(frozen=True, eq=False)
class RunTask:
    """A comparison on one split, None for ``[[test]]``, with one seed, None for those configured.

    The configuration's paths are relative to ``folder``.
    """

    split: str | None
    seed: int | None
    config: ExperimentConfig
    folder: Path
    feature_cache: FeatureCache | None
    n_threads: int

    @property
    def words(self) -> str:
        """Its name in messages."""
        seed = None if self.seed is None else f"seed {self.seed}"
        return ", ".join(text for text in (self.split, seed) if text is not None)


def run_tasks(
    experiment: Experiment,
    splits: Sequence[Split],
    seeds: Sequence[int] = (),
    *,
    n_threads: int = 1,
) -> list[RunTask]:
    """A task per split and seed; without splits, per seed on ``[[test]]``."""
    runs: list[tuple[str | None, ExperimentConfig]]
    runs = [(split.name, split.config) for split in splits] or [(None, experiment.config)]
    shared = experiment.folder, experiment.feature_cache, n_threads
    if not seeds:
        return [RunTask(name, None, config, *shared) for name, config in runs]
    return [
        RunTask(name, seed, seeded_config(config, seed), *shared)
        for (name, config), seed in product(runs, seeds)
    ]


def compare_run(task: RunTask) -> Comparison:
    """All methods, trained and tested on a split with a seed."""
    experiment = Experiment(
        task.config, task.folder, n_threads=task.n_threads, feature_cache=task.feature_cache
    )
    return compare(experiment)


def compare_several(
    experiment: Experiment,
    workers: Workers,
    *,
    by_building: bool = False,
    n_folds: int | None = None,
    seeds: Sequence[int] = (),
    n_threads: int = 1,
) -> Comparison:
    """Compare all methods of a configuration on every split with every seed.

    The splits are listed by the configuration, or hold out each building in turn (``by_building``)
    or each of ``n_folds`` groups of buildings; otherwise the test data are ``[[test]]``. Options of
    ``[select]`` are chosen separately for every split and seed, on its training data.

    Raises
    ------
    ConfigError
        There are not enough buildings, or a listed split names unknown ones.
    OutputError
        A run crashed its worker each time.
    """
    task_of(experiment.config)  # reports invalid options before anything is read
    wants_splits = by_building or n_folds is not None or bool(experiment.config.splits)
    splits = splits_of(experiment, n_folds=n_folds) if wants_splits else []
    tasks = run_tasks(experiment, splits, seeds, n_threads=n_threads)
    comparisons: dict[tuple[str | None, int | None], Comparison] = {}
    with experiment.progress.stage("runs") as stage:
        for task, result in workers.run(compare_run, tasks):
            if result is None:
                raise OutputError(
                    f"every worker was killed on {task.words}, probably for lack of memory; use "
                    "fewer --jobs, or set max_examples_per_map"
                )
            comparisons[task.split, task.seed] = result
            stage.update(len(comparisons) / len(tasks), f"{len(comparisons)} of {len(tasks)}")
    if not seeds:
        return _of_seed(experiment, splits, comparisons, None)
    by_seed = {seed: _of_seed(experiment, splits, comparisons, seed) for seed in seeds}
    return over_seeds(experiment, by_seed)


def _of_seed(
    experiment: Experiment,
    splits: Sequence[Split],
    comparisons: dict[tuple[str | None, int | None], Comparison],
    seed: int | None,
) -> Comparison:
    """Merge the comparisons of all splits with one seed."""
    if not splits:
        return comparisons[None, seed]
    words = f"{len(splits)} splits"
    if not experiment.config.splits:
        held_out = [
            {entry.building for entry in comparisons[split.name, seed].maps} for split in splits
        ]
        n_buildings = len(set().union(*held_out))
        words = f"each of {n_buildings} buildings left out"
        if len(splits) < n_buildings:
            words = f"{n_buildings} buildings in {len(splits)} folds"
    return over_splits(
        experiment, {entry.name: comparisons[entry.name, seed] for entry in splits}, words
    )
