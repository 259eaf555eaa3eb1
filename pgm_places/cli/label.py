"""``pgm-places label``: one map into a folder, or many, each into a folder of its own."""

from pathlib import Path
from typing import TYPE_CHECKING

from pgm_places.cli.declarations import GivenOptions, grouped, named_as_flags, option_flags
from pgm_places.cli.inputs import read_map
from pgm_places.cli.label_many import BatchOptions, LabelFlags, WorkerOptions, label_many
from pgm_places.cli.tables import shares_line
from pgm_places.cli.terminal import make_progress, say, say_written
from pgm_places.errors import InputError
from pgm_places.spaces.entered_options import EnteredOptions

if TYPE_CHECKING:
    from pgm_places.batch.ready_model import LabelOptions, ReadyModel
    from pgm_places.progress import Progress

_OF_MODEL = ("model", "method", "doorways", "halls", "doorway_depth_m", "unknown_value")


@option_flags("entered", EnteredOptions, only_given=True)
@grouped("batch", BatchOptions)
@grouped("workers", WorkerOptions)
@grouped("asked", LabelFlags)
def label(
    asked: LabelFlags,
    *,
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
    from pgm_places.batch.ready_model import LabelOptions
    from pgm_places.io.input_file import is_address
    from pgm_places.report.label_files import Outputs

    options = LabelOptions(
        **{name: getattr(asked, name) for name in _OF_MODEL},
        max_cells=asked.max_cells,
        outputs=Outputs() if asked.outputs is None else Outputs.named(asked.outputs),
        **entered.values,
    )
    progress, (first, *others) = make_progress(quiet=asked.quiet), asked.maps
    one = not (workers.given or batch.given or is_address(first) or is_address(asked.out))
    if one and not others and not names_many(first):
        _label_one(asked, options, progress)
        return
    if asked.corrections is not None:
        raise InputError("--corrections are those of one map; label it by itself, not in a batch")
    _read(options, progress)
    label_many(asked, options, workers, batch, progress)


def _label_one(asked: LabelFlags, options: "LabelOptions", progress: "Progress") -> None:
    from pgm_places.batch.map_files import label_file
    from pgm_places.io.output_set import output_set
    from pgm_places.report.label_files import label_names, places_summary

    model = _read(options, progress)
    with progress.stage("map"):
        loaded = read_map(Path(asked.maps[0]), options.unknown_value, progress)
    known = None
    if asked.corrections is not None:
        from pgm_places.teaching.paint import Paint

        known = Paint.read(asked.corrections, loaded.grid, model.labeler.label_names_).labels
    names = label_names(model.labeler.label_names, options.outputs)
    with output_set(asked.out, "label", names=names, force=asked.force) as files:
        say(shares_line(loaded.fractions))
        found = label_file(
            model,
            loaded,
            files,
            known=known,
            max_cells=options.max_cells,
            outputs=options.outputs,
            n_threads=asked.n_threads,
            progress=progress,
        )
    say(f"{found.summary}\n{places_summary(found.topology, asked.out)}")
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
