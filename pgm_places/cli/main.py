"""The ``pgm-places`` command: the arguments of each of its commands."""

from pathlib import Path
from typing import Annotated

import typer

from pgm_places._version import __version__
from pgm_places.cli.arguments import Cache, Force, Model, Out, Quiet, Threads, UnknownValue
from pgm_places.cli.entry import main
from pgm_places.cli.flags import option_flags
from pgm_places.cli.terminal import say
from pgm_places.cli.workers import Jobs, Memory, Scheduler, WorkerOptions
from pgm_places.datasets.map_simulation import MapSimulation
from pgm_places.live.live_options import LiveOptions
from pgm_places.live.node_options import NodeOptions
from pgm_places.topology.rules import TopologyOptions

__all__ = ["app", "main"]

app = typer.Typer(
    name="pgm-places",
    help="Label the places of a robot's map: corridor, room, doorway, or your own.",
    no_args_is_help=True,
    add_completion=True,
    pretty_exceptions_enable=False,
    rich_markup_mode=None,  # plain help starts faster and reads the same everywhere
)


def _show_version(wanted: bool) -> None:
    if wanted:
        say(f"pgm-places {__version__}")
        raise typer.Exit


@app.callback()
def _options(
    _version: Annotated[
        bool,
        typer.Option("--version", callback=_show_version, is_eager=True, help="Show the version."),
    ] = False,
) -> None:
    """Label the places of a robot's map: corridor, room, doorway, or your own."""


@app.command()
def demo(
    out: Out = Path("demo-report"),
    seed: Annotated[int, typer.Option(min=0, help="Seed of the generated building.")] = 0,
    force: Force = False,
    threads: Threads = None,
    quiet: Quiet = False,
) -> None:
    """Train and label on a generated building; needs no data."""
    from pgm_places.cli.commands import run_demo

    run_demo(out, seed=seed, force=force, n_threads=threads, quiet=quiet)


@app.command()
def compare(
    config: Annotated[Path, typer.Argument(help="Experiment configuration (TOML).")],
    out: Out,
    by_building: Annotated[
        bool,
        typer.Option(
            "--by-building",
            help="Leave out each building of [[train]] in turn, train on the others and test on "
            "it; [[test]] is not used.",
        ),
    ] = False,
    cache: Cache = None,
    jobs: Jobs = None,
    scheduler: Scheduler = None,
    memory: Memory = None,
    force: Force = False,
    threads: Threads = None,
    quiet: Quiet = False,
) -> None:
    """Train and evaluate every method of a configuration. Writes tables and a report.

    --jobs, --scheduler and --memory are for --by-building: each building is a task of its own.
    """
    from pgm_places.cli.commands import run_compare

    run_compare(
        config,
        out,
        by_building=by_building,
        workers=WorkerOptions(jobs, scheduler, memory),
        cache=cache,
        force=force,
        n_threads=threads,
        quiet=quiet,
    )


@app.command()
def train(
    config: Annotated[Path, typer.Argument(help="Experiment configuration (TOML).")],
    out: Out,
    cache: Cache = None,
    threads: Threads = None,
    quiet: Quiet = False,
) -> None:
    """Train a model on labelled maps and save it as a folder."""
    from pgm_places.cli.commands import run_train

    run_train(config, out, cache=cache, n_threads=threads, quiet=quiet)


@app.command()
def label(
    maps: Annotated[
        list[str],
        typer.Argument(
            metavar="MAP.yaml...",
            help="map_server maps, folders to look through, or quoted patterns.",
        ),
    ],
    out: Out,
    model: Model = "default",
    method: Annotated[
        str | None, typer.Option(help="Method of the model; its last one by default.")
    ] = None,
    doorways: Annotated[
        str | None,
        typer.Option(
            metavar="gates|labels",
            help="What separates places: gates, if the model finds any, or cells labelled as "
            "doorways; by default, as set in the model's [topology].",
        ),
    ] = None,
    halls: Annotated[
        str | None,
        typer.Option(
            metavar="corridor|room|hall",
            help="What lobbies, foyers and other halls are labelled, if the model knows them; by "
            "default, as set in the model's [labels].",
        ),
    ] = None,
    corrections: Annotated[
        Path | None,
        typer.Option(
            metavar="FILE.png|FILE.geojson",
            help="Labels of a single map that are known: a label image of its size, or polygons "
            "and lines in metres with a property 'class'. Every method keeps them.",
        ),
    ] = None,
    unknown_value: UnknownValue = None,
    jobs: Jobs = None,
    scheduler: Scheduler = None,
    memory: Memory = None,
    force: Force = False,
    threads: Threads = None,
    quiet: Quiet = False,
) -> None:
    """Label every free cell of a map, or of many.

    One map is labelled into the folder itself. Several, or a folder, or any of --jobs, --scheduler
    and --memory, make a batch: each map gets a folder of its own, those that are done are kept, and
    index.html lists them all. The exit code is 3 if some map could not be labelled.
    """
    from pgm_places.batch.label_options import LabelOptions
    from pgm_places.cli.label import run_label

    run_label(
        maps,
        out,
        LabelOptions(
            model=model,
            method=method,
            doorways=doorways,
            halls=halls,
            unknown_value=unknown_value,
        ),
        WorkerOptions(jobs, scheduler, memory),
        corrections=corrections,
        force=force,
        n_threads=threads,
        quiet=quiet,
    )


