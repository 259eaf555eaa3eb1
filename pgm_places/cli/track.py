"""``pgm-places track``: label a whole log, or one that is still being written."""

from pathlib import Path
from typing import Annotated

from pgm_places.cli.arguments import Force, Quiet, UnknownValue
from pgm_places.cli.declarations import Argument, Option
from pgm_places.errors import ConfigError
from pgm_places.options import AtLeastZero


def track(
    log: Annotated[
        Path,
        Argument(metavar="LOG", help="CARMEN log, ROS bag or table of poses; - with --follow."),
    ],
    model: Annotated[
        str | None,
        Option(
            "--model",
            "-m",
            help="Folder written by 'train', or the name of a shipped model; 'tracking' by "
            "default, 'default' with --map.",
        ),
    ] = None,
    out: Annotated[
        Path | None, Option("--out", "-o", help="Folder for the results; created if needed.")
    ] = None,
    map_yaml: Annotated[
        Path | None,
        Option("--map", metavar="MAP.yaml", help="Map in the frame of the log's poses."),
    ] = None,
    map_labels: Annotated[
        Path | None,
        Option(
            metavar="DIR",
            help="Folder that label wrote for this map: its labels are a further observation.",
        ),
    ] = None,
    mode: Annotated[
        str, Option(help="filter (as online), or smooth or viterbi (complete logs only).")
    ] = "filter",
    beams: Annotated[
        str | None,
        Option(
            help="How to complete scans of less than a full circle: known-map (default with "
            "--map), local-map, mirror or max-range."
        ),
    ] = None,
    every: Annotated[
        float | None,
        Option(help="Distance between updates (m); the model's by default."),
    ] = None,
    max_range: Annotated[
        AtLeastZero | None,
        Option(help="Readings of this range or more (m) count as no return."),
    ] = None,
    truth: Annotated[
        Path | None,
        Option(help="Table of the true places, one row per step, to score against."),
    ] = None,
    counts: Annotated[
        Path | None,
        Option(help="CSV or JSON of object counts, for a model trained with them."),
    ] = None,
    counts_within: Annotated[
        AtLeastZero,
        Option(help="Longest time between a scan and its object counts (s)."),
    ] = 5.0,
    follow: Annotated[
        bool,
        Option(
            "--follow", "-f", help="Follow a growing CARMEN log or CSV, or -: one line per scan."
        ),
    ] = False,
    jsonl: Annotated[
        bool, Option("--jsonl", help="With --follow: print each line as a JSON object.")
    ] = False,
    unknown_value: UnknownValue = None,
    force: Force = False,
    quiet: Quiet = False,
) -> None:
    """Label the places along a trajectory. The log may be complete or growing."""
    from pgm_places.cli.track_options import TrackOptions, stored_model

    options = TrackOptions(
        model,
        map_yaml,
        mode,
        beams,
        every,
        max_range,
        truth,
        counts,
        counts_within,
        map_labels,
        unknown_value,
    )
    if follow:
        from pgm_places.cli.follow import run_follow

        run_follow(log, out, options, json_lines=jsonl, force=force, quiet=quiet)
    elif jsonl:
        raise ConfigError("--jsonl is for --follow; beliefs.csv has a row per scan of a whole log")
    else:
        stored = stored_model(options)
        if stored.kind == "joint-labeler":
            from pgm_places.cli.track_joint import run_joint

            run_joint(stored, log, out, options, force=force, quiet=quiet)
        else:
            from pgm_places.cli.track_log import run_track

            run_track(stored, log, out, options, force=force, quiet=quiet)
