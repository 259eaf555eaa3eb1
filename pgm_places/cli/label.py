"""``pgm-places label``: one map into a folder, or many, each into a folder of its own."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from pgm_places.cli.arguments import Force, Method, Model, Out, Quiet, Threads, UnknownValue
from pgm_places.cli.declarations import Argument
from pgm_places.cli.flags import GivenOptions, grouped, named_as_flags, option_flags
from pgm_places.cli.inputs import read_map
from pgm_places.cli.label_many import (
    BatchOptions,
    WorkerOptions,
    label_many,
)
from pgm_places.cli.progress import make_progress
from pgm_places.cli.tables import shares_line
from pgm_places.cli.terminal import say, say_written
from pgm_places.errors import InputError
from pgm_places.options import Positive, Whole
from pgm_places.spaces.entered_options import EnteredOptions

if TYPE_CHECKING:
    from pgm_places.batch.ready_model import LabelOptions, ReadyModel
    from pgm_places.progress import Progress


@option_flags("entered", EnteredOptions, only_given=True)
@grouped("batch", BatchOptions)
@grouped("workers", WorkerOptions)
def label(
    maps: Annotated[list[str], Argument("MAP.yaml...")],
    out: Out,
    model: Model = "default",
    method: Method = None,
    doorways: str | None = None,
    halls: str | None = None,
    doorway_depth_m: Positive | None = None,
    *,
    entered: GivenOptions[EnteredOptions],
    corrections: Path | None = None,
    unknown_value: UnknownValue = None,
    max_cells: Whole | None = None,
    workers: WorkerOptions,
    batch: BatchOptions,
    outputs: str | None = None,
    force: Force = False,
    n_threads: Threads = None,
    quiet: Quiet = False,
) -> None:
    """Label every free cell of a map, or of many.

    One map is labelled into the folder itself. Several maps, a folder, or any of --jobs,
    --scheduler, --memory and the options of a batch make one: each map gets its own folder, maps
    already labelled are kept, and index.html lists them all. The exit code is 3 if some map could
    not be labelled.

    Parameters
    ----------
    maps
        map_server maps, folders to look through, or quoted patterns.
    doorways : gates|labels
        What separates places: gates, if the model finds any, or cells labelled as doorways; by
        default, as set in the model's [topology].
    halls : corridor|room|hall
        What lobbies, foyers and other halls are labelled, if the model knows them; by default, as
        set in the model's [labels].
    doorway_depth_m : M
        How deep doorways are labelled along the passage; by default, as in the maps that the model
        learned from (m).
    corrections : FILE.png|FILE.geojson
        Known labels of a single map: a label image of its size, or polygons and lines in metres
        with a property 'class'. Every method keeps them.
    max_cells
        Largest number of cells that a map coarser than the model is split into; 100 million by
        default.
    outputs : pictures,probabilities|none
        What to write besides labels and places; both by default.
    """
    from pgm_places.batch.found_maps import names_many
    from pgm_places.batch.ready_model import LabelOptions
    from pgm_places.io.input_file import is_address
    from pgm_places.report.outputs import Outputs

    options = LabelOptions(
        model=model,
        method=method,
        doorways=doorways,
        halls=halls,
        doorway_depth_m=doorway_depth_m,
        unknown_value=unknown_value,
        max_cells=max_cells,
        outputs=Outputs() if outputs is None else Outputs.named(outputs),
        **entered.values,
    )
    progress = make_progress(quiet=quiet)
    asked = workers.given or batch.given or is_address(maps[0]) or is_address(out)
    if len(maps) == 1 and not asked and not names_many(maps[0]):
        _label_one(
            Path(maps[0]),
            out,
            options,
            corrections,
            force=force,
            n_threads=n_threads,
            progress=progress,
        )
        return
    if corrections is not None:
        raise InputError("--corrections are those of one map; label it by itself, not in a batch")
    _read(options, progress)
    label_many(
        maps, out, options, workers, batch, force=force, n_threads=n_threads, progress=progress
    )


def _label_one(
    map_yaml: Path,
    out: Path,
    options: "LabelOptions",
    corrections: Path | None,
    *,
    force: bool,
    n_threads: int | None,
    progress: "Progress",
) -> None:
    from pgm_places.batch.map_files import label_file
    from pgm_places.io.output_set import output_set
    from pgm_places.report.outputs import label_names
    from pgm_places.report.topology_output import places_summary

    model = _read(options, progress)
    with progress.stage("map"):
        loaded = read_map(map_yaml, options.unknown_value, progress)
    known = None
    if corrections is not None:
        from pgm_places.teaching.paint import Paint

        known = Paint.read(corrections, loaded.grid, model.labeler.label_names_).labels
    names = label_names(model.labeler.label_names, options.outputs)
    with output_set(out, "label", names=names, force=force) as files:
        say(shares_line(loaded.fractions))
        found = label_file(
            model,
            loaded,
            files,
            known=known,
            max_cells=options.max_cells,
            outputs=options.outputs,
            n_threads=n_threads,
            progress=progress,
        )
    say(f"{found.summary}\n{places_summary(found.topology, out)}")
    if found.unentered is not None:
        say(f"{found.unentered}; label it with --unentered")
    say_written(files)


def _read(options: "LabelOptions", progress: "Progress") -> "ReadyModel":
    """The model; what the flags get wrong shows now."""
    from pgm_places.batch.ready_model import ready_model

    flags = {"doorways": "--doorways", "halls": "--halls", "doorway_depth_m": "--doorway-depth"}
    with named_as_flags(flags):
        model = ready_model(options)
    if options.halls is not None and not model.labeler.unary_model_.knows_halls:
        progress.warn("--halls: this model was not trained to tell halls from corridors")
    return model
