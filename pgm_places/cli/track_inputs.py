"""What the options of ``pgm-places track`` name: model, map, truth, counted objects."""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

import pgm_places as pp
from pgm_places.cli.flags import named_as_flags
from pgm_places.cli.inputs import read_map
from pgm_places.cli.track_options import TrackOptions
from pgm_places.errors import ConfigError
from pgm_places.io.logs.object_counts import read_object_counts
from pgm_places.io.maps.map_server import MapFile
from pgm_places.labelers.map_prior import MapPrior
from pgm_places.models.hmm import HiddenMarkovModel
from pgm_places.persistence.map_prior import LabelledMapFolder, read_labelled_map
from pgm_places.persistence.stored import Stored, read
from pgm_places.progress import Progress
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
