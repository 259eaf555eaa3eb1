"""``pgm-places track``: label a complete log, or one that is still being written."""

from pgm_places.cli.declarations import grouped
from pgm_places.cli.track_options import TrackOptions
from pgm_places.errors import ConfigError


@grouped("options", TrackOptions)
def track(options: TrackOptions) -> None:
    """Label the places along a trajectory. The log may be complete or growing."""
    if options.jsonl and not options.follow:
        raise ConfigError("--jsonl requires --follow; for a complete log, see beliefs.csv")
    from pgm_places.cli.track_log import stored_model

    if options.follow:
        from pgm_places.cli.follow import run_follow

        run_follow(options)
    elif (stored := stored_model(options)).kind == "joint-labeler":
        from pgm_places.cli.track_log import run_joint

        run_joint(stored, options)
    else:
        from pgm_places.cli.track_log import run_track

        run_track(stored, options)
