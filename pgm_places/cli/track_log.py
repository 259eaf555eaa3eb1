"""``pgm-places track`` of a complete log, with or without its map."""

import shlex
from dataclasses import dataclass, replace
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

import pgm_places as pp
from pgm_places.cli.arguments import read_map
from pgm_places.cli.declarations import named_as_flags
from pgm_places.cli.terminal import make_progress, say, say_next, say_written, text_table
from pgm_places.cli.track_options import TrackOptions
from pgm_places.errors import ConfigError
from pgm_places.features.object_counts import ObjectCounts
from pgm_places.io.logs.log_files import LoadedLog
from pgm_places.io.logs.object_counts import read_object_counts
from pgm_places.io.logs.pose_csv import with_truth
from pgm_places.io.logs.trajectories import read_trajectory
from pgm_places.io.maps.map_server import MapFile
from pgm_places.io.output_set import output_set
from pgm_places.labelers.labelled_places import LabelledPlaces
from pgm_places.labelers.map_prior import MapPrior
from pgm_places.labelers.tracking import Track, map_of_scans
from pgm_places.labelling.files import TRACK, output_file_names, write_labelled
from pgm_places.labelling.label import label_map_and_drive
from pgm_places.maps.occupancy_grid import OccupancyGrid
from pgm_places.models.hmm import HiddenMarkovModel
from pgm_places.persistence.map_prior import LabelledMapFolder, read_labelled_map
from pgm_places.persistence.stored import Stored, read
from pgm_places.progress import Progress
from pgm_places.report.places_summary import places_summary
from pgm_places.report.track_page import write_track
from pgm_places.sensing.map_agreement import check_agreement
from pgm_places.spaces.entered_options import EnteredOptions
from pgm_places.trained import DEFAULT, TRACKING, model_folder

MOST_CHANGED = 0.01
"""Largest change of a transition probability by ``--every`` without a warning."""


def stored_model(options: TrackOptions) -> Stored:
    """The model of the options; by default the one for maps if there is a map, else for drives."""
    default = TRACKING if options.map_yaml is None else DEFAULT
    folder = model_folder(options.model or default)
    return read(folder, "place-labeler", "trajectory-labeler", "joint-labeler")


def track_labeler(
    stored: Stored, options: TrackOptions, progress: Progress
) -> pp.TrajectoryLabeler:
    """The labeler of a stored model, with the options of the command."""
    labeler = stored.item
    if stored.kind == "place-labeler":  # stores the tracking parameters, too
        labeler = pp.TrajectoryLabeler.from_places(labeler)
    if isinstance(labeler.method_, HiddenMarkovModel):
        labeler = _changed(labeler, method__mode=options.mode)
    elif options.mode != "filter":
        raise ConfigError(
            f"--mode {options.mode} is for hidden Markov models; this model's method is "
            f"{type(labeler.method_).__name__}"
        )
    chosen = options.beams or (options.map_yaml and "known-map")
    if chosen is not None:
        labeler = _changed(labeler, beams__missing=chosen)
    if options.every_m is not None:
        with named_as_flags({"every_m": "--every"}):
            labeler, changed = labeler.updated_every(options.every_m)
        if changed > MOST_CHANGED:
            progress.warn(
                f"--every {options.every_m:g}: the model's transitions can only be rescaled "
                f"approximately (error of a probability: up to {changed:.3f}); for the best "
                "labels, train a model at this distance"
            )
    return labeler


def _changed(labeler: pp.TrajectoryLabeler, **options: object) -> pp.TrajectoryLabeler:
    """The labeler with other options; option errors name the flags."""
    with named_as_flags({"mode": "--mode", "missing": "--beams", "every_m": "--every"}):
        return labeler.with_options(**options)


def map_of(options: TrackOptions, progress: Progress) -> MapFile | None:
    """The map of ``--map``, or None; prints its warnings."""
    if options.map_yaml is None:
        return None
    return read_map(options.map_yaml, options.unknown_value, progress)


@dataclass(frozen=True)
class CountColumns:
    """Object counts of a camera, as extra feature columns of the model."""

    counts: ObjectCounts
    names: tuple[str, ...]
    within_s: float

    def columns(self, times_s: ArrayLike) -> NDArray[np.float32]:
        """(T, D) object counts at T scan times."""
        return self.counts.at(times_s, within_s=self.within_s, object_names=self.names)

    def complaints(self, times_s: ArrayLike) -> list[str]:
        """Warnings about counts that match no scan."""
        if (self.counts.seconds_from(times_s) <= self.within_s).any():
            return []
        return [
            f"no object counts within {self.within_s:g} s of any scan: do the log and the counts "
            "use the same clock? (--counts-within)"
        ]