@app.command()
def studio(
    map_yaml: Annotated[Path, typer.Argument(metavar="MAP.yaml", help="A map_server map.")],
    labels: Annotated[
        list[Path] | None,
        typer.Option(
            help="Label image to compare with, such as the truth; may be given several times."
        ),
    ] = None,
    model: Annotated[
        str,
        typer.Option(
            "--model",
            "-m",
            help="Folder written by 'train', or the name of a shipped model; none to learn from "
            "nothing but the paint.",
        ),
    ] = "default",
    out: Annotated[
        Path | None,
        typer.Option(
            "--out", "-o", help="Folder for the paint and the exports; MAP-studio by default."
        ),
    ] = None,
    drive: Annotated[
        Path | None,
        typer.Option(metavar="LOG", help="A drive in the map's frame, whose path is shown."),
    ] = None,
    port: Annotated[
        int, typer.Option(min=0, max=65535, help="Port to listen on; 0 for any that is free.")
    ] = 0,
    no_browser: Annotated[
        bool, typer.Option("--no-browser", help="Print the address without opening it.")
    ] = False,
    unknown_value: UnknownValue = None,
    threads: Threads = None,
    quiet: Quiet = False,
) -> None:
    """Teach the labels of a map in the browser."""
    from pgm_places.cli.studio import run_studio

    run_studio(
        map_yaml,
        out,
        labels=labels or (),
        model=model,
        drive=drive,
        port=port,
        browser=not no_browser,
        unknown_value=unknown_value,
        n_threads=threads,
        quiet=quiet,
    )


@app.command()
@option_flags("rules", TopologyOptions, {"doorway_label": "--doorway"}, without=("doorways",))
def topology(
    labels: Annotated[
        Path,
        typer.Argument(metavar="LABELS.png", help="Label image, with its names file next to it."),
    ],
    map_yaml: Annotated[Path, typer.Argument(metavar="MAP.yaml", help="The map it belongs to.")],
    out: Out,
    names: Annotated[
        Path | None, typer.Option(help="Names file; LABELS.yaml or labels.yaml by default.")
    ] = None,
    *,
    rules: TopologyOptions,
    propose_splits: Annotated[
        float,
        typer.Option(
            min=0, help="List the places that --split-rooms would split, without splitting."
        ),
    ] = 0.0,
    unknown_value: UnknownValue = None,
    force: Force = False,
    quiet: Quiet = False,
) -> None:
    """Find the places in a labelled map and their connections."""
    from pgm_places.cli.places import run_topology

    run_topology(
        labels,
        map_yaml,
        out,
        names_path=names,
        unknown_value=unknown_value,
        force=force,
        rules=rules,
        propose_splits_m=propose_splits,
        quiet=quiet,
    )


@app.command()
def export(
    folder: Annotated[
        Path, typer.Argument(metavar="DIR", help="Folder written by label or topology.")
    ],
    to: Annotated[
        str,
        typer.Option(
            help="nav2-route, regions, zones, keepout, speed-percent, speed-m-s, binary, graphml, "
            "node-link, dot, geotiff or mcap."
        ),
    ],
    out: Annotated[
        Path | None, typer.Option("--out", "-o", help="Folder for the files; DIR by default.")
    ] = None,
    values: Annotated[
        list[str] | None,
        typer.Option("--set", help="Mask value of a class or a place: room=100. Repeatable."),
    ] = None,
    robot_radius: Annotated[
        float | None,
        typer.Option(
            min=0, help="For nav2-route: leave out passages too narrow for this radius (m)."
        ),
    ] = None,
    force: Force = False,
) -> None:
    """Write the places for Nav2, QGIS, Foxglove and other tools."""
    from pgm_places.cli.places import run_export

    run_export(folder, to, out, values or [], robot_radius_m=robot_radius, force=force)


