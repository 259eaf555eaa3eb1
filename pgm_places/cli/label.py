"""``pgm-places label``: one map into a folder, or many, each into a folder of its own; index."""

import shlex
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from pgm_places._option_marks import Ge, Le
from pgm_places.cli import declarations
from pgm_places.cli.arguments import Force, Method, Model, Out, Quiet, Threads, UnknownValue
from pgm_places.cli.declarations import Argument, GivenOptions, Option, grouped
from pgm_places.cli.entry import EXIT_MAPS_FAILED
from pgm_places.cli.inputs import read_map
from pgm_places.cli.tables import shares_line
from pgm_places.cli.terminal import make_progress, say, say_next, say_written
from pgm_places.errors import InputError
from pgm_places.labelling.options import LabelOptions, Outputs
from pgm_places.options import Positive, option_hints
from pgm_places.spaces.entered_options import EnteredOptions

if TYPE_CHECKING:
    from pgm_places.batch.local_workers import Workers
    from pgm_places.batch.overview import Overview
    from pgm_places.labelling.model import LoadedModel
    from pgm_places.progress import Progress


@dataclass(frozen=True)
class WorkerOptions:
    """The flags; None where one was not given.

    Parameters
    ----------
    jobs
        Worker processes; one per core by default.
    scheduler : ADDRESS
        Hand the work to this Dask cluster instead.
    memory : SIZE
        Memory limit of each worker, such as 4GB.
    """

    jobs: Annotated[Annotated[int, Ge(1), Le(1024)] | None, Option("--jobs", "-j")] = None
    scheduler: str | None = None
    memory: str | None = None


def make_workers(
    options: WorkerOptions, n_tasks: int, n_threads: int | None
) -> tuple["Workers", int]:
    """The workers that the flags ask for, and the threads of each.

    Raises
    ------
    InputError
        The flags contradict each other, or name no size.
    """
    from pgm_places.batch.dask_workers import DaskWorkers
    from pgm_places.batch.limits import LEAST_MEMORY, memory_bytes
    from pgm_places.batch.local_workers import LocalWorkers
    from pgm_places.kernels.threads import resolve_threads

    memory = None if options.memory is None else memory_bytes(options.memory)
    if options.scheduler is not None:
        if options.jobs is not None:
            raise InputError("--jobs is for this machine; a cluster behind --scheduler has its own")
        return DaskWorkers(options.scheduler, memory), n_threads or 1
    cores = resolve_threads()
    jobs = min(options.jobs or cores, max(n_tasks, 1))
    spare = cores // jobs if memory is None else min(cores // jobs, memory // LEAST_MEMORY)
    threads = n_threads or max(1, spare)
    return LocalWorkers(jobs, threads, memory), threads


_MOST_NAMES = 10


