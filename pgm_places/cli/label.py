"""``pgm-places label`` of one map or a batch, and ``index``."""

import shlex
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from pgm_places.cli import declarations
from pgm_places.cli.arguments import (
    Force,
    Method,
    Model,
    Out,
    Quiet,
    Threads,
    UnknownValue,
    read_map,
)
from pgm_places.cli.declarations import Argument, GivenOptions, Option, grouped
from pgm_places.cli.entry import EXIT_MAPS_FAILED
from pgm_places.cli.terminal import make_progress, say, say_next, say_written, shares_line
from pgm_places.errors import InputError
from pgm_places.labelling.options import LabelOptions, Outputs
from pgm_places.options import Positive, option_hints
from pgm_places.options.marks import Ge, Le
from pgm_places.spaces.entered_options import EnteredOptions

if TYPE_CHECKING:
    from pgm_places.batch.local_workers import Workers
    from pgm_places.batch.overview import Overview
    from pgm_places.labelling.model import LoadedModel
    from pgm_places.progress import Progress


@dataclass(frozen=True)
class WorkerOptions:
    """Flags of worker processes.

    Parameters
    ----------
    jobs
        Worker processes; one per core by default.
    scheduler : ADDRESS
        Dask cluster to run on instead.
    memory : SIZE
        Memory limit of each worker, such as 4GB.
    """

    jobs: Annotated[Annotated[int, Ge(1), Le(1024)] | None, Option("--jobs", "-j")] = None
    scheduler: str | None = None
    memory: str | None = None


def make_workers(
    options: WorkerOptions, n_tasks: int, n_threads: int | None
) -> tuple["Workers", int]:
    """The workers of the flags, and the threads of each."""
    from pgm_places.batch.dask_workers import DaskWorkers
    from pgm_places.batch.limits import LEAST_MEMORY, memory_bytes
    from pgm_places.batch.local_workers import LocalWorkers
    from pgm_places.kernels.threads import resolve_threads

    memory = None if options.memory is None else memory_bytes(options.memory)
    if options.scheduler is not None:
        if options.jobs is not None:
            raise InputError("--jobs cannot be combined with --scheduler")
        return DaskWorkers(options.scheduler, memory), n_threads or 1
    cores = resolve_threads()
    jobs = min(options.jobs or cores, max(n_tasks, 1))
    spare = cores // jobs if memory is None else min(cores // jobs, memory // LEAST_MEMORY)
    threads = n_threads or max(1, spare)
    return LocalWorkers(jobs, threads, memory), threads


_MOST_NAMES = 10


@dataclass(frozen=True)
class LabelFlags:
    """Flags other than the options of labelling.

    Parameters
    ----------
    maps
        map_server maps, folders to look through, or quoted patterns.
    corrections : FILE.png|FILE.geojson
        Known labels of a single map: a label image of its size, or polygons and lines in metres
        with a property 'class'. No method changes them.
    outputs : pictures,probabilities|none
        What to write besides labels and places; both by default.
    """

    maps: Annotated[list[str], Argument("MAP.yaml...")]
    out: Out
    corrections: Path | None = None
    outputs: str | None = None
    force: Force = False
    n_threads: Threads = None
    quiet: Quiet = False


@dataclass(frozen=True)
class BatchOptions:
    """Flags of a batch.

    Parameters
    ----------
    shard : I/N
        Of a batch, label only the I-th of N parts; for job arrays, from 1/N to N/N.
    time_limit_s : SECONDS
        Of a batch, stop labelling a map after this time.
    retry_failed
        Of a batch, label only the maps that failures.csv lists.
    dry_run
        Of a batch, list the maps that would be labelled and write nothing.
    """

    shard: str | None = None
    time_limit_s: Positive | None = None
    retry_failed: bool = False
    dry_run: bool = False


def label_many(
    flags: LabelFlags,
    options: LabelOptions,
    workers: WorkerOptions,
    batch: BatchOptions,
    progress: "Progress",
) -> None:
    """Label a batch of maps; exit with code 3 if one failed."""
    from pgm_places.batch.batch_folder import recorded_root
    from pgm_places.batch.found_maps import Shard, find_maps
    from pgm_places.batch.label_batch import label_batch, plan

    shard = None if batch.shard is None else Shard.named(batch.shard)
    chosen: dict[str, Any] = {"shard": shard, "only_failed": batch.retry_failed}
    inputs = find_maps(flags.maps, flags.out, root=recorded_root(flags.out))
    if inputs.n_passed_over:
        n = inputs.n_passed_over
        say(f"skipped {n:,} YAML file{_s(n)} without a key 'image'")
    if batch.dry_run:
        planned = plan(inputs, flags.out, options, **chosen)
        say(planned.summary())
        for title, names in planned.lists():
            say(f"{title}: {_first_of(names, len(names))}")
        return
    processes, threads = make_workers(workers, len(inputs.maps), flags.n_threads)
    done = label_batch(
        inputs,
        flags.out,
        options,
        processes,
        n_threads=threads,
        force=flags.force,
        limit_s=batch.time_limit_s,
        progress=progress,
        **chosen,
    )
    say(done.summary())
    for failure in done.failures:
        say(f"  {failure.name}: {failure.message}")
    if (n := done.n_failed - len(done.failures)) > 0:
        say(f"  and {n:,} more in failures.csv")
    _say_gone(done.overview)
    for path in done.written:
        say(f"wrote {path}")
    if done.overview.n_rows:
        say_next(f"open {shlex.quote(f'{flags.out}/index.html')} in a browser")
    if done.n_failed:
        raise SystemExit(EXIT_MAPS_FAILED)


