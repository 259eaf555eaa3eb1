"""``pgm-places live``: the place of a robot as it drives, and its map as it grows."""

import shlex
from collections.abc import Mapping
from contextlib import nullcontext
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import pgm_places as pp
from pgm_places.cli.arguments import ForceMisfit, Method, Model, Quiet, Threads
from pgm_places.cli.declarations import Option, grouped, option_flags
from pgm_places.cli.terminal import complain, make_progress, say, say_next, say_written
from pgm_places.errors import ConfigError
from pgm_places.live.dds_bus import DdsNetwork
from pgm_places.live.live_options import LiveOptions, NodeOptions
from pgm_places.options import AtLeastZero
from pgm_places.plugins import needed

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
    """Flags of ``live``, for a robot and for a replay.

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
        With --dds: a machine to contact directly, where multicast is blocked. Repeatable.
    session : FILE
        Save the places to this file, so that they have the same ids in the next run.
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
@grouped("flags", LiveFlags)
def live(flags: LiveFlags, *, node: NodeOptions, options: LiveOptions) -> None:
    """Label the places of a robot as it drives and maps. One line for each change of place."""
    if flags.dds == (flags.replay is not None):
        raise ConfigError("live needs a log or a robot: pass --replay LOG, or --dds")
    robot_only = {"--interface": flags.interface, "--peer": flags.peers, "--local": flags.local}
    for flag in [flag for flag, value in robot_only.items() if value and not flags.dds]:
        raise ConfigError(f"{flag} is for a robot: pass --dds with it")
    if flags.replay is None:
        _run_robot(flags, node, options)
    else:
        _run_replay(flags, flags.replay, node.map_topic, options)


def _run_replay(flags: LiveFlags, log: Path, map_topic: str, options: LiveOptions) -> None:
    """``pgm-places live --replay``."""
    from pgm_places.io.output_set import output_set
    from pgm_places.io.places.place_ids_file import read_session, write_session
    from pgm_places.labelling.files import LIVE
    from pgm_places.topology.place_ids import PlaceIds

    memory = PlaceIds() if flags.session is None else read_session(flags.session)
    run = _replay(flags, log, map_topic, options, memory)
    outputs = None
    if flags.out is not None:
        outputs = output_set(flags.out, "live", names=LIVE, force=flags.force)
    with outputs or nullcontext() as files:
        _say_all(run, None if files is None else files.stage, flags.jsonl)
    if flags.session is not None:
        write_session(flags.session, memory)
    if files is not None and not flags.jsonl:  # the output is JSON lines only
        say_written(files)
        pages = [path for path in files.written if path.name == "index.html"]
        say_next(*(f"open {shlex.quote(str(path))} in a browser" for path in pages))


def _run_robot(flags: LiveFlags, node: NodeOptions, options: LiveOptions) -> None:
    """``pgm-places live --dds``."""
    for module in ("cyclonedds", "rosbags"):
        needed(module, extra="dds", purpose="live --dds")
    from pgm_places.live.dds_node import DdsNode
    from pgm_places.live.map_process import MapProcess
    from pgm_places.live.place_finder import PlaceFinder

    network = DdsNetwork(flags.local, flags.interface or "", tuple(flags.peers or ()))
    network.config()  # invalid values are reported before anything is started
    progress = make_progress(quiet=flags.quiet)

    def show(place: "FoundPlace") -> None:
        if place.changed:
            say(_place_line(place, flags.jsonl))

    session = MapProcess(
        flags.model, method=flags.method, n_threads=flags.n_threads, session=flags.session
    )
    try:
        with progress.stage("model"):
            tracker = pp.TrajectoryLabeler.from_places(pp.trained_labeler(flags.model))
            finder = PlaceFinder(tracker, options)
            finder.warm_up()
        robot = DdsNode(
            finder, session, progress.warn, node, options, on_place=show, network=network
        )
        robot.run(float("inf") if flags.seconds is None else flags.seconds)
    except KeyboardInterrupt:
        if not flags.quiet:
            complain("stopped")
    finally:
        session.close()


def _replay(
    flags: LiveFlags, log: Path, map_topic: str, options: LiveOptions, memory: "PlaceIds"
) -> "Replay":
    """The replay of a log, with its maps in the frame of its poses."""
    from pgm_places.io.logs.bags import read_map_messages
    from pgm_places.io.logs.trajectories import read_trajectory
    from pgm_places.labelling.model import LoadedModel
    from pgm_places.labelling.options import ModelOptions
    from pgm_places.live.live_map import LiveMap
    from pgm_places.live.place_finder import PlaceFinder
    from pgm_places.live.replay import Replay
    from pgm_places.sensing.map_agreement import check_agreement

    progress = make_progress(quiet=flags.quiet)
    model = LoadedModel.load(ModelOptions(model=flags.model, method=flags.method))
    with progress.stage("log"):
        maps = list(read_map_messages(log, map_topic))
        frame = maps[0].frame if maps else None
        loaded = read_trajectory(log, range_max_m=flags.max_range_m, fixed_frame=frame)
    warnings = list(loaded.warnings)
    if maps:
        # The last map covers the drive up to its time stamp.
        last = max(maps, key=lambda message: message.time_s)
        driven = int((loaded.trajectory.times_s <= last.time_s).sum())
        poor = check_agreement(
            last.grid,
            loaded.trajectory[:driven] if driven >= FEWEST_STEPS else loaded.trajectory,
            f"the map on {map_topic}",
            force=flags.force,
            otherwise="--force replays it anyway",
        )
        warnings += [] if poor is None else [poor]
    for message in warnings:
        progress.warn(message)
    finder = PlaceFinder(pp.TrajectoryLabeler.from_places(model.labeler), options)
    live_map = LiveMap(model, memory=memory, n_threads=flags.n_threads)
    run = Replay(loaded.trajectory, finder, live_map, options, maps)
    if run.counts_metres:
        n_stamps = len(set(run.drive.times_s.tolist()))
        progress.warn(
            f"the {len(run.drive)} scans have only {n_stamps} distinct time "
            f"{'stamp' if n_stamps == 1 else 'stamps'}: metres driven are used as seconds, "
            "also for --relabel-min-period and --hysteresis"
        )
    return run


def _say_all(run: "Replay", folder: Path | None, json_lines: bool) -> None:
    """Print a line per change of place and per map; write the files if there is a folder."""
    from pgm_places.labelling.files import write_topology
    from pgm_places.live.live_map import LiveLabels

    last: LiveLabels | None = None
    table = None if folder is None else (folder / PLACES_FILE).open("w", encoding="utf-8")
    with table or nullcontext() as lines:
        for event in run:
            if isinstance(event, LiveLabels):
                last = event
                for message in event.warnings:
                    complain(message)
                say(_map_line(event, json_lines))
                continue
            if lines is not None:
                lines.write(_json(event.record()) + "\n")
            if event.changed:
                say(_place_line(event, json_lines))
    if folder is not None and last is not None:
        write_topology(folder, last.topology.grid, last.topology, title=run.drive.name)


def _place_line(place: "FoundPlace", json_lines: bool) -> str:
    if json_lines:
        return _json(place.record())
    x, y, _ = place.pose
    region = "-" if place.region is None else place.region.name
    return f"{place.time_s:.3f} {x:.3f} {y:.3f} {place.label} {place.probability:.3f} {region}"


def _map_line(labels: "LiveLabels", json_lines: bool) -> str:
    """A line on the places of a new map."""
    n_places = len(labels.topology.regions)
    if json_lines:
        record = {
            "map_seq": labels.map_seq,
            "places": n_places,
            "appeared": list(labels.appeared),
            "vanished": list(labels.vanished),
        }
        return _json(record)
    names = {region.id: region.name for region in labels.topology.regions}
    new = ", ".join(names[place] for place in labels.appeared)
    gone = f"; {len(labels.vanished)} gone" if labels.vanished else ""
    count = f"{n_places} place{'' if n_places == 1 else 's'}"
    return f"map {labels.map_seq}: {count}{f'; new: {new}' if new else ''}{gone}"


def _json(record: Mapping[str, Any]) -> str:
    import json  # local, to keep the help fast

    return json.dumps(record, ensure_ascii=False)
