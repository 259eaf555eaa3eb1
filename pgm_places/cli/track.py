"""``pgm-places track``: label a whole log, or one that is still being written."""

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from pgm_places.cli.flags import named_as_flags
from pgm_places.cli.progress import make_progress
from pgm_places.cli.tables import text_table
from pgm_places.cli.terminal import say, say_written
from pgm_places.errors import ConfigError

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import ArrayLike, NDArray

    from pgm_places.io.logs.loaded_log import LoadedLog
    from pgm_places.labelers.tracking import Track
    from pgm_places.labelers.trajectory_labeler import TrajectoryLabeler
    from pgm_places.maps.occupancy_grid import OccupancyGrid
    from pgm_places.persistence.map_prior import LabelledMapFolder
    from pgm_places.persistence.stored import Stored
    from pgm_places.progress import Progress
    from pgm_places.trajectories.trajectory import Trajectory
    from pgm_places.vision.object_counts import ObjectCounts

__all__ = [
    "Seen",
    "TrackOptions",
    "folder_for",
    "labelled_map",
    "map_of",
    "read_log",
    "run_track",
    "seen_objects",
    "stored_model",
    "summary",
    "track_labeler",
    "with_truth",
    "write",
]

MOST_CHANGED = 0.01
"""Change of a transition, made so that it can be rescaled, that nobody needs to know of."""


@dataclass(frozen=True)
class TrackOptions:
    """The options of the command, besides the log and the folder."""

    model: str | None
    map_yaml: Path | None = None
    mode: str = "filter"
    beams: str | None = None
    every_m: float | None = None
    max_range_m: float | None = None
    truth: Path | None = None
    counts: Path | None = None
    counts_within_s: float = 5.0
    map_labels: Path | None = None


def run_track(
    stored: "Stored",
    log: Path,
    out: Path | None,
    options: TrackOptions,
    *,
    force: bool,
    quiet: bool,
) -> None:
    """Label a complete log with a model of drives, or one of maps."""
    from pgm_places.io.output_set import output_set
    from pgm_places.report.file_names import TRACK

    out, progress = folder_for(log, out), make_progress(quiet=quiet)
    labeler = track_labeler(stored, options, progress)
    grid, known = map_of(options), labelled_map(options, labeler)
    counts = seen_objects(options, labeler, progress)
    with output_set(out, "track", names=TRACK, force=force) as files:
        read = read_log(log, options, progress)
        track = _track(read, labeler, grid, known, counts, options, progress)
        with progress.stage("writing files"):
            write(track, grid, files.stage)
    say(summary(track))
    say_written(files)


def folder_for(log: Path, out: Path | None) -> Path:
    """The folder for the results of a complete log; without one, or a log, the command ends."""
    if out is None:
        raise ConfigError("track needs a folder for its results: pass --out DIR")
    if str(log) == "-":
        raise ConfigError("standard input requires --follow; without it, name a log file")
    return out


def read_log(log: Path, options: TrackOptions, progress: "Progress") -> "LoadedLog":
    """A complete log, with its warnings on standard error."""
    from pgm_places.io.logs.trajectories import read_trajectory

    with progress.stage("log"):
        read = read_trajectory(log, range_max_m=options.max_range_m)
    for message in read.warnings:
        progress.warn(message)
    return read


def _track(
    read: "LoadedLog",
    labeler: "TrajectoryLabeler",
    grid: "OccupancyGrid | None",
    known: "LabelledMapFolder | None",
    counts: "Seen | None",
    options: TrackOptions,
    progress: "Progress",
) -> "Track":
    """The labelled log, with all warnings about it."""
    from pgm_places.labelers.tracking import Track

    trajectory = with_truth(read.trajectory, options, tuple(labeler.label_names))
    warnings = list(read.warnings)
    extra = None
    if counts is not None:
        extra = counts.columns(trajectory.times_s)
        warnings += counts.complaints(trajectory.times_s)
    for message in warnings[len(read.warnings) :]:
        progress.warn(message)
    labeling = labeler.label(
        trajectory,
        known_map=grid,
        map_prior=None if known is None else known.prior,
        extra=extra,
        progress=progress,
    )
    impossible = labeling.info.get("impossible", [])
    if impossible:
        warnings.append(
            f"{len(impossible)} observations (first at step {impossible[0]}) have probability 0 in "
            "this model and were skipped"
        )
    return Track(trajectory, labeling, tuple(labeler.label_names), tuple(warnings))


