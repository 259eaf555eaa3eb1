"""``pgm-places track`` with a model of cells and steps: a drive labelled together with its map."""

import pgm_places as pp
from pgm_places.batch.map_files import write_labelled
from pgm_places.cli.flags import named_as_flags
from pgm_places.cli.terminal import make_progress, say, say_written
from pgm_places.cli.track_inputs import map_of
from pgm_places.cli.track_log import folder_for, read_log, summary, write
from pgm_places.cli.track_options import TrackOptions
from pgm_places.errors import ConfigError
from pgm_places.io.maps.map_server import MapFile
from pgm_places.io.output_set import output_set
from pgm_places.labelers.joint_labeler import label_map_and_drive
from pgm_places.labelers.label_map import LabelledPlaces
from pgm_places.labelers.tracking import Track
from pgm_places.persistence.stored import Stored
from pgm_places.progress import Progress
from pgm_places.report.outputs import TRACK, label_names
from pgm_places.report.topology_output import places_summary


def run_joint(stored: Stored, options: TrackOptions) -> None:
    """Label a complete log, and the map beneath it if there is one, which is written as well."""
    out, progress = folder_for(options), make_progress(quiet=options.quiet)
    labeler = _labeler(stored, options)
    source = map_of(options, progress)
    names: tuple[str, ...] = TRACK
    if source is not None:
        names = (*TRACK, *label_names(labeler.label_names_))
    with output_set(out, "track", names=names, force=options.force) as files:
        track, places = _labelled(labeler, source, options, progress)
        written = None
        if source is not None and places is not None:
            written = write_labelled(places, source, files, stored.rules, progress)
        with progress.stage("writing files"):
            write(track, None if source is None else source.grid, files.stage)
    say(summary(track))
    if written is not None:
        say(f"{written.summary}\n{places_summary(written.topology)}")
    say_written(files)


def _labeler(stored: Stored, options: TrackOptions) -> pp.JointLabeler:
    """The model with the options of the command; those for other models are refused."""
    labeler: pp.JointLabeler = stored.item
    if options.mode != "filter":
        raise ConfigError(
            f"--mode {options.mode} is for hidden Markov models; this model's method is "
            f"{type(labeler.method_).__name__}, which labels whole drives"
        )
    if options.map_labels is not None:
        raise ConfigError(
            "--map-labels is for models of drives alone; this one labels the map together with "
            "the drive: pass --map only"
        )
    if options.counts is not None:
        raise ConfigError("this model uses the laser only; omit --counts")
    changes = {"every_m": options.every_m, "beams__missing": options.beams}
    chosen = {name: value for name, value in changes.items() if value is not None}
    with named_as_flags({"missing": "--beams", "every_m": "--every"}):
        return labeler.with_steps(**chosen) if chosen else labeler


def _labelled(
    labeler: pp.JointLabeler, source: MapFile | None, options: TrackOptions, progress: Progress
) -> tuple[Track, LabelledPlaces | None]:
    """The labelled log, and the labelled map where there is one."""
    names = labeler.label_names_
    read = read_log(options, names, progress)
    drive = read.trajectory
    if source is None:
        steps = labeler.label(drive=drive, progress=progress).steps
        assert steps is not None  # there is a drive
        return Track(drive, steps, names, tuple(read.warnings)), None
    labelled = label_map_and_drive(labeler, source.grid, drive, progress=progress)
    warnings = (*read.warnings, *labelled.map.warnings)
    return Track(drive, labelled.steps, names, warnings), labelled.map
