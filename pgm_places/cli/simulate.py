"""``pgm-places simulate`` and ``simulate-map``: simulated robot logs and robot maps."""

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import pgm_places as pp
from pgm_places.cli.arguments import Force, Out, Quiet, Threads, UnknownValue, read_labels, read_map
from pgm_places.cli.declarations import Argument, Option, option_flags
from pgm_places.cli.terminal import make_progress, say, say_written
from pgm_places.errors import InputError
from pgm_places.kernels.threads import thread_limit
from pgm_places.options import AtLeastZero, Seed, UnknownGrey, Whole
from pgm_places.options.marks import Ge
from pgm_places.simulation.map_simulation import MapSimulation
from pgm_places.simulation.robot_options import LaserOptions, RobotMotion

if TYPE_CHECKING:
    from pgm_places.progress import Progress

_ENDS = (".yaml", ".png", "_labels.png", "_labels.yaml")


@option_flags("options", MapSimulation)
def simulate_map(
    plan_yaml: Annotated[Path, Argument("PLAN.yaml")],
    labels: Path,
    out: Out,
    *,
    seed: Seed = 0,
    copies: Whole = 1,
    options: MapSimulation,
    unknown_value: UnknownValue = None,
    force: Force = False,
    quiet: Quiet = False,
) -> None:
    """Turn a labelled plan into robot-like maps.

    Options written LOW,HIGH are ranges; each map draws a value from them.

    Parameters
    ----------
    plan_yaml
        A clean map, such as one from CAD.
    labels
        Label image of the plan.
    seed
        Seed of the first map.
    copies
        Number of maps, a seed for each.
    """
    from pgm_places.io.output_set import output_set
    from pgm_places.simulation.simulated_map import simulate_map as simulated

    progress = make_progress(quiet=quiet)
    with progress.stage("plan"):
        plan, names = _users_map(plan_yaml, labels, unknown_value, progress)
    seeds = range(seed, seed + copies)
    stems = {number: f"{plan_yaml.stem}_{number}" for number in seeds}
    listed = [f"{stem}{end}" for stem in stems.values() for end in _ENDS]
    by = f"simulate-map {plan_yaml.stem} {seeds[0]}-{seeds[-1]}"
    with (
        output_set(out, by, names=listed, force=force, shared=True) as files,
        progress.stage("maps"),
    ):
        for number, stem in stems.items():
            made = simulated(plan, names, seed=number, options=options)
            pp.save_map(made.grid, files.stage / stem)
            pp.save_labels(files.stage / f"{stem}_labels.png", made.labels, names)
    say_written(files)


LASER_FLAGS = {"n_beams": "--beams", "view_degrees": "--view"}
MOTION_FLAGS = {"scan_every_s": "--every", "radius_m": "--robot-radius"}


@option_flags("laser", LaserOptions, LASER_FLAGS, without=("seed",))
@option_flags("motion", RobotMotion, MOTION_FLAGS, without=("turn_rad_s",))
def simulate(
    out: Annotated[Path, Option("--out", "-o")],
    map_yaml: Annotated[Path | None, Argument("MAP.yaml")] = None,
    demo: bool = False,
    labels: Path | None = None,
    *,
    laser: LaserOptions,
    odometry_noise: AtLeastZero = 1.0,
    wheels_only: bool = False,
    length_m: Annotated[float, Ge(0.5)] | None = None,
    motion: RobotMotion,
    seed: Seed = 0,
    unknown_value: UnknownValue = None,
    force: Force = False,
    n_threads: Threads = None,
    quiet: Quiet = False,
) -> None:
    """Drive a simulated robot through a map and write its log.

    Parameters
    ----------
    out
        The log: NAME.log, NAME.log.gz (CARMEN), NAME.bag (ROS 1), NAME.mcap, NAME (a ROS 2 bag's
        folder) or NAME.csv (poses only).
    map_yaml
        The map_server map to drive in.
    demo
        Drive in a generated building and write its map too.
    labels
        Label image of the map, for the true place of every step.
    odometry_noise
        Odometry noise scale (1 = typical).
    wheels_only
        Record odometry only, without the true poses.
    length_m
        Distance to drive (m); by default, far enough to pass every place.
    seed
        Seed of the starting point, the noise and the building.
    """
    from pgm_places.io.logs.trajectories import check_name
    from pgm_places.io.output_set import output_set
    from pgm_places.simulation.odometry_noise import OdometryNoise
    from pgm_places.simulation.simulated_robot import SimulatedRobot

    if (map_yaml is None) is not demo:
        raise InputError("simulate needs a map, or --demo for a generated building, but not both")
    check_name(out)  # invalid names are reported before the work
    odometry = OdometryNoise(seed=seed).scaled(odometry_noise)
    robot = SimulatedRobot.of(motion, replace(laser, seed=seed), odometry)
    progress = make_progress(quiet=quiet)
    listed = _file_names(out, demo=demo)
    with output_set(
        out.parent, f"simulate {out.name}", names=listed, force=force, shared=True
    ) as files:
        staged = files.stage / out.name
        with progress.stage("map"):
            if map_yaml is None:
                place, names = _demo_map(staged, seed)
            else:
                place, names = _users_map(map_yaml, labels, unknown_value, progress)
        with progress.stage("drive"), thread_limit(n_threads):
            driven = robot.explore(place.grid, seed=seed, max_length_m=length_m, name=_stem(out))
            if names:
                driven = driven.labelled_by(place, names)
        with progress.stage("writing files"):
            _write(staged, driven, _picture(place, names, driven), wheels_only)
    say(_summary(driven))
    say_written(files)


