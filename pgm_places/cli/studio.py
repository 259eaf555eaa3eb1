"""The command studio: reads the files it is given, then serves the map to a browser."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from pgm_places._extras import needed
from pgm_places._option_marks import Ge, Le
from pgm_places.cli.arguments import Quiet, Threads, UnknownValue
from pgm_places.cli.declarations import Argument, Option
from pgm_places.cli.progress import make_progress
from pgm_places.cli.terminal import say

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

__all__ = ["studio"]


def studio(
    map_yaml: Annotated[Path, Argument(metavar="MAP.yaml", help="A map_server map.")],
    labels: Annotated[
        list[Path] | None,
        Option(help="Label image to compare with, such as the truth; may be given several times."),
    ] = None,
    model: Annotated[
        str,
        Option(
            "--model",
            "-m",
            help="Folder written by 'train', or the name of a shipped model; none to learn from "
            "the paint alone.",
        ),
    ] = "default",
    out: Annotated[
        Path | None,
        Option("--out", "-o", help="Folder for the paint and the exports; MAP-studio by default."),
    ] = None,
    corrections: Annotated[
        Path | None,
        Option(
            metavar="FILE",
            help="Paint to begin with, as the studio exports it: a label image or GeoJSON. What "
            "is painted already stays.",
        ),
    ] = None,
    drive: Annotated[
        Path | None,
        Option(metavar="LOG", help="A drive in the map's frame, whose path is shown."),
    ] = None,
    port: Annotated[
        Annotated[int, Ge(0), Le(65535)], Option(help="Port to listen on; 0 for any that is free.")
    ] = 0,
    no_browser: Annotated[
        bool, Option("--no-browser", help="Print the address without opening it.")
    ] = False,
    unknown_value: UnknownValue = None,
    n_threads: Threads = None,
    quiet: Quiet = False,
) -> None:
    """Teach the labels of a map in the browser."""
    for module in ("starlette", "uvicorn"):
        needed(module, extra="studio", purpose="the studio")
    from pgm_places.experiment.config import NO_MODEL
    from pgm_places.io.maps.label_image import load_labels
    from pgm_places.io.maps.label_values import listed_names
    from pgm_places.io.maps.map_server import load_map
    from pgm_places.studio.desk import Desk
    from pgm_places.studio.given_labels import GivenLabels
    from pgm_places.studio.server import serve
    from pgm_places.teaching.paint import Paint
    from pgm_places.trained import stored_labeler

    progress = make_progress(quiet=quiet)
    stored = None if model == NO_MODEL else stored_labeler(model)
    with progress.stage("map"):
        loaded = load_map(map_yaml, unknown_value=unknown_value)
    for message in loaded.warnings:
        progress.warn(message)
    given: list[GivenLabels] = []
    for path in labels or ():
        names = tuple(listed_names(path))
        title = path.name if all(path.name != item.title for item in given) else str(path)
        given.append(GivenLabels(title, load_labels(path, names, grid=loaded.grid), names))
    desk = Desk(
        loaded,
        out or Path(f"{map_yaml.stem}-studio"),
        None if stored is None else stored.item,
        model=model,
        given=given,
        rules=None if stored is None else stored.rules,
        drive_xy_m=None if drive is None else _path(drive),
        n_threads=n_threads,
    )
    try:
        if desk.carried is not None:
            progress.warn(desk.carried.words)
        if corrections is not None:
            desk.take(Paint.read(corrections, loaded.grid))
        serve(
            desk, port=port, on_address=lambda address: _announce(address, browser=not no_browser)
        )
    finally:
        desk.close()


def _path(drive: Path) -> "NDArray[np.float64]":
    """The positions of a drive in metres."""
    from pgm_places.io.logs.trajectories import read_trajectory

    loaded = read_trajectory(drive)
    return loaded.trajectory.poses[:, :2]


def _announce(address: str, *, browser: bool) -> None:
    say(f"{address}\nOnly this computer can open it. Ctrl-C ends the studio; all edits are kept.")
    if browser:
        import webbrowser

        webbrowser.open(address)
