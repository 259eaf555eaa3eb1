"""``pgm-places live``: the place of a robot as it drives, and its map as it grows."""

import shlex
from collections.abc import Mapping
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import pgm_places as pp
from pgm_places._extras import needed
from pgm_places.cli.arguments import ForceMisfit, Method, Model, Quiet, Threads
from pgm_places.cli.declarations import Option, grouped, option_flags
from pgm_places.cli.terminal import complain, make_progress, say, say_next, say_written
from pgm_places.errors import ConfigError
from pgm_places.live.dds_bus import DdsNetwork
from pgm_places.live.live_options import LiveOptions, NodeOptions
from pgm_places.options import AtLeastZero

if TYPE_CHECKING:
    from pgm_places.live.live_map import LiveLabels
    from pgm_places.live.place_finder import FoundPlace
    from pgm_places.live.replay import Replay
    from pgm_places.topology.place_ids import PlaceIds

PLACES_FILE = "places.jsonl"

FEWEST_STEPS = 10
"""Steps needed to compare a drive with a map; with fewer before the map, all steps count."""


@dataclass(frozen=True)
class LiveFlags:
    """What is asked of a robot and of a replay.

    Parameters
    ----------
    replay : LOG
        Replay a ROS bag or a CARMEN log at full speed.
    dds
        Connect to a ROS 2 robot, with no ROS on this machine.
    local
        With --dds: communicate within this machine only.
    interface : NAME
        With --dds: network interface, by name or address; Cyclone's choice by default.
    peers : ADDRESS
        With --dds: a machine to look for where multicast does not pass. Repeatable.
    session : FILE
        Keep the places in this file: they have the same ids the next time.
    seconds
        With --dds: stop after this many seconds.
    out
        With --replay: folder for the place of each scan and the last map.
    max_range_m
        With --replay: readings of this range or more (m) count as no return.
    jsonl
        Print each line as a JSON object.
    """

    replay: Path | None = None
    dds: bool = False
    local: bool = False
    interface: str | None = None
    peers: Annotated[list[str] | None, Option("--peer")] = None
    session: Path | None = None
    seconds: AtLeastZero | None = None
    model: Model = "default"
    method: Method = None
    out: Annotated[Path | None, Option("--out", "-o")] = None
    max_range_m: AtLeastZero | None = None
    jsonl: bool = False
    force: ForceMisfit = False
    n_threads: Threads = None
    quiet: Quiet = False


@option_flags("node", NodeOptions)
@option_flags("options", LiveOptions)
@grouped("asked", LiveFlags)
def live(asked: LiveFlags, *, node: NodeOptions, options: LiveOptions) -> None:
    """Label the places of a robot as it drives and maps. One line for each change of place."""
    if asked.dds == (asked.replay is not None):
        raise ConfigError("live needs a log or a robot: pass --replay LOG, or --dds")
    given = {"--interface": asked.interface, "--peer": asked.peers, "--local": asked.local}
    for flag in [flag for flag, value in given.items() if value and not asked.dds]:
        raise ConfigError(f"{flag} is for a robot: pass --dds with it")
    if asked.replay is None:
        _run_robot(asked, node, options)
    else:
        _run_replay(asked, asked.replay, node.map_topic, options)


def _run_replay(asked: LiveFlags, log: Path, map_topic: str, options: LiveOptions) -> None:
    """``pgm-places live --replay``."""
    from pgm_places.io.output_set import output_set
    from pgm_places.io.places.place_ids_file import read_session, write_session
    from pgm_places.labelling.files import LIVE
    from pgm_places.topology.place_ids import PlaceIds

    memory = PlaceIds() if asked.session is None else read_session(asked.session)
    run = _replay(asked, log, map_topic, options, memory)
    with ExitStack() as stack:
        files = None
        if asked.out is not None:
            aside = output_set(asked.out, "live", names=LIVE, force=asked.force)
            files = stack.enter_context(aside)
        _say_all(run, None if files is None else files.stage, asked.jsonl)
    if asked.session is not None:
        write_session(asked.session, memory)
    if files is not None and not asked.jsonl:  # whose lines are all JSON
        say_written(files)
        pages = [path for path in files.written if path.name == "index.html"]
        say_next(*(f"open {shlex.quote(str(path))} in a browser" for path in pages))


