"""``pgm-places track --follow``: label the scans of a log that is still being written."""

import json
import sys
from collections.abc import Generator, Iterator
from contextlib import closing, nullcontext
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

import pgm_places as pp
from pgm_places.cli.terminal import complain, make_progress, say, say_written
from pgm_places.cli.track_log import TrackInputs, stored_model, write
from pgm_places.cli.track_options import TrackOptions
from pgm_places.errors import ConfigError, LogError
from pgm_places.io.input_file import file_kind, open_input
from pgm_places.io.logs.bag_access import is_bag
from pgm_places.io.logs.carmen import CarmenReader, iter_carmen_scans
from pgm_places.io.logs.log_files import follow_files, follow_lines
from pgm_places.io.logs.pose_csv import iter_pose_csv
from pgm_places.io.output_set import output_set
from pgm_places.labelers.tracking import OnlineLabeler, Track
from pgm_places.labelling.files import TRACK
from pgm_places.live.place_finder import FoundPlace, PlaceOfMap
from pgm_places.progress import Progress

POLL_S = 0.2
FIRST_CHECK = 50
"""Scans before the drive is first compared with the map; then at each doubling."""


def run_follow(options: TrackOptions) -> None:
    """Label scans as they are written, until interrupted; one line per scan on standard output."""
    if options.mode != "filter":
        raise ConfigError("--follow labels scan by scan, which only --mode filter can do")
    if options.truth is not None:
        raise ConfigError("--truth scores complete logs; track the log without --follow to use it")
    log, progress = options.log, make_progress(quiet=options.quiet)
    stored = stored_model(options)
    if stored.kind == "joint-labeler":
        raise ConfigError(
            "--follow labels scan by scan, but this model labels a complete drive together with "
            "its map; track the complete log without --follow"
        )
    inputs = TrackInputs.of(stored, options, progress)
    if log.suffix.lower() == ".csv":  # poses without scans
        beams = {"beams__missing": "known-map", "beams__all_from_map": True}
        inputs = inputs._replace(labeler=inputs.labeler.with_options(**beams))
    follower = _Follower(inputs, options, progress)
    outputs = None
    if options.out is not None:
        outputs = output_set(options.out, "track", names=TRACK, force=options.force)
    with outputs or nullcontext() as files:
        try:
            with closing(_scans(options, inputs)) as scans:
                for scan in scans:
                    follower.add(scan)
        except KeyboardInterrupt:
            if not options.quiet:
                complain(f"stopped after {len(follower.beliefs)} scans")
        if not follower.beliefs:
            progress.warn(f"{log}: no scans received")
        elif files is not None:
            write(follower.track(log), inputs.grid, files.stage)
    if files is not None and not options.jsonl:  # the output is JSON lines only
        say_written(files)


class _Follower:
    """Labels scans one by one, prints each label, and collects them for the report."""

    def __init__(self, inputs: TrackInputs, options: TrackOptions, progress: Progress) -> None:
        self._inputs, self._labeler, self._json_lines = inputs, inputs.labeler, options.jsonl
        self._options, self._progress, self._next_check = options, progress, FIRST_CHECK
        self._online: OnlineLabeler | None = None
        self._scans: list[pp.Scan] = []
        self.beliefs: list[NDArray[np.float64]] = []

    def add(self, scan: pp.Scan) -> None:
        """Label and print a scan."""
        inputs = self._inputs
        if self._online is None:
            self._online = self._labeler.online(
                scan.geometry, known_map=inputs.grid, map_prior=inputs.prior
            )
        extra = None if inputs.counts is None else inputs.counts.columns([scan.time_s])[0]
        belief = self._online.step(scan, extra=extra)
        self._scans.append(scan)
        self.beliefs.append(belief)
        if len(self._scans) == self._next_check:
            self._next_check *= 2
            name = str(self._options.log)
            for message in inputs.misfit(
                pp.Trajectory.from_scans(self._scans, name=name), self._options
            ):
                self._progress.warn(message)
        best = self._online.choose(belief)
        if self._json_lines:
            say(json.dumps(self._record(scan, belief, best), ensure_ascii=False))
        else:
            x, y = scan.pose[:2]
            name = self._labeler.label_names[best]
            say(f"{scan.time_s:.3f} {x:.3f} {y:.3f} {name} {belief[best]:.3f}")

    def _record(self, scan: pp.Scan, belief: NDArray[np.float64], best: int) -> dict[str, Any]:
        names = self._labeler.label_names
        beliefs = dict(zip(names, belief.tolist(), strict=True))
        x, y, heading = scan.pose.tolist()
        known, place = self._inputs.known, None
        if known is not None and (region := known.places.region_at(x, y)) is not None:
            place = PlaceOfMap(region.id, region.name, region.label)
        record = FoundPlace(scan.time_s, (x, y, heading), names[best], beliefs, place).record()
        left_out = ("map_seq",) if known is not None else ("map_seq", "region")
        return {key: value for key, value in record.items() if key not in left_out}

    def track(self, log: Path) -> Track:
        """The track of all scans so far."""
        name = "standard input" if str(log) == "-" else log.stem
        table = np.array(self.beliefs, np.float64)
        labels = self._labeler.method_.choose(table)
        labeling = pp.Labeling(labels, pp.Status.CONVERGED, beliefs=table)
        path = pp.Trajectory.from_scans(self._scans[: len(table)], name=name)
        return Track(path, labeling, tuple(self._labeler.label_names))


def _scans(options: TrackOptions, inputs: TrackInputs) -> Generator[pp.Scan]:
    """The scans of a log as they are written."""
    log, kind = options.log, options.log.suffix.lower()
    if str(log) != "-" and kind == ".gz":
        raise LogError(f"{log} is compressed, so it cannot grow; track it without --follow")
    if str(log) != "-" and is_bag(log):
        raise LogError(
            f"{log} is a bag, whose index is written when recording ends; track it then, without "
            "--follow"
        )
    if kind == ".csv" and inputs.grid is None:
        raise LogError(
            f"{log} has poses but no scans; pass the map to cast them in: --map MAP.yaml"
        )
    reader = CarmenReader("front", options.max_range_m)
    for number, lines in enumerate(_files(log)):
        if number and not options.quiet:
            complain(f"{log} was replaced or truncated; reading it from its start")
        if kind == ".csv":
            yield from _cast_scans(log, lines, inputs.labeler)
        else:
            yield from iter_carmen_scans(lines, reader=reader)


def _files(log: Path) -> Iterator[Iterator[bytes]]:
    """The lines of a growing file and of its successors, or of a pipe."""
    if str(log) == "-":
        yield follow_lines(sys.stdin.buffer, poll_s=None)
    elif file_kind(log) == "file":
        yield from follow_files(log, poll_s=POLL_S)
    else:
        with open_input(log, LogError, "a CARMEN log", pipes=True) as stream:
            yield follow_lines(stream, poll_s=None)


def _cast_scans(
    log: Path, lines: Iterator[bytes], labeler: pp.TrajectoryLabeler
) -> Iterator[pp.Scan]:
    """Empty scans at the poses of a table: all their beams are taken from the map."""
    reach_m = labeler.scan_model_.sensor.max_range_m
    geometry = pp.ScanGeometry.half_circle(2, range_max_m=reach_m)
    ranges = np.full(geometry.n_beams, reach_m, np.float32)
    for time_s, pose in iter_pose_csv(log, lines):
        yield pp.Scan(time_s, pose, ranges, geometry)