def count_columns(
    options: TrackOptions, labeler: pp.TrajectoryLabeler, progress: Progress
) -> CountColumns | None:
    """The object counts of ``--counts``, if the model was trained with any."""
    names = labeler.scan_model_.extra_names
    if options.counts is None and names:
        raise ConfigError(
            f"this model also uses counts of {', '.join(names)}; pass them: --counts FILE"
        )
    if options.counts is None:
        return None
    if not names:
        raise ConfigError("this model uses the laser only; omit --counts")
    counts = read_object_counts(options.counts)
    missing = [name for name in names if name not in counts.object_names]
    if len(missing) == len(names):
        raise ConfigError(
            f"{options.counts} has none of the objects that the model uses "
            f"({', '.join(names)}); it has {', '.join(counts.object_names)}"
        )
    if missing:
        progress.warn(f"{options.counts} has no {', '.join(missing)}: counted as 0")
    return CountColumns(counts, names, options.counts_within_s)


class TrackInputs(NamedTuple):
    """Inputs of ``track`` besides the log: the labeler, and the map in the frame of the log.

    ``known`` is the labelled map of ``--map-labels``; ``counts`` are object counts, if the model
    was trained with any.
    """

    labeler: pp.TrajectoryLabeler
    grid: pp.OccupancyGrid | None
    known: LabelledMapFolder | None
    counts: CountColumns | None

    @classmethod
    def of(cls, stored: Stored, options: TrackOptions, progress: Progress) -> "TrackInputs":
        """Read the inputs of the options."""
        labeler, source = track_labeler(stored, options, progress), map_of(options, progress)
        known = None
        if options.map_labels is not None:
            known = read_labelled_map(options.map_labels, labeler.label_names)
        counts = count_columns(options, labeler, progress)
        return cls(labeler, None if source is None else source.grid, known, counts)

    @property
    def prior(self) -> MapPrior | None:
        """Label probabilities at positions, from the labelled map."""
        return None if self.known is None else self.known.prior

    @property
    def drawn_map(self) -> pp.OccupancyGrid | None:
        """The map to draw on: the one of ``--map``, else the labelled one."""
        known = None if self.known is None else self.known.places.grid
        return known if self.grid is None else self.grid

    def misfit(self, drive: pp.Trajectory, options: TrackOptions) -> list[str]:
        """A warning if the drive fits the map poorly; a bad fit is an error."""
        grid = self.drawn_map
        name = options.map_yaml or options.map_labels
        return [] if grid is None else misfit(grid, drive, f"{name}", options)


def run_track(stored: Stored, options: TrackOptions) -> None:
    """Label a complete log."""
    out, progress = folder_for(options), make_progress(quiet=options.quiet)
    inputs = TrackInputs.of(stored, options, progress)
    with output_set(out, "track", names=TRACK, force=options.force) as files:
        track = _track(inputs, options, progress)
        with progress.stage("writing files"):
            write(track, inputs.grid, files.stage)
    say(summary(track))
    say_written(files)
    say_next(f"open {shlex.quote(str(out / 'report.html'))} in a browser")


def misfit(
    grid: OccupancyGrid, drive: pp.Trajectory, map_name: str, options: TrackOptions
) -> list[str]:
    """A warning if a drive fits a map poorly; a bad fit is an error without --force."""
    otherwise = "--force labels it anyway"
    message = check_agreement(grid, drive, map_name, force=options.force, otherwise=otherwise)
    return [] if message is None else [message]


def folder_for(options: TrackOptions) -> Path:
    """The output folder of a complete log."""
    if options.out is None:
        raise ConfigError("track needs a folder for its results: pass --out DIR")
    if str(options.log) == "-":
        raise ConfigError("standard input requires --follow; without it, name a log file")
    return options.out


def read_log(options: TrackOptions, names: tuple[str, ...], progress: Progress) -> LoadedLog:
    """A complete log, with true labels if ``--truth`` names them; prints its warnings."""
    with progress.stage("log"):
        read = read_trajectory(options.log, range_max_m=options.max_range_m)
    for message in read.warnings:
        progress.warn(message)
    if options.truth is None:
        return read
    return replace(read, trajectory=with_truth(read.trajectory, options.truth, names))