def _run_robot(asked: LiveFlags, node: NodeOptions, options: LiveOptions) -> None:
    """``pgm-places live --dds``."""
    for module in ("cyclonedds", "rosbags"):
        needed(module, extra="dds", purpose="live --dds")
    from pgm_places.live.dds_node import DdsNode
    from pgm_places.live.map_process import MapProcess
    from pgm_places.live.place_finder import PlaceFinder

    network = DdsNetwork(asked.local, asked.interface or "", tuple(asked.peers or ()))
    network.config()  # refused before anything is started
    progress = make_progress(quiet=asked.quiet)

    def show(found: "FoundPlace") -> None:
        if found.changed:
            say(_place_line(found, asked.jsonl))

    session = MapProcess(
        asked.model, method=asked.method, n_threads=asked.n_threads, session=asked.session
    )
    try:
        with progress.stage("model"):
            tracker = pp.TrajectoryLabeler.from_places(pp.trained_labeler(asked.model))
            finder = PlaceFinder(tracker, options)
            finder.warm_up()
        robot = DdsNode(
            finder, session, progress.warn, node, options, on_place=show, network=network
        )
        robot.run(float("inf") if asked.seconds is None else asked.seconds)
    except KeyboardInterrupt:
        if not asked.quiet:
            complain("stopped")
    finally:
        session.close()


def _replay(
    asked: LiveFlags, log: Path, map_topic: str, options: LiveOptions, memory: "PlaceIds"
) -> "Replay":
    """The log, with the maps that it holds in the frame of its poses."""
    from pgm_places.io.logs.bags import read_map_messages
    from pgm_places.io.logs.trajectories import read_trajectory
    from pgm_places.labelling.model import LoadedModel
    from pgm_places.labelling.options import ModelOptions
    from pgm_places.live.live_map import LiveMap
    from pgm_places.live.place_finder import PlaceFinder
    from pgm_places.live.replay import Replay
    from pgm_places.sensing.map_agreement import check_agreement

    progress = make_progress(quiet=asked.quiet)
    model = LoadedModel.load(ModelOptions(model=asked.model, method=asked.method))
    with progress.stage("log"):
        maps = list(read_map_messages(log, map_topic))
        frame = maps[0].frame if maps else None
        loaded = read_trajectory(log, range_max_m=asked.max_range_m, fixed_frame=frame)
    warnings = list(loaded.warnings)
    if maps:
        # The last map covers what was driven before it was sent.
        last = max(maps, key=lambda item: item.time_s)
        driven = int((loaded.trajectory.times_s <= last.time_s).sum())
        poor = check_agreement(
            last.grid,
            loaded.trajectory[:driven] if driven >= FEWEST_STEPS else loaded.trajectory,
            f"the map on {map_topic}",
            force=asked.force,
            otherwise="--force replays it all the same",
        )
        warnings += [] if poor is None else [poor]
    for message in warnings:
        progress.warn(message)
    finder = PlaceFinder(pp.TrajectoryLabeler.from_places(model.labeler), options)
    live_map = LiveMap(model, memory=memory, n_threads=asked.n_threads)
    run = Replay(loaded.trajectory, finder, live_map, options, maps)
    if run.counts_metres:
        n_stamps = len(set(run.drive.times_s.tolist()))
        progress.warn(
            f"{len(run.drive)} scans have {n_stamps} time "
            f"{'stamp' if n_stamps == 1 else 'stamps'}, which do not tell when they were taken: "
            "metres driven count as seconds, for --relabel-min-period and --hysteresis too"
        )
    return run


def _say_all(run: "Replay", folder: Path | None, json_lines: bool) -> None:
    """A line for each change and each map, and where a folder is given, the files."""
    from pgm_places.labelling.files import write_topology
    from pgm_places.live.live_map import LiveLabels

    last: LiveLabels | None = None
    with ExitStack() as stack:
        lines = None
        if folder is not None:
            lines = stack.enter_context((folder / PLACES_FILE).open("w", encoding="utf-8"))
        for item in run:
            if isinstance(item, LiveLabels):
                last = item
                for message in item.warnings:
                    complain(message)
                say(_map_line(item, json_lines))
                continue
            if lines is not None:
                lines.write(_json(item.record()) + "\n")
            if item.changed:
                say(_place_line(item, json_lines))
    if folder is not None and last is not None:
        write_topology(folder, last.topology.grid, last.topology, title=run.drive.name)


def _place_line(found: "FoundPlace", json_lines: bool) -> str:
    if json_lines:
        return _json(found.record())
    x, y, _ = found.pose
    region = "-" if found.region is None else found.region.name
    return f"{found.time_s:.3f} {x:.3f} {y:.3f} {found.label} {found.probability:.3f} {region}"


def _map_line(found: "LiveLabels", json_lines: bool) -> str:
    """What a new map has changed."""
    n_places = len(found.topology.regions)
    if json_lines:
        record = {
            "map_seq": found.map_seq,
            "places": n_places,
            "appeared": list(found.appeared),
            "vanished": list(found.vanished),
        }
        return _json(record)
    names = {region.id: region.name for region in found.topology.regions}
    new = ", ".join(names[place] for place in found.appeared)
    gone = f"; {len(found.vanished)} gone" if found.vanished else ""
    return f"map {found.map_seq}: {n_places} places{f'; new: {new}' if new else ''}{gone}"


def _json(record: Mapping[str, Any]) -> str:
    import json  # only here: help does without it

    return json.dumps(record, ensure_ascii=False)