@dataclass(frozen=True)
class Seen:
    """The objects that a camera saw, as the columns that the model wants."""

    counts: "ObjectCounts"
    names: tuple[str, ...]
    within_s: float

    def columns(self, times_s: "ArrayLike") -> "NDArray[np.float32]":
        """(T, D) counts at the times of T scans."""
        return self.counts.at(times_s, within_s=self.within_s, object_names=self.names)

    def complaints(self, times_s: "ArrayLike") -> list[str]:
        """Warnings about them."""
        if (self.counts.seconds_from(times_s) <= self.within_s).any():
            return []
        return [
            f"no object counts within {self.within_s:g} s of any scan: do the log and the counts "
            "use the same clock? (--counts-within)"
        ]


def seen_objects(
    options: TrackOptions, labeler: "TrajectoryLabeler", progress: "Progress"
) -> Seen | None:
    """The counts of objects, if the model learned with any."""
    names = labeler.scan_model_.extra_names
    if options.counts is None:
        if names:
            raise ConfigError(
                f"this model also uses counts of {', '.join(names)}; pass them: --counts FILE"
            )
        return None
    if not names:
        raise ConfigError("this model uses the laser only; omit --counts")

    from pgm_places.io.logs.object_counts import read_object_counts

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


def track_labeler(
    stored: "Stored", options: TrackOptions, progress: "Progress"
) -> "TrajectoryLabeler":
    """The labeler of a stored model, with the options of the command."""
    from pgm_places.labelers.trajectory_labeler import TrajectoryLabeler
    from pgm_places.models.hmm import HiddenMarkovModel

    labeler = stored.item
    if stored.kind == "place-labeler":  # with what it knows of moving robots
        labeler = TrajectoryLabeler.from_places(labeler)
    is_hmm = isinstance(labeler.method_, HiddenMarkovModel)
    if is_hmm:
        labeler = _changed(labeler, method__mode=options.mode)
    elif options.mode != "filter":
        raise ConfigError(
            f"--mode {options.mode} is for hidden Markov models; this model's method is "
            f"{type(labeler.method_).__name__}"
        )
    chosen = options.beams or ("known-map" if options.map_yaml is not None else None)
    if chosen is not None:
        labeler = _changed(labeler, beams__missing=chosen)
    if options.every_m is not None:
        with named_as_flags({"every_m": "--every"}):
            labeler, changed = labeler.updated_every(options.every_m)
        if changed > MOST_CHANGED:
            progress.warn(
                f"--every {options.every_m:g}: no continuous motion has exactly the transitions of "
                f"this model; the nearest that has differs by up to {changed:.3f} in a "
                "probability. For the best labels, train a model at this distance"
            )
    return labeler


def labelled_map(options: TrackOptions, labeler: "TrajectoryLabeler") -> "LabelledMapFolder | None":
    """The map that was labelled beforehand, if one is named."""
    if options.map_labels is None:
        return None
    from pgm_places.persistence.map_prior import read_labelled_map

    return read_labelled_map(options.map_labels, labeler.label_names)


def _changed(labeler: "TrajectoryLabeler", **options: object) -> "TrajectoryLabeler":
    """The labeler with other options; what it refuses is named by its flag."""
    with named_as_flags({"mode": "--mode", "missing": "--beams", "every_m": "--every"}):
        return labeler.with_options(**options)


def _default_model(options: TrackOptions) -> str:
    """The shipped model of maps where there is one to cast scans in, else that of drives."""
    from pgm_places.trained import DEFAULT, TRACKING

    return TRACKING if options.map_yaml is None else DEFAULT


def stored_model(options: TrackOptions) -> "Stored":
    """The model that is named, or the default one, of a kind that labels drives."""
    from pgm_places.persistence.stored import read
    from pgm_places.trained import model_folder

    folder = model_folder(options.model or _default_model(options))
    return read(folder, "place-labeler", "trajectory-labeler", "joint-labeler")


def with_truth(
    trajectory: "Trajectory", options: TrackOptions, label_names: tuple[str, ...]
) -> "Trajectory":
    """The trajectory with the true places from a table of as many steps, if one is named."""
    if options.truth is None:
        return trajectory
    from pgm_places.io.logs import truth_table

    return truth_table.with_truth(trajectory, options.truth, label_names)


def map_of(options: TrackOptions) -> "OccupancyGrid | None":
    """The map in the frame of the log, if one is named."""
    from pgm_places.io.maps.map_server import load_map

    return None if options.map_yaml is None else load_map(options.map_yaml).grid


def write(track: "Track", grid: "OccupancyGrid | None", out: Path) -> None:
    """All files of a track, drawn on the map or on one of its scans."""
    from pgm_places.labelers.tracking import map_of_scans
    from pgm_places.report.track_files import write_track

    drawn_on = map_of_scans(track.trajectory) if grid is None else grid
    write_track(track, drawn_on, out)


def summary(track: "Track") -> str:
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
