"""``pgm-places track`` of a whole log: labelled, alone or with its map, written, summed up."""

from dataclasses import replace
from pathlib import Path

import pgm_places as pp
from pgm_places.batch.map_files import write_labelled
from pgm_places.cli.flags import named_as_flags
from pgm_places.cli.tables import text_table
from pgm_places.cli.terminal import make_progress, say, say_written
from pgm_places.cli.track_inputs import TrackInputs, map_of
from pgm_places.cli.track_options import TrackOptions
from pgm_places.errors import ConfigError
from pgm_places.io.logs.loaded_log import LoadedLog
from pgm_places.io.logs.pose_csv import with_truth
from pgm_places.io.logs.trajectories import read_trajectory
from pgm_places.io.maps.map_server import MapFile
from pgm_places.io.output_set import output_set
from pgm_places.labelers.joint_labeler import label_map_and_drive
from pgm_places.labelers.label_map import LabelledPlaces
from pgm_places.labelers.tracking import Track, map_of_scans
from pgm_places.maps.occupancy_grid import OccupancyGrid
from pgm_places.persistence.stored import Stored
from pgm_places.progress import Progress
from pgm_places.report.outputs import TRACK, label_names
from pgm_places.report.topology_output import places_summary
from pgm_places.report.track_page import write_track


def run_track(stored: Stored, options: TrackOptions) -> None:
    """Label a complete log with a model of drives, or one of maps."""
    out, progress = folder_for(options), make_progress(quiet=options.quiet)
    given = TrackInputs.of(stored, options, progress)
    with output_set(out, "track", names=TRACK, force=options.force) as files:
        track = _track(given, options, progress)
        with progress.stage("writing files"):
            write(track, given.grid, files.stage)
    say(summary(track))
    say_written(files)


def folder_for(options: TrackOptions) -> Path:
    """The folder for the results of a complete log; without one, or a log, the command ends."""
    if options.out is None:
        raise ConfigError("track needs a folder for its results: pass --out DIR")
    if str(options.log) == "-":
        raise ConfigError("standard input requires --follow; without it, name a log file")
    return options.out


def read_log(options: TrackOptions, names: tuple[str, ...], progress: Progress) -> LoadedLog:
    """A complete log, with its warnings on standard error, and its true places if they are named.

    ``names`` are the labels that the model knows.
    """
    with progress.stage("log"):
        read = read_trajectory(options.log, range_max_m=options.max_range_m)
    for message in read.warnings:
        progress.warn(message)
    if options.truth is None:
        return read
    return replace(read, trajectory=with_truth(read.trajectory, options.truth, names))


def _track(given: TrackInputs, options: TrackOptions, progress: Progress) -> Track:
    """The labelled log, with all warnings about it."""
    labeler, names = given.labeler, tuple(given.labeler.label_names)
    read = read_log(options, names, progress)
    trajectory, warnings = read.trajectory, list(read.warnings)
    extra = None
    if given.counts is not None:
        extra = given.counts.columns(trajectory.times_s)
        warnings += given.counts.complaints(trajectory.times_s)
    for message in warnings[len(read.warnings) :]:
        progress.warn(message)
    labeling = labeler.label(
        trajectory, known_map=given.grid, map_prior=given.prior, extra=extra, progress=progress
    )
    impossible = labeling.info.get("impossible", [])
    if impossible:
        warnings.append(
            f"{len(impossible)} observations (first at step {impossible[0]}) have probability 0 in "
            "this model and were skipped"
        )
    return Track(trajectory, labeling, names, tuple(warnings))


def write(track: Track, grid: OccupancyGrid | None, out: Path) -> None:
    """All files of a track, drawn on the map or on one of its scans."""
    drawn_on = map_of_scans(track.trajectory) if grid is None else grid
    write_track(track, drawn_on, out)


def summary(track: Track) -> str:
    """The visits, steps and metres of each place."""
    total = max(len(track.trajectory), 1)
    rows = [["place", "visits", "steps", "share", "metres"]]
    rows += [
        [name, f"{visits}", f"{steps}", f"{100 * steps / total:.1f} %", f"{metres:.1f}"]
        for name, visits, steps, metres in track.totals()
    ]
    lines = [text_table(rows)]
    if track.accuracy is not None:
        lines.append(f"{100 * track.accuracy:.1f} % of the labels are correct")
    return "\n".join(lines)


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