@app.command(context_settings={"ignore_unknown_options": True})  # a position may be negative
def where(
    folder: Annotated[
        Path, typer.Argument(metavar="DIR", help="Folder written by label or topology.")
    ],
    x: Annotated[float, typer.Argument(metavar="X", help="Position in the map frame (m).")],
    y: Annotated[float, typer.Argument(metavar="Y", help="Position in the map frame (m).")],
) -> None:
    """Show the place at a position. The exit code is 1 if there is none."""
    from pgm_places.cli.places import run_where

    run_where(folder, x, y)


Places = Annotated[Path, typer.Argument(metavar="DIR", help="Folder written by label or topology.")]
Place = Annotated[str, typer.Argument(metavar="PLACE", help="Name or id of a place.")]


@app.command()
def rename(
    folder: Places,
    place: Place,
    name: Annotated[str, typer.Argument(metavar="NAME", help="What to call it.")],
) -> None:
    """Give a place a name of your own, in place_names.yaml."""
    from pgm_places.cli.place_edits import run_rename

    run_rename(folder, place, name)


@app.command()
def merge(
    folder: Places,
    first: Place,
    second: Annotated[str, typer.Argument(metavar="OTHER", help="The place that becomes part.")],
) -> None:
    """Make two places one, which keeps the id and the name of the first."""
    from pgm_places.cli.place_edits import run_merge

    run_merge(folder, first, second)


@app.command(context_settings={"ignore_unknown_options": True})
def split(
    folder: Places,
    place: Place,
    points: Annotated[
        list[float],
        typer.Argument(metavar="X Y [X2 Y2]", help="A point, or the ends of a line (m)."),
    ],
) -> None:
    """Split a place across a line, or at a point across its narrowest way there."""
    from pgm_places.cli.place_edits import run_split

    run_split(folder, place, points)


@app.command(context_settings={"ignore_unknown_options": True})  # a position may be negative
def explain(
    map_yaml: Annotated[Path, typer.Argument(metavar="MAP.yaml", help="A map_server map.")],
    x: Annotated[float, typer.Argument(metavar="X", help="Position in the map frame (m).")],
    y: Annotated[float, typer.Argument(metavar="Y", help="Position in the map frame (m).")],
    out: Annotated[Path | None, typer.Option("--out", "-o", help="A picture of it (PNG).")] = None,
    model: Model = "default",
    method: Annotated[
        str | None, typer.Option(help="Method of the model; its last one by default.")
    ] = None,
    corrections: Annotated[
        Path | None,
        typer.Option(metavar="FILE.png|FILE.geojson", help="Known labels, as label takes them."),
    ] = None,
    unknown_value: UnknownValue = None,
    threads: Threads = None,
    quiet: Quiet = False,
) -> None:
    """Explain the label at a position: what its scan and its place said, and the graph."""
    from pgm_places.cli.explain import run_explain

    run_explain(
        map_yaml,
        x,
        y,
        out=out,
        model=model,
        method=method,
        corrections=corrections,
        unknown_value=unknown_value,
        n_threads=threads,
        quiet=quiet,
    )