@dataclass(frozen=True)
class LabelFlags:
    """The flags of one map and of many that do not belong to the options of labelling.

    Parameters
    ----------
    maps
        map_server maps, folders to look through, or quoted patterns.
    corrections : FILE.png|FILE.geojson
        Known labels of a single map: a label image of its size, or polygons and lines in metres
        with a property 'class'. Every method keeps them.
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
    """The flags that only a batch has.

    Parameters
    ----------
    shard : I/N
        Of a batch, label only the I-th of N parts; for job arrays, from 1/N to N/N.
    time_limit_s : SECONDS
        Of a batch, give up a map after so long.
    retry_failed
        Of a batch, label only the maps that failures.csv lists.
    dry_run
        Of a batch, only say what would be labelled; nothing is written.
    """

    shard: str | None = None
    time_limit_s: Positive | None = None
    retry_failed: bool = False
    dry_run: bool = False


def label_many(
    asked: LabelFlags,
    options: LabelOptions,
    workers: WorkerOptions,
    batch: BatchOptions,
    progress: "Progress",
) -> None:
    """Label the maps that are asked for; the exit code says whether one failed."""
    from pgm_places.batch.batch_folder import recorded_root
    from pgm_places.batch.found_maps import Shard, find_maps
    from pgm_places.batch.label_batch import label_batch, plan

    shard = None if batch.shard is None else Shard.named(batch.shard)
    chosen: dict[str, Any] = {"shard": shard, "only_failed": batch.retry_failed}
    found = find_maps(asked.maps, asked.out, root=recorded_root(asked.out))
    if found.n_passed_over:
        n = found.n_passed_over
        say(f"passed over {n:,} YAML file{_s(n)} without a key 'image'")
    if batch.dry_run:
        planned = plan(found, asked.out, options, **chosen)
        say(planned.summary())
        for title, names in planned.lists():
            say(f"{title}: {_first_of(names, len(names))}")
        return
    processes, threads = make_workers(workers, len(found.maps), asked.n_threads)
    done = label_batch(
        found,
        asked.out,
        options,
        processes,
        n_threads=threads,
        force=asked.force,
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
        say_next(f"open {shlex.quote(f'{asked.out}/index.html')} in a browser")
    if done.n_failed:
        raise SystemExit(EXIT_MAPS_FAILED)


def _first_of(names: Sequence[str], n: int) -> str:
    """The first of so many names."""
    more = f" and {n - _MOST_NAMES:,} more" if n > _MOST_NAMES else ""
    return ", ".join(names[:_MOST_NAMES]) + more


def _say_gone(overview: "Overview") -> None:
    if n := overview.n_gone:
        say(
            f"no longer in the input: {_first_of(overview.gone, n)}; "
            f"{'its results stay' if n == 1 else 'their results stay'} until you remove "
            f"{'the folder' if n == 1 else 'the folders'}"
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
    """List all labelled maps of a folder anew, from what lies in it.

    For folders that several batches have filled, of which some were killed, or from which maps were
    removed: index.html, summary.csv and failures.csv are written again.

    Parameters
    ----------
    folder
        Folder or address that 'label' wrote many maps to.
    parquet
        Write places.parquet as well: a row for each place of all maps.
    """
    from pgm_places.batch.batch_folder import index_folder

    found = index_folder(folder, parquet=parquet, force=force, progress=make_progress(quiet=quiet))
    failed = f", {found.overview.n_failures:,} failed" if found.overview.n_failures else ""
    say(f"{found.overview.n_rows:,} map{_s(found.overview.n_rows)} labelled{failed}")
    _say_gone(found.overview)
    for path in found.written:
        say(f"wrote {path}")


_SHARED = {"model": Model, "method": Method, "unknown_value": UnknownValue}


@declarations.option_flags("entered", EnteredOptions, only_given=True)
@grouped("batch", BatchOptions)
@grouped("workers", WorkerOptions)
@grouped("options", LabelOptions, without=("outputs", *option_hints(EnteredOptions)), of=_SHARED)
@grouped("asked", LabelFlags)
def label(
    *,
    asked: LabelFlags,
    options: LabelOptions,
    entered: GivenOptions[EnteredOptions],
    workers: WorkerOptions,
    batch: BatchOptions,
) -> None:
    """Label every free cell of a map, or of many.

    One map is labelled into the folder itself. Several maps, a folder, or any of --jobs,
    --scheduler, --memory and the options of a batch make one: each map gets its own folder, maps
    already labelled are kept, and index.html lists them all. The exit code is 3 if some map could
    not be labelled.
    """
    from pgm_places.batch.found_maps import names_many
    from pgm_places.io.input_file import is_address

    outputs = options.outputs if asked.outputs is None else Outputs.named(asked.outputs)
    options = replace(options, outputs=outputs, **entered.values)
    progress, (first, *others) = make_progress(quiet=asked.quiet), asked.maps
    one = not (
        workers != WorkerOptions()
        or batch != BatchOptions()
        or is_address(first)
        or is_address(asked.out)
    )
    if one and not others and not names_many(first):
        _label_one(asked, options, progress)
        return
    if asked.corrections is not None:
        raise InputError(
            "--corrections applies to a single map and cannot be combined with a batch"
        )
    _read(options, progress)
    label_many(asked, options, workers, batch, progress)


def _label_one(asked: LabelFlags, options: LabelOptions, progress: "Progress") -> None:
    from pgm_places.batch.batch_folder import is_of_batch
    from pgm_places.labelling.files import label_files, write_labelled
    from pgm_places.labelling.label import label as label_grid
    from pgm_places.report.places_summary import places_summary

    if is_of_batch(asked.out) and not asked.force:
        raise InputError(
            f"{asked.out} holds the results of many maps: choose another folder for this map, or "
            "label it among them with --jobs 1"
        )
    model = _read(options, progress)
    with progress.stage("map"):
        loaded = read_map(Path(asked.maps[0]), options.unknown_value, progress)
    observed = None
    if asked.corrections is not None:
        from pgm_places.teaching.paint import Paint

        observed = Paint.read(asked.corrections, loaded.grid, model.labeler.label_names_).labels
    labels = model.labeler.label_names
    with label_files(asked.out, labels, options.outputs, force=asked.force) as files:
        say(shares_line(loaded.fractions))
        found = write_labelled(
            label_grid(  # without a name here, so that the labels of a huge map can be freed
                model,
                loaded.grid,
                observed=observed,
                max_cells=options.max_cells,
                n_threads=asked.n_threads,
                progress=progress,
            ),
            loaded,
            files,
            model.rules,
            progress,
            outputs=options.outputs,
            n_threads=asked.n_threads,
        )
    say(f"{found.summary}\n{places_summary(found.topology, asked.out)}")
    if found.unentered is not None:
        say(f"{found.unentered}; label it with --unentered")
    say_written(files)
    paths = (asked.out, asked.out / "index.html", asked.maps[0])
    out, page, source = (shlex.quote(str(path)) for path in paths)
    say_next(
        f"open {page} in a browser",
        f"pgm-places studio {source}  # to correct the labels",
        f"pgm-places export {out} --to nav2 --out nav2  # --robot-radius 0.2, in metres",
    )


def _read(options: LabelOptions, progress: "Progress") -> "LoadedModel":
    """The model; what the flags get wrong shows now."""
    from pgm_places.labelling.model import LoadedModel

    flags = {"doorways": "--doorways", "halls": "--halls", "doorway_depth_m": "--doorway-depth"}
    with declarations.named_as_flags(flags):
        model = LoadedModel.load(options)
    if options.halls is not None and not model.labeler.unary_model_.knows_halls:
        progress.warn("--halls: this model was not trained to tell halls from corridors")
    return model
