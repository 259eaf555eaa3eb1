"""The commands demo, compare, train and label: read inputs, call the library, write results."""

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

from pgm_places.cli.progress import make_progress
from pgm_places.cli.tables import comparison_table, shares_line
from pgm_places.cli.terminal import say, say_written
from pgm_places.cli.warm_up import WarmUp
from pgm_places.errors import ConfigError

if TYPE_CHECKING:
    from pgm_places.experiment.experiment import Experiment
    from pgm_places.io.maps.map_server import MapFile
    from pgm_places.io.output_set import OutputSet
    from pgm_places.labelers.place_labeler import PlaceLabeler, PlaceMethod
    from pgm_places.progress import Progress
    from pgm_places.topology.rules import TopologyOptions

__all__ = ["run_compare", "run_demo", "run_label", "run_train"]


@contextmanager
def _experiment(config_path: Path, *, n_threads: int | None, quiet: bool) -> "Iterator[Experiment]":
    """The experiment of a configuration; a second process compiles what it will need."""
    from pgm_places.experiment.config import load_config

    config = load_config(config_path)
    spaces = [] if config.space is None else ["segments", "space", "trees"]
    stages = ["features", "boosting", *spaces, *(item.name for item in config.methods)]
    with WarmUp(stages, n_threads=n_threads):
        from pgm_places.experiment.experiment import Experiment

        experiment = Experiment(
            config,
            config_path.resolve().parent,
            progress=make_progress(quiet=quiet),
            n_threads=n_threads,
        )
        experiment.record_input(config_path.resolve())
        yield experiment


def run_compare(
    config_path: Path, out: Path, *, force: bool, n_threads: int | None, quiet: bool
) -> None:
    """``pgm-places compare``."""
    from pgm_places.io.output_set import output_set
    from pgm_places.report.file_names import COMPARISON

    with output_set(out, "compare", names=COMPARISON, force=force) as files:
        table = _compare(config_path, files.stage, n_threads=n_threads, quiet=quiet)
    say(table)
    say_written(files)


def _compare(config_path: Path, folder: Path, *, n_threads: int | None, quiet: bool) -> str:
    """Compare the methods of a configuration and write the results into the folder; the table."""
    with _experiment(config_path, n_threads=n_threads, quiet=quiet) as experiment:
        from pgm_places.experiment.runs import compare
        from pgm_places.report.comparison_files import write_comparison

        comparison = compare(experiment)
        with experiment.progress.stage("report"):
            write_comparison(comparison, folder)
    return comparison_table(comparison)


def run_demo(out: Path, *, seed: int, force: bool, n_threads: int | None, quiet: bool) -> None:
    """``pgm-places demo``: writes a building as files, then compares methods as on any map."""
    from pgm_places.datasets.demo import write_demo
    from pgm_places.io.output_set import output_set
    from pgm_places.report.file_names import DEMO

    with output_set(out, "demo", names=DEMO, force=force) as files:
        config_path = write_demo(files.stage, seed=seed)
        table = _compare(config_path, files.stage, n_threads=n_threads, quiet=quiet)
    say(table)
    say_written(files)
    config_path = out / config_path.name
    say(
        "\nNext:\n"
        f"  open {out / 'report.html'} in a browser\n"
        f"  pgm-places train {config_path} --out model\n"
        f"  pgm-places label {out / 'map.yaml'} --model model --out labelled"
    )


def run_train(config_path: Path, out: Path, *, n_threads: int | None, quiet: bool) -> None:
    """``pgm-places train``."""
    with _experiment(config_path, n_threads=n_threads, quiet=quiet) as experiment:
        from pgm_places.persistence.model_folder import check_target

        check_target(out)
        if experiment.config.nodes != "cells":
            _train_steps(experiment, out)
            return
        from pgm_places.experiment.runs import train
        from pgm_places.experiment.setup import make_labeler
        from pgm_places.persistence.place_labeler import check_savable
        from pgm_places.persistence.stored import save

        check_savable(make_labeler(experiment.config))  # not after hours of training
        experiment, labeler = train(experiment)
        save(labeler, out, record=_training_record(experiment, labeler.methods_))
    methods = ", ".join(labeler.methods_)
    say(f"wrote {out} (labels: {', '.join(labeler.label_names)}; methods: {methods})")