@app.command()
def simulate(
    out: Annotated[
        Path,
        typer.Option(
            "--out",
            "-o",
            help="The log: NAME.log, NAME.log.gz (CARMEN), NAME.bag (ROS 1), NAME.mcap, NAME (a "
            "ROS 2 bag's folder) or NAME.csv (poses only).",
        ),
    ],
    map_yaml: Annotated[
        Path | None, typer.Argument(metavar="MAP.yaml", help="The map_server map to drive in.")
    ] = None,
    demo: Annotated[
        bool, typer.Option("--demo", help="Drive in a generated building and write its map too.")
    ] = False,
    labels: Annotated[
        Path | None, typer.Option(help="Label image of the map, for the true place of every step.")
    ] = None,
    beams: Annotated[int, typer.Option(min=1, max=100_000, help="Number of laser beams.")] = 180,
    view: Annotated[
        float, typer.Option(min=1, max=360, help="Field of view of the laser (degrees).")
    ] = 180,
    reach: Annotated[
        float, typer.Option("--range", min=0.1, help="Maximum range of the laser (m).")
    ] = 30.0,
    noise: Annotated[float, typer.Option(help="Standard deviation of the range noise (m).")] = 0.02,
    odometry_noise: Annotated[
        float, typer.Option(min=0, help="Odometry noise scale (1 = typical).")
    ] = 1.0,
    wheels_only: Annotated[
        bool, typer.Option("--wheels-only", help="Record odometry only, without the true poses.")
    ] = False,
    length: Annotated[
        float | None,
        typer.Option(
            min=0.5, help="Distance to drive (m); by default, far enough to pass every place."
        ),
    ] = None,
    speed: Annotated[float, typer.Option(help="Driving speed (m/s).")] = 0.4,
    every: Annotated[float, typer.Option(help="Time between scans (s).")] = 0.2,
    radius: Annotated[float, typer.Option(help="Radius of the robot (m).")] = 0.25,
    seed: Annotated[
        int, typer.Option(help="Seed of the starting point, the noise and the building.")
    ] = 0,
    unknown_value: UnknownValue = None,
    force: Force = False,
    threads: Threads = None,
    quiet: Quiet = False,
) -> None:
    """Drive a simulated robot through a map and write its log."""
    from pgm_places.cli import simulate as command

    robot = command.robot_of(
        command.beams(beams, view, reach),
        speed_m_s=speed,
        scan_every_s=every,
        radius_m=radius,
        range_noise_m=noise,
        odometry_noise=odometry_noise,
        seed=seed,
    )
    command.run_simulate(
        map_yaml,
        out,
        robot,
        demo=demo,
        labels=labels,
        length_m=length,
        seed=seed,
        wheels_only=wheels_only,
        unknown_value=unknown_value,
        force=force,
        n_threads=threads,
        quiet=quiet,
    )


@app.command()
@option_flags("options", MapSimulation)
def simulate_map(
    plan_yaml: Annotated[
        Path, typer.Argument(metavar="PLAN.yaml", help="A clean map, such as one from CAD.")
    ],
    labels: Annotated[Path, typer.Option(help="Label image of the plan.")],
    out: Out,
    *,
    seed: Annotated[int, typer.Option(min=0, help="Seed of the first map.")] = 0,
    copies: Annotated[int, typer.Option(min=1, help="Number of maps, a seed for each.")] = 1,
    options: MapSimulation,
    unknown_value: UnknownValue = None,
    force: Force = False,
    quiet: Quiet = False,
) -> None:
    """Turn a labelled plan into maps like those a robot would make.

    Options written LOW,HIGH are ranges; each map draws a value from them.
    """
    from pgm_places.cli.simulate_map import run_simulate_map

    run_simulate_map(
        plan_yaml,
        labels,
        out,
        seeds=range(seed, seed + copies),
        options=options,
        unknown_value=unknown_value,
        force=force,
        quiet=quiet,
    )


@app.command()
def track(
    log: Annotated[
        Path,
        typer.Argument(
            metavar="LOG", help="CARMEN log, ROS bag or table of poses; - with --follow."
        ),
    ],
    model: Annotated[
        str | None,
        typer.Option(
            "--model",
            "-m",
            help="Folder written by 'train', or the name of a shipped model; tracking by default, "
            "with --map default.",
        ),
    ] = None,
    out: Annotated[
        Path | None, typer.Option("--out", "-o", help="Folder for the results; created if needed.")
    ] = None,
    map_yaml: Annotated[
        Path | None,
        typer.Option("--map", metavar="MAP.yaml", help="Map in the frame of the log's poses."),
    ] = None,
    map_labels: Annotated[
        Path | None,
        typer.Option(
            metavar="DIR", help="Folder that label wrote for this map: its labels count as well."
        ),
    ] = None,
    mode: Annotated[
        str, typer.Option(help="filter (as online), or smooth or viterbi (complete logs only).")
    ] = "filter",
    beams: Annotated[
        str | None,
        typer.Option(
            help="How to complete scans of less than a full circle: known-map (default with "
            "--map), local-map, mirror or max-range."
        ),
    ] = None,
    every: Annotated[
        float | None,
        typer.Option(help="Distance between updates (m); the model's by default."),
    ] = None,
    max_range: Annotated[
        float | None,
        typer.Option(min=0, help="Readings of this range or more (m) count as no return."),
    ] = None,
    truth: Annotated[
        Path | None,
        typer.Option(help="Table of the true places, one row per step, to score against."),
    ] = None,
    counts: Annotated[
        Path | None,
        typer.Option(help="CSV or JSON of object counts, for a model trained with them."),
    ] = None,
    counts_within: Annotated[
        float,
        typer.Option(min=0, help="Longest time between a scan and its object counts (s)."),
    ] = 5.0,
    follow: Annotated[
        bool,
        typer.Option(
            "--follow", "-f", help="Follow a growing CARMEN log or CSV, or -: one line per scan."
        ),
    ] = False,
    jsonl: Annotated[
        bool, typer.Option("--jsonl", help="With --follow: each line as a JSON object.")
    ] = False,
    force: Force = False,
    quiet: Quiet = False,
) -> None:
    """Label the places along a trajectory. The log may be complete or growing."""
    from pgm_places.cli.track import TrackOptions, run_track, stored_model

    options = TrackOptions(
        model, map_yaml, mode, beams, every, max_range, truth, counts, counts_within, map_labels
    )
    if follow:
        from pgm_places.cli.follow import run_follow

        run_follow(log, out, options, json_lines=jsonl, force=force, quiet=quiet)
    elif jsonl:
        from pgm_places.errors import ConfigError

        raise ConfigError("--jsonl is for --follow; beliefs.csv has a row per scan of a whole log")
    else:
        stored = stored_model(options)
        if stored.kind == "joint-labeler":
            from pgm_places.cli.track_joint import run_joint

            run_joint(stored, log, out, options, force=force, quiet=quiet)
        else:
            run_track(stored, log, out, options, force=force, quiet=quiet)