def _first_of(names: Sequence[str], n: int) -> str:
    """The first names, and how many more there are."""
    more = f" and {n - _MOST_NAMES:,} more" if n > _MOST_NAMES else ""
    return ", ".join(names[:_MOST_NAMES]) + more


def _say_gone(overview: "Overview") -> None:
    if n := overview.n_gone:
        say(
            f"no longer in the input: {_first_of(overview.gone, n)}; results are kept until you "
            f"remove the folder{_s(n)}"
        )


def _s(n: int) -> str:
    return "" if n == 1 else "s"


def index(
    folder: Annotated[Path, Argument("DIR")],
    *,
    parquet: bool = False,
    force: Force = False,
    quiet: Quiet = False,
) -> None:
    """Rebuild index.html and the tables of a batch.

    Use it after several batches wrote to the folder, after a batch was killed, or after you removed
    maps. It rewrites index.html, summary.csv and failures.csv.

    Parameters
    ----------
    folder
        Folder or address of a batch of 'label'.
    parquet
        Also write places.parquet, with a row per place.
    """
    from pgm_places.batch.batch_folder import index_folder

    progress = make_progress(quiet=quiet)
    overview, written = index_folder(folder, parquet=parquet, force=force, progress=progress)
    failed = f", {overview.n_failures:,} failed" if overview.n_failures else ""
    say(f"{overview.n_rows:,} map{_s(overview.n_rows)} labelled{failed}")
    _say_gone(overview)
    for path in written:
        say(f"wrote {path}")


_SHARED = {"model": Model, "method": Method, "unknown_value": UnknownValue}


@declarations.option_flags(
    "entered", EnteredOptions, {"disc_radius_m": "--robot-radius"}, only_given=True
)
@grouped("batch", BatchOptions)
@grouped("workers", WorkerOptions)
@grouped("options", LabelOptions, without=("outputs", *option_hints(EnteredOptions)), of=_SHARED)
@grouped("flags", LabelFlags)
def label(
    *,
    flags: LabelFlags,
    options: LabelOptions,
    entered: GivenOptions[EnteredOptions],
    workers: WorkerOptions,
    batch: BatchOptions,
) -> None:
    """Label every free cell of a map, or of many.

    The results of one map go into the folder itself. Several maps, a folder, or any of --jobs,
    --scheduler, --memory and the batch options make a batch: each map gets its own folder, labelled
    maps are skipped, and index.html lists all. The exit code is 3 if a map could not be labelled.
    """
    from pgm_places.batch.found_maps import names_many
    from pgm_places.io.input_file import is_address

    outputs = options.outputs if flags.outputs is None else Outputs.named(flags.outputs)
    options = replace(options, outputs=outputs, **entered.values)
    progress, (first, *others) = make_progress(quiet=flags.quiet), flags.maps
    one = not (
        workers != WorkerOptions()
        or batch != BatchOptions()
        or is_address(first)
        or is_address(flags.out)
    )
    if one and not others and not names_many(first):
        _label_one(flags, options, progress)
        return
    if flags.corrections is not None:
        raise InputError(
            "--corrections applies to a single map and cannot be combined with a batch"
        )
    _read(options, progress)
    label_many(flags, options, workers, batch, progress)


def _label_one(flags: LabelFlags, options: LabelOptions, progress: "Progress") -> None:
    from pgm_places.batch.batch_folder import is_of_batch
    from pgm_places.labelling.files import label_files, write_labelled
    from pgm_places.labelling.label import label as label_grid
    from pgm_places.report.places_summary import places_summary

    if is_of_batch(flags.out) and not flags.force:
        raise InputError(
            f"{flags.out} has the results of a batch: choose another folder for this map, or "
            "add it to the batch with --jobs 1"
        )
    model = _read(options, progress)
    with progress.stage("map"):
        loaded = read_map(Path(flags.maps[0]), options.unknown_value, progress)
    observed = None
    if flags.corrections is not None:
        from pgm_places.teaching.paint import Paint

        observed = Paint.read(flags.corrections, loaded.grid, model.labeler.label_names_).labels
    labels = model.labeler.label_names
    with label_files(flags.out, labels, options.outputs, force=flags.force) as files:
        say(shares_line(loaded.fractions))
        written = write_labelled(
            label_grid(  # not bound to a name, so that the labels of a huge map can be freed
                model,
                loaded.grid,
                observed=observed,
                max_cells=options.max_cells,
                n_threads=flags.n_threads,
                progress=progress,
            ),
            loaded,
            files,
            model.rules,
            progress,
            outputs=options.outputs,
            n_threads=flags.n_threads,
        )
    say(f"{written.summary}\n{places_summary(written.topology, flags.out)}")
    if written.unentered is not None:
        say(f"{written.unentered}; label it with --unentered")
    say_written(files)
    paths = (flags.out, flags.out / "index.html", flags.maps[0])
    out, page, source = (shlex.quote(str(path)) for path in paths)
    say_next(
        f"open {page} in a browser",
        f"pgm-places studio {source}  # to correct the labels",
        f"pgm-places export {out} --to nav2 --out nav2  # --robot-radius 0.2, in metres",
    )


def _read(options: LabelOptions, progress: "Progress") -> "LoadedModel":
    """The model with the options applied; invalid flags are reported before the work."""
    from pgm_places.labelling.model import LoadedModel

    flags = {"doorways": "--doorways", "halls": "--halls", "doorway_depth_m": "--doorway-depth"}
    with declarations.named_as_flags(flags):
        model = LoadedModel.load(options)
    if options.halls is not None and not model.labeler.unary_model_.knows_halls:
        progress.warn("--halls: this model was not trained to tell halls from corridors")
    return model
