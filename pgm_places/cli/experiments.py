"""The commands demo, compare and train: read inputs, call the library, write results."""

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from pgm_places.cli.arguments import Cache, Config, Force, Out, Quiet, Threads
from pgm_places.cli.declarations import Option
from pgm_places.cli.label_many import Jobs, Memory, Scheduler, WorkerOptions, make_workers
from pgm_places.cli.progress import make_progress
from pgm_places.cli.tables import comparison_table
from pgm_places.cli.terminal import complain, say, say_written
from pgm_places.cli.warm_up import WarmUp
from pgm_places.errors import ConfigError, InputError
from pgm_places.options import Seed

if TYPE_CHECKING:
    from pgm_places.experiment.experiment import Experiment
    from pgm_places.experiment.runs import Trained

__all__ = ["compare", "demo", "train"]


@contextmanager
def _experiment(
    config_path: Path, *, cache: Path | None = None, n_threads: int | None, quiet: bool
) -> "Iterator[Experiment]":
    """The experiment of a configuration; a second process compiles what it will need."""
    from pgm_places.experiment.config import load_config

    config = load_config(config_path)
    of_maps = ["segments", "space", "trees"] if config.nodes != "graph" else []
    before = ["features"] if config.nodes != "graph" else []
    stages = [*before, "boosting", *of_maps, *(item.name for item in config.methods)]
    with WarmUp(stages, n_threads=n_threads):
        from pgm_places.experiment.experiment import Experiment
        from pgm_places.experiment.feature_cache import FeatureCache

        experiment = Experiment(
            config,
            config_path.resolve().parent,
            progress=make_progress(quiet=quiet),
            n_threads=n_threads,
            feature_cache=None
            if cache is None
            else FeatureCache(cache.absolute(), None if quiet else complain),
        )
        experiment.record_input(config_path.resolve())
        yield experiment


def compare(
    config_path: Config,
    out: Out,
    by_building: Annotated[
        bool,
        Option(
            "--by-building",
            help="Leave out each building of [[train]] in turn, train on the others and test on "
            "it; [[test]] is not used.",
        ),
    ] = False,
    cache: Cache = None,
    jobs: Jobs = None,
    scheduler: Scheduler = None,
    memory: Memory = None,
    force: Force = False,
    n_threads: Threads = None,
    quiet: Quiet = False,
) -> None:
    """Train and evaluate every method of a configuration. Writes tables and a report.

    --jobs, --scheduler and --memory are for --by-building: each building is a task of its own.
    """
    workers = WorkerOptions(jobs, scheduler, memory)
    if workers.given and not by_building:
        raise InputError("--jobs, --scheduler and --memory are for compare --by-building")
    from pgm_places.io.output_set import output_set
    from pgm_places.report.outputs import COMPARISON

    shared_out = workers if by_building else None
    with (
        output_set(out, "compare", names=COMPARISON, force=force) as files,
        _experiment(config_path, cache=cache, n_threads=n_threads, quiet=quiet) as experiment,
    ):
        table = _compare(experiment, files.stage, shared_out)
    say(table)
    say_written(files)


def _compare(experiment: "Experiment", folder: Path, shared_out: WorkerOptions | None) -> str:
    """Compare the methods and write the results into the folder; the table.

    With workers, each building of the training maps is left out in turn.
    """
    from pgm_places.experiment.runs import compare as compare_methods
    from pgm_places.report.comparison_files import write_comparison

    if shared_out is None:
        comparison = compare_methods(experiment)
    else:
        from pgm_places.batch.left_out import compare_buildings

        n_tasks = len(experiment.config.train)
        workers, threads = make_workers(shared_out, n_tasks, experiment.n_threads)
        comparison = compare_buildings(experiment, workers, n_threads=threads)
    with experiment.progress.stage("report"):
        write_comparison(comparison, folder)
    return comparison_table(comparison)


def demo(
    out: Out = Path("demo-report"),
    seed: Annotated[Seed, Option(help="Seed of the generated building.")] = 0,
    force: Force = False,
    n_threads: Threads = None,
    quiet: Quiet = False,
) -> None:
    """Train and label on a generated building; needs no data."""
    from pgm_places.datasets.demo import write_demo
    from pgm_places.io.output_set import output_set
    from pgm_places.report.outputs import DEMO

    if not quiet:
        say("Three methods learn from the left part of a generated building, and label the right.")
    with output_set(out, "demo", names=DEMO, force=force) as files:
        config_path = write_demo(files.stage, seed=seed)
        with _experiment(config_path, n_threads=n_threads, quiet=quiet) as experiment:
            table = _compare(experiment, files.stage, None)
    say(table)
    say_written(files)
    config_path = out / config_path.name
    say(
        "\nNext:\n"
        f"  open {out / 'report.html'} in a browser\n"
        f"  pgm-places train {config_path} --out model\n"
        f"  pgm-places label {out / 'map.yaml'} --model model --out labelled"
    )


def train(
    config_path: Config,
    out: Out,
    cache: Cache = None,
    n_threads: Threads = None,
    quiet: Quiet = False,
) -> None:
    """Train a model on labelled maps and save it as a folder."""
    with _experiment(config_path, cache=cache, n_threads=n_threads, quiet=quiet) as experiment:
        from pgm_places.persistence.model_folder import check_target

        check_target(out)
        from pgm_places.experiment.runs import train as train_labeler
        from pgm_places.experiment.setup import make_labeler
        from pgm_places.persistence.place_labeler import check_savable
        from pgm_places.persistence.stored import save

        if experiment.config.nodes != "cells":
            _require_one_method(experiment)
        elif experiment.config.base_model is None:
            check_savable(make_labeler(experiment.config))  # not after hours of training
        trained = train_labeler(experiment)
        save(trained.labeler, out, record=_training_record(trained))
    names, methods = ", ".join(trained.label_names), list(trained.labelers)
    word = "methods" if len(methods) > 1 else "method"
    say(f"wrote {out} (labels: {names}; {word}: {', '.join(methods)})")


def _require_one_method(experiment: "Experiment") -> None:
    if len(experiment.config.methods) > 1:
        what = "graphs" if experiment.config.nodes == "graph" else "drives"
        ids = ", ".join(item.id for item in experiment.config.methods)
        raise ConfigError(
            f"a model of {what} has one method, and the configuration has {ids}; keep the one to "
            "train in a file of its own ('compare' takes them all)"
        )


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
    }
