"""The commands demo, compare and train: read inputs, call the library, write results."""

import shlex
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, NamedTuple

from pgm_places.cli.arguments import Cache, Config, Force, Out, Quiet, Threads
from pgm_places.cli.declarations import grouped
from pgm_places.cli.label import WorkerOptions, make_workers
from pgm_places.cli.terminal import (
    comparison_table,
    complain,
    make_progress,
    say,
    say_next,
    say_written,
)
from pgm_places.errors import InputError
from pgm_places.options import Seed
from pgm_places.options.marks import Ge, Le

if TYPE_CHECKING:
    from pgm_places.experiment.experiment import Experiment
    from pgm_places.experiment.tasks import Trained

_USES = {
    "cells": "label map.yaml --model {model} --out labelled  # any map",
    "steps": "track drive.log --model {model} --out tracked  # any drive",
    "both": "track drive.log --map map.yaml --model {model} --out tracked  # any drive and its map",
}
"""How a trained model is used, by what it labels."""


def _experiment(
    config_path: Path, *, cache: Path | None = None, n_threads: int | None, quiet: bool
) -> "Experiment":
    """The experiment of a configuration."""
    from pgm_places.experiment.config import load_config
    from pgm_places.experiment.experiment import Experiment, FeatureCache

    experiment = Experiment(
        load_config(config_path),
        config_path.resolve().parent,
        progress=make_progress(quiet=quiet),
        n_threads=n_threads,
        feature_cache=None
        if cache is None
        else FeatureCache(cache.absolute(), None if quiet else complain),
    )
    experiment.record_input(config_path.resolve())
    return experiment


@grouped("workers", WorkerOptions)
def compare(
    config_path: Config,
    out: Out,
    by_building: bool = False,
    folds: Annotated[int, Ge(2)] | None = None,
    seeds: Annotated[int, Ge(2), Le(100)] | None = None,
    cache: Cache = None,
    marginals: bool = False,
    *,
    workers: WorkerOptions,
    force: Force = False,
    n_threads: Threads = None,
    quiet: Quiet = False,
) -> None:
    """Train and evaluate every method of a configuration. Writes tables and a report.

    A configuration may list [[splits]] of its buildings in place of [[test]]. --jobs, --scheduler
    and --memory distribute several splits or seeds, one task each.

    Parameters
    ----------
    by_building
        Leave out each building of [[train]] in turn, train on the others and test on it; [[test]]
        is not used.
    folds : K
        Cross-validate over K groups of buildings.
    seeds : N
        Train with the seeds 1 to N and report means and standard deviations; differences are
        paired by seed.
    marginals
        Keep the node marginals of linear programs (inference = "lp") in results.json.
    """
    if by_building and folds is not None:
        raise InputError("--by-building and --folds cannot be combined")
    from pgm_places.io.output_set import output_set
    from pgm_places.labelling.files import COMPARISON

    runs = _Runs(by_building, folds, seeds, workers)
    with output_set(out, "compare", names=COMPARISON, force=force) as files:
        experiment = _experiment(config_path, cache=cache, n_threads=n_threads, quiet=quiet)
        table = _compare(experiment, files.stage, runs, marginals=marginals)
    say(table)
    say_written(files)


class _Runs(NamedTuple):
    """Splits, seeds and workers of a comparison."""

    by_building: bool = False
    n_folds: int | None = None
    n_seeds: int | None = None
    workers: WorkerOptions = WorkerOptions()