@app.command()
@option_flags("node", NodeOptions)
@option_flags("options", LiveOptions)
def live(
    replay: Annotated[
        Path | None,
        typer.Option(metavar="LOG", help="Replay a ROS bag or a CARMEN log at full speed."),
    ] = None,
    dds: Annotated[
        bool, typer.Option("--dds", help="Speak to a robot with ROS 2, without ROS on this side.")
    ] = False,
    local: Annotated[
        bool, typer.Option("--local", help="With --dds: speak to this machine only.")
    ] = False,
    seconds: Annotated[
        float | None, typer.Option(min=0, help="With --dds: end after so many seconds.")
    ] = None,
    model: Model = "default",
    method: Annotated[
        str | None, typer.Option(help="Method that labels the map; the model's last by default.")
    ] = None,
    out: Annotated[
        Path | None,
        typer.Option(
            "--out", "-o", help="With --replay: folder for the place of each scan and the last map."
        ),
    ] = None,
    max_range: Annotated[
        float | None,
        typer.Option(
            min=0, help="With --replay: readings of this range or more (m) count as no return."
        ),
    ] = None,
    *,
    node: NodeOptions,
    options: LiveOptions,
    jsonl: Annotated[bool, typer.Option("--jsonl", help="Each line as a JSON object.")] = False,
    force: Force = False,
    threads: Threads = None,
    quiet: Quiet = False,
) -> None:
    """Label the places of a robot as it drives and maps. One line for each change of place."""
    from pgm_places.cli.live import run_live, run_robot
    from pgm_places.errors import ConfigError

    if dds == (replay is not None):
        raise ConfigError("live needs a log or a robot: pass --replay LOG, or --dds")
    if replay is None:
        run_robot(
            node,
            options,
            model=model,
            method=method,
            local_only=local,
            seconds=seconds,
            json_lines=jsonl,
            n_threads=threads,
            quiet=quiet,
        )
        return
    run_live(
        replay,
        out,
        model=model,
        method=method,
        map_topic=node.map_topic,
        max_range_m=max_range,
        options=options,
        json_lines=jsonl,
        force=force,
        n_threads=threads,
        quiet=quiet,
    )


@app.command()
def reproduce(
    sections: Annotated[
        list[str] | None,
        typer.Argument(
            metavar="[SECTION]...",
            help="Sections such as 7.1 7.5, ablations, buildings; 7.1 to 7.6 by default.",
        ),
    ] = None,
    out: Out = Path("reproduced"),
    again: Annotated[
        bool, typer.Option("--again", help="Rerun sections that have already been run.")
    ] = False,
    force: Force = False,
    threads: Threads = None,
    quiet: Quiet = False,
) -> None:
    """Reproduce the experiments of the paper. Writes a page comparing its figures with ours."""
    from pgm_places.cli.reproduce import run_reproduce

    run_reproduce(
        tuple(sections or ()), out, again=again, force=force, n_threads=threads, quiet=quiet
    )


@app.command()
def doctor(
    map_yaml: Annotated[
        Path | None, typer.Argument(metavar="[MAP.yaml]", help="A map to check.")
    ] = None,
) -> None:
    """Check the installation and, optionally, a map file."""
    from pgm_places.cli.doctor import run_doctor

    run_doctor(map_yaml)


if __name__ == "__main__":
    main()