def _track(inputs: TrackInputs, options: TrackOptions, progress: Progress) -> Track:
    """The labelled log, with all warnings about it."""
    labeler, names = inputs.labeler, tuple(inputs.labeler.label_names)
    read = read_log(options, names, progress)
    trajectory, warnings = read.trajectory, list(read.warnings)
    warnings += inputs.misfit(trajectory, options)
    extra = None
    if inputs.counts is not None:
        extra = inputs.counts.columns(trajectory.times_s)
        warnings += inputs.counts.complaints(trajectory.times_s)
    for message in warnings[len(read.warnings) :]:
        progress.warn(message)
    labeling = labeler.label(
        trajectory, known_map=inputs.grid, map_prior=inputs.prior, extra=extra, progress=progress
    )
    impossible = labeling.info.get("impossible", [])
    if impossible:
        warnings.append(
            f"{len(impossible)} observations (first at step {impossible[0]}) have probability 0 in "
            "this model and were skipped"
        )
    return Track(trajectory, labeling, names, tuple(warnings))


def write(track: Track, grid: OccupancyGrid | None, out: Path) -> None:
    """Write all files of a track, drawn on the map or on a map of its scans."""
    drawn_on = map_of_scans(track.trajectory) if grid is None else grid
    write_track(track, drawn_on, out)


def summary(track: Track) -> str:
    """A table of visits, steps and metres per label."""
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
    """Label a complete log together with its map, if there is one."""
    out, progress = folder_for(options), make_progress(quiet=options.quiet)
    labeler = _labeler(stored, options)
    source = map_of(options, progress)
    names: tuple[str, ...] = TRACK
    if source is not None:
        names = (*TRACK, *output_file_names(labeler.label_names_))
    with output_set(out, "track", names=names, force=options.force) as files:
        track, places = _labelled(labeler, stored.entered, source, options, progress)
        written = None
        if source is not None and places is not None:
            written = write_labelled(places, source, files, stored.rules, progress)
        with progress.stage("writing files"):
            write(track, None if source is None else source.grid, files.stage)
    say(summary(track))
    if written is not None:
        say(f"{written.summary}\n{places_summary(written.topology)}")
    say_written(files)
    pages = ("report.html",) if written is None else ("report.html", "index.html")
    say_next(*(f"open {shlex.quote(str(out / page))} in a browser" for page in pages))


def _labeler(stored: Stored, options: TrackOptions) -> pp.JointLabeler:
    """The model with the options of the command; unsuitable options are errors."""
    labeler: pp.JointLabeler = stored.item
    if options.mode != "filter":
        raise ConfigError(
            f"--mode {options.mode} is for hidden Markov models; this model's method is "
            f"{type(labeler.method_).__name__}, which labels complete drives"
        )
    if options.map_labels is not None:
        raise ConfigError(
            "--map-labels requires a model of drives; this model labels the map together with "
            "the drive: pass --map instead"
        )
    if options.counts is not None:
        raise ConfigError("this model uses the laser only; omit --counts")
    changes = {"every_m": options.every_m, "beams__missing": options.beams}
    chosen = {name: value for name, value in changes.items() if value is not None}
    with named_as_flags({"missing": "--beams", "every_m": "--every"}):
        return labeler.with_steps(**chosen) if chosen else labeler


def _labelled(
    labeler: pp.JointLabeler,
    entered: EnteredOptions,
    source: MapFile | None,
    options: TrackOptions,
    progress: Progress,
) -> tuple[Track, LabelledPlaces | None]:
    """The labelled log, and the labelled map if there is a map."""
    names = labeler.label_names_
    read = read_log(options, names, progress)
    drive = read.trajectory
    if source is None:
        steps = labeler.label(drive=drive, progress=progress).steps
        assert steps is not None  # there is a drive
        return Track(drive, steps, names, tuple(read.warnings)), None
    poor = misfit(source.grid, drive, f"{options.map_yaml}", options)
    for message in poor:
        progress.warn(message)
    labelled = label_map_and_drive(labeler, source.grid, drive, entered=entered, progress=progress)
    warnings = (*read.warnings, *poor, *labelled.map.warnings)
    return Track(drive, labelled.steps, names, warnings), labelled.map
