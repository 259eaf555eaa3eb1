"""The options of ``pgm-places track``."""

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

from pgm_places.cli.arguments import ForceMisfit, Quiet, UnknownValue
from pgm_places.cli.declarations import Argument, Option
from pgm_places.options import AtLeastZero


@dataclass(frozen=True)
class TrackOptions:
    """Options of ``track``.

    Parameters
    ----------
    log
        CARMEN log, ROS bag or table of poses; - with --follow.
    model
        Folder written by 'train', or the name of a shipped model; 'tracking' by default, 'default'
        with --map.
    out
        Folder for the results; created if needed.
    map_yaml : MAP.yaml
        Map in the frame of the log's poses.
    map_labels : DIR
        Folder written by label for this map; its labels are an additional observation.
    mode
        filter (as online), or smooth or viterbi (complete logs only).
    beams
        How to complete scans of less than a full circle: known-map (default with --map), local-map,
        mirror or max-range.
    every_m
        Distance between updates (m); the model's by default.
    max_range_m
        Readings of this range or more (m) count as no return.
    truth
        Table of the true places, one row per step, to score against.
    counts
        CSV or JSON of object counts, for a model trained with them.
    counts_within_s
        Longest time between a scan and its object counts (s).
    follow
        Follow a growing CARMEN log or CSV, or -: one line per scan.
    jsonl
        With --follow: print each line as a JSON object.
    """

    log: Annotated[Path, Argument("LOG")]
    model: Annotated[str | None, Option("--model", "-m")] = None
    out: Annotated[Path | None, Option("--out", "-o")] = None
    map_yaml: Annotated[Path | None, Option("--map")] = None
    map_labels: Path | None = None
    mode: str = "filter"
    beams: str | None = None
    every_m: float | None = None
    max_range_m: AtLeastZero | None = None
    truth: Path | None = None
    counts: Path | None = None
    counts_within_s: AtLeastZero = 5.0
    follow: Annotated[bool, Option("--follow", "-f")] = False
    jsonl: bool = False
    unknown_value: UnknownValue = None
    force: ForceMisfit = False
    quiet: Quiet = False