def _compare(
    experiment: "Experiment", folder: Path, runs: _Runs, *, marginals: bool = False
) -> str:
    """Compare the methods and write the results into the folder; the table."""
    from pgm_places.experiment.runs import compare as compare_methods
    from pgm_places.report.comparison_files import write_comparison

    splits = experiment.config.splits
    if splits and (runs.by_building or runs.n_folds):
        raise InputError("the configuration lists [[splits]]; leave out --by-building and --folds")
    if not splits and runs[:3] == _Runs()[:3]:
        if runs.workers != WorkerOptions():
            raise InputError(
                "--jobs, --scheduler and --memory distribute several splits or seeds; add "
                "--by-building, --folds or --seeds"
            )
        comparison = compare_methods(experiment)
    else:
        from pgm_places.batch.several_runs import compare_several

        n_tasks = (len(splits) or len(experiment.config.train)) * (runs.n_seeds or 1)
        workers, threads = make_workers(runs.workers, n_tasks, experiment.n_threads)
        comparison = compare_several(
            experiment,
            workers,
            by_building=runs.by_building,
            n_folds=runs.n_folds,
            seeds=range(1, (runs.n_seeds or 0) + 1),
            n_threads=threads,
        )
    with experiment.progress.stage("report"):
        write_comparison(comparison, folder, marginals=marginals)
    return comparison_table(comparison)


def demo(
    out: Out = Path("demo-report"),
    seed: Seed = 0,
    force: Force = False,
    n_threads: Threads = None,
    quiet: Quiet = False,
) -> None:
    """Train and label on a generated building; needs no data.

    Parameters
    ----------
    seed
        Seed of the generated building.
    """
    from pgm_places.io.output_set import output_set
    from pgm_places.labelling.files import DEMO
    from pgm_places.simulation.demo import write_demo

    if not quiet:
        say("Three methods train on the left part of a generated building and label the right.")
    with output_set(out, "demo", names=DEMO, force=force) as files:
        config_path = write_demo(files.stage, seed=seed)
        experiment = _experiment(config_path, n_threads=n_threads, quiet=quiet)
        table = _compare(experiment, files.stage, _Runs())
    say(table)
    say_written(files)
    config_path = out / config_path.name
    say_next(
        f"open {out / 'report.html'} in a browser",
        f"pgm-places train {config_path} --out model",
        f"pgm-places label {out / 'map.yaml'} --model model --out labelled",
    )


def train(
    config_path: Config,
    out: Out,
    cache: Cache = None,
    n_threads: Threads = None,
    quiet: Quiet = False,
) -> None:
    """Train a model on labelled maps and save it as a folder."""
    from pgm_places.experiment.runs import train as train_labeler
    from pgm_places.persistence.model_folder import check_target
    from pgm_places.persistence.stored import save

    experiment = _experiment(config_path, cache=cache, n_threads=n_threads, quiet=quiet)
    check_target(out)
    trained = train_labeler(experiment, to_save=True)
    save(trained.labeler, out, record=_training_record(trained))
    for option, words in getattr(trained.labeler, "choices", {}).items():
        say(f"{option}: {words}")
    names, methods = ", ".join(trained.label_names), list(trained.labelers)
    word = "methods" if len(methods) > 1 else "method"
    say(f"wrote {out} (labels: {names}; {word}: {', '.join(methods)})")
    for option, chosen in _choices(trained).items():
        say(f"{option}: {chosen}")
    if (command := _USES.get(trained.experiment.config.nodes)) is not None:
        say_next(f"pgm-places {command.format(model=shlex.quote(str(out)))}")


def _choices(trained: "Trained") -> dict[str, str]:
    """Options that the methods chose on training data, as text."""
    choices: dict[str, str] = {}
    for name, method in trained.methods.items():
        chosen = dict(getattr(method.backend, "choices", {}))
        chosen |= getattr(trained.labelers[name], "method_choices", {})
        choices |= {f"{name}: {option}": words for option, words in chosen.items()}
    return choices


def _training_record(trained: "Trained") -> dict[str, Any]:
    """How a model was trained."""
    from pgm_places.experiment.runs import versions
    from pgm_places.experiment.setup import resolved_config

    experiment = trained.experiment
    return {
        "config": resolved_config(experiment.config, trained.methods),
        "inputs": experiment.inputs,
        "versions": dict(versions()),
        "warnings": experiment.warnings,
        "choices": _choices(trained),
    }