def _train_steps(experiment: "Experiment", out: Path) -> None:
    """Train a labeler of drives with the configuration's one method."""
    from pgm_places.experiment.runs import train_steps
    from pgm_places.labelers.place_labeler import PlaceMethod
    from pgm_places.persistence.stored import save

    if len(experiment.config.methods) > 1:
        ids = ", ".join(item.id for item in experiment.config.methods)
        raise ConfigError(
            f"a model of drives has one method, and the configuration has {ids}; keep the one to "
            "train in a file of its own ('compare' takes them all)"
        )
    experiment, labelers = train_steps(experiment)
    [(name, labeler)] = labelers.items()
    method = {name: PlaceMethod(labeler.method_, "laser")}
    save(labeler, out, record=_training_record(experiment, method))
    say(f"wrote {out} (labels: {', '.join(labeler.label_names)}; method: {name})")


def _training_record(
    experiment: "Experiment", methods: "Mapping[str, PlaceMethod]"
) -> dict[str, Any]:
    """How a model was trained."""
    from pgm_places.experiment.runs import versions
    from pgm_places.experiment.setup import resolved_config

    return {
        "config": resolved_config(experiment.config, methods),
        "inputs": experiment.inputs,
        "versions": dict(versions()),
        "warnings": experiment.warnings,
    }


def run_label(
    map_yaml: Path,
    out: Path,
    *,
    model: str,
    method: str | None,
    doorways: str | None,
    halls: str | None,
    unknown_value: int | None,
    force: bool,
    n_threads: int | None,
    quiet: bool,
) -> None:
    """``pgm-places label``."""
    from pgm_places.cli.flags import named_as_flags
    from pgm_places.cli.places import rules_of
    from pgm_places.trained import model_folder

    progress = make_progress(quiet=quiet)
    folder = model_folder(model)
    with WarmUp(["features"], n_threads=n_threads) as warm_up:  # imports take seconds
        from pgm_places.inference.backends import METHODS
        from pgm_places.io.maps.map_server import load_map
        from pgm_places.io.output_set import output_set
        from pgm_places.persistence.stored import read
        from pgm_places.report.file_names import label_names

        stored = read(folder, "place-labeler")
        labeler, rules = stored.item, rules_of(stored.rules, doorways)
        if halls is not None:
            with named_as_flags({"halls": "--halls"}):
                labeler = labeler.with_options(halls=halls)
            if not labeler.unary_model_.knows_halls:
                progress.warn("--halls: this model was not trained to tell halls from corridors")
        chosen = labeler.method(method)  # an unknown method shows before the work
        # The run divides the map first, which leaves time for all that comes after it.
        spaces = ["scans", "space"] if chosen.unary == "space" else []
        warm_up.compile([*spaces, METHODS.name_of(type(chosen.backend)), "topology"])
        with progress.stage("map"):
            loaded = load_map(map_yaml, unknown_value=unknown_value)
        for message in loaded.warnings:
            progress.warn(message)
        names = label_names(labeler.label_names)
        with output_set(out, "label", names=names, force=force) as files:
            say(shares_line(loaded.fractions))
            found = _label(labeler, rules, loaded, method, files, n_threads, progress)
    say(found)
    say_written(files)


def _label(
    labeler: "PlaceLabeler",
    rules: "TopologyOptions",
    loaded: "MapFile",
    method: str | None,
    files: "OutputSet",
    n_threads: int | None,
    progress: "Progress",
) -> str:
    """Label a map that has been read and write labels, pictures and places; a summary."""
    from pgm_places.cli.places import write_places
    from pgm_places.labelers.label_map import label_map
    from pgm_places.report.label_files import write_labels
    from pgm_places.report.topology_output import places_summary

    result = label_map(labeler, loaded.grid, method=method, n_threads=n_threads, progress=progress)
    for message in result.warnings:
        progress.warn(message)
    with progress.stage("writing files"):
        write_labels(result, loaded, files.stage)
    summary = result.summary()
    title = f"{loaded.yaml_path.stem}: {result.method}"
    options = {"labels": result.labels, "label_names": result.label_names}
    options |= {"beliefs": result.labeling.beliefs, "layout": result.layout}
    options["doorways"] = result.doorways if rules.doorways == "gates" else None
    del result  # the labels of a huge map's nodes are not needed any more
    with progress.stage("places"):
        topology = write_places(files, title, rules, grid=loaded.grid, **options)
    return f"{summary}\n{places_summary(topology)}"
