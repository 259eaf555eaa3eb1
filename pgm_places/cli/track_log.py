"""``pgm-places track`` of a whole log: labelled, alone or with its map, written, summed up."""

import shlex
from dataclasses import dataclass, replace
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

import pgm_places as pp
from pgm_places.cli.declarations import named_as_flags
from pgm_places.cli.inputs import read_map
from pgm_places.cli.tables import text_table
from pgm_places.cli.terminal import make_progress, say, say_next, say_written
from pgm_places.cli.track_options import TrackOptions
from pgm_places.errors import ConfigError
from pgm_places.io.logs.loaded_log import LoadedLog
from pgm_places.io.logs.object_counts import read_object_counts
from pgm_places.io.logs.pose_csv import with_truth
from pgm_places.io.logs.trajectories import read_trajectory
from pgm_places.io.maps.map_server import MapFile
from pgm_places.io.output_set import output_set
from pgm_places.labelers.label_joint import label_map_and_drive
from pgm_places.labelers.labelled_places import LabelledPlaces
from pgm_places.labelers.map_prior import MapPrior
from pgm_places.labelers.tracking import Track, map_of_scans
from pgm_places.labelling.files import TRACK, output_file_names, write_labelled
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
from pgm_places.vision.object_counts import ObjectCounts

MOST_CHANGED = 0.01
"""Change of a transition, made so that it can be rescaled, that nobody needs to know of."""


def stored_model(options: TrackOptions) -> Stored:
    """The model that is named, or the default one, of a kind that labels drives."""
    # The shipped model of maps where there is one to cast scans in, else that of drives.
    usual = TRACKING if options.map_yaml is None else DEFAULT
    folder = model_folder(options.model or usual)
    return read(folder, "place-labeler", "trajectory-labeler", "joint-labeler")


def track_labeler(
    stored: Stored, options: TrackOptions, progress: Progress
) -> pp.TrajectoryLabeler:
    """The labeler of a stored model, with the options of the command."""
    labeler = stored.item
    if stored.kind == "place-labeler":  # with what it knows of moving robots
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
                f"--every {options.every_m:g}: the transitions of this model are not exactly "
                "those of any continuous motion; the nearest that are differ by up to "
                f"{changed:.3f} in a probability. For the best labels, train a model at this "
                "distance"
            )
    return labeler


def _changed(labeler: pp.TrajectoryLabeler, **options: object) -> pp.TrajectoryLabeler:
    """The labeler with other options; what it refuses is named by its flag."""
    with named_as_flags({"mode": "--mode", "missing": "--beams", "every_m": "--every"}):
        return labeler.with_options(**options)


def map_of(options: TrackOptions, progress: Progress) -> MapFile | None:
    """The map in the frame of the log, if one is named, with its warnings on standard error."""
    if options.map_yaml is None:
        return None
    return read_map(options.map_yaml, options.unknown_value, progress)


@dataclass(frozen=True)
class Seen:
    """The objects that a camera saw, as the columns that the model wants."""

    counts: ObjectCounts
    names: tuple[str, ...]
    within_s: float

    def columns(self, times_s: ArrayLike) -> NDArray[np.float32]:
        """(T, D) counts at the times of T scans."""
        return self.counts.at(times_s, within_s=self.within_s, object_names=self.names)

    def complaints(self, times_s: ArrayLike) -> list[str]:
        """Warnings about them."""
        if (self.counts.seconds_from(times_s) <= self.within_s).any():
            return []
        return [
            f"no object counts within {self.within_s:g} s of any scan: do the log and the counts "
            "use the same clock? (--counts-within)"
        ]


def seen_objects(
    options: TrackOptions, labeler: pp.TrajectoryLabeler, progress: Progress
) -> Seen | None:
    """The counts of objects, if the model learned with any."""
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
        progress.warn(f"{options.counts} has no {', '.join(missing)}: counted as never seen")
    return Seen(counts, names, options.counts_within_s)


class TrackInputs(NamedTuple):
    """What a log is labelled with.

    Parameters
    ----------
    labeler : TrajectoryLabeler
    grid : OccupancyGrid or None
        The map in the frame of the log.
    known : LabelledMapFolder or None
        The map that was labelled beforehand.
    counts : Seen or None
        Objects, if the model learned with any.
    """

    labeler: pp.TrajectoryLabeler
    grid: pp.OccupancyGrid | None
    known: LabelledMapFolder | None
    counts: Seen | None

    @classmethod
    def of(cls, stored: Stored, options: TrackOptions, progress: Progress) -> "TrackInputs":
        """Those that the options name."""
        labeler, source = track_labeler(stored, options, progress), map_of(options, progress)
        known = None
        if options.map_labels is not None:
            known = read_labelled_map(options.map_labels, labeler.label_names)
        counts = seen_objects(options, labeler, progress)
        return cls(labeler, None if source is None else source.grid, known, counts)

    @property
    def prior(self) -> MapPrior | None:
        """How probable each label is at positions, by the map that was labelled beforehand."""
        return None if self.known is None else self.known.prior

    @property
    def drawn_map(self) -> pp.OccupancyGrid | None:
        """The map, or the one that was labelled beforehand."""
        known = None if self.known is None else self.known.places.grid
        return known if self.grid is None else self.grid

    def misfit(self, drive: pp.Trajectory, options: TrackOptions) -> list[str]:
        """A warning where the drive does not fit the map; a drive that fits it badly is refused."""
        grid = self.drawn_map
        name = options.map_yaml or options.map_labels
        return [] if grid is None else misfit(grid, drive, f"{name}", options)


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
    say_next(f"open {shlex.quote(str(out / 'report.html'))} in a browser")


def misfit(
    grid: OccupancyGrid, drive: pp.Trajectory, map_name: str, options: TrackOptions
) -> list[str]:
    """A warning where a drive does not fit a map; below half of it, only with --force."""
    otherwise = "--force labels it all the same"
    message = check_agreement(grid, drive, map_name, force=options.force, otherwise=otherwise)
    return [] if message is None else [message]


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
    warnings += given.misfit(trajectory, options)
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
    labeler: pp.JointLabeler,
    entered: EnteredOptions,
    source: MapFile | None,
    options: TrackOptions,
    progress: Progress,
) -> tuple[Track, LabelledPlaces | None]:
    """The labelled log, and the labelled map where there is one."""
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