def _file_names(out: Path, *, demo: bool) -> list[str]:
    """The output files of a drive, without the files inside a ROS 2 bag's folder."""
    stem = _stem(out)
    names = [f"{stem}.png"] + [out.name] * bool(out.suffix)
    if out.suffix != ".csv":
        names.append(f"{stem}.truth.csv")
    ends = ("_map.yaml", "_map.png", "_labels.png", "_labels.yaml")
    return names + [f"{stem}{end}" for end in ends if demo]


def _write(out: Path, driven: "pp.Trajectory", picture: bytes, wheels_only: bool) -> None:
    """Write the log, the true places of its steps and the picture."""
    from pgm_places.io.atomic import write_bytes
    from pgm_places.io.logs.trajectories import write_trajectory

    recorded = driven
    if wheels_only and driven.odometry is not None:
        recorded = replace(driven, poses=driven.odometry, odometry=None)
    write_trajectory(out, recorded)
    if out.suffix != ".csv":
        write_trajectory(out.with_name(f"{_stem(out)}.truth.csv"), driven)
    write_bytes(out.with_name(f"{_stem(out)}.png"), picture)


def _users_map(
    map_yaml: Path, labels: Path | None, unknown_value: UnknownGrey | None, progress: "Progress"
) -> "tuple[pp.LabelledMap, tuple[str, ...]]":
    """The map, and the names of its labels: none without labels."""
    import numpy as np

    grid = read_map(map_yaml, unknown_value, progress).grid
    names, raster = ((), np.full(grid.shape, -1)) if labels is None else read_labels(labels, grid)
    return pp.LabelledMap(grid, raster, name=map_yaml.stem), names


def _demo_map(out: Path, seed: int) -> "tuple[pp.LabelledMap, tuple[str, ...]]":
    """A generated building, also written as files next to the log."""
    from pgm_places.simulation.building import generate_building

    building = generate_building(seed=seed)
    pp.save_map(building.grid, out.with_name(f"{_stem(out)}_map"))
    labels = out.with_name(f"{_stem(out)}_labels.png")
    pp.save_labels(labels, building.labels, building.label_names)
    return pp.LabelledMap(building.grid, building.labels), building.label_names


def _stem(out: Path) -> str:
    """A log's name without its suffixes."""
    return out.name.removesuffix(".gz").removesuffix(".log") if ".log" in out.name else out.stem


def _picture(place: "pp.LabelledMap", names: tuple[str, ...], driven: "pp.Trajectory") -> bytes:
    import numpy as np

    from pgm_places.pictures.map_pictures import path_map

    labels = np.full(len(driven), -1) if driven.labels is None else driven.labels
    wheels = None if driven.odometry is None else driven.odometry[:, :2]
    return path_map(
        place.grid,
        driven.poses[:, :2],
        labels,
        names,
        other_m=wheels,
        other_name="odometry",
        title="A simulated drive",
    )


def _summary(driven: "pp.Trajectory") -> str:
    import numpy as np

    from pgm_places.cli.terminal import text_table

    seconds = driven.times_s[-1] - driven.times_s[0]
    n_beams = 0 if driven.geometry is None else driven.geometry.n_beams
    length_m = driven.path_length_m
    lines = [
        f"{len(driven)} scans of {n_beams} beams; a drive of {length_m:.0f} m and {seconds:.0f} s"
    ]
    if driven.labels is not None and driven.label_names is not None:
        rows = [["place", "steps", "share"]]
        names = [*driven.label_names, "unknown"]
        for label, name in zip([*range(len(driven.label_names)), -1], names, strict=True):
            n_steps = int(np.count_nonzero(driven.labels == label))
            rows.append([name, str(n_steps), f"{100 * n_steps / len(driven):.1f} %"])
        lines.append(text_table(rows))
    return "\n".join(lines)
