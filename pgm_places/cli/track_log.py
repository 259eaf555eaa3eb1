"""``pgm-places track`` of a whole log: labelled, written, summed up."""

from dataclasses import replace
from pathlib import Path

from pgm_places.cli.tables import text_table
from pgm_places.cli.terminal import make_progress, say, say_written
from pgm_places.cli.track_inputs import TrackInputs
from pgm_places.cli.track_options import TrackOptions
from pgm_places.errors import ConfigError
from pgm_places.io.logs.loaded_log import LoadedLog
from pgm_places.io.logs.pose_csv import with_truth
from pgm_places.io.logs.trajectories import read_trajectory
from pgm_places.io.output_set import output_set
from pgm_places.labelers.tracking import Track, map_of_scans
from pgm_places.maps.occupancy_grid import OccupancyGrid
from pgm_places.persistence.stored import Stored
from pgm_places.progress import Progress
from pgm_places.report.outputs import TRACK
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
