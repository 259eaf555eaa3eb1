"""``pgm-places studio``: reads the maps, then serves them to a browser."""

from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import pgm_places as pp
from pgm_places.cli.arguments import Quiet, Threads, UnknownValue, read_labels, read_map
from pgm_places.cli.declarations import Argument, Option
from pgm_places.cli.terminal import make_progress, say
from pgm_places.errors import InputError
from pgm_places.options.marks import Ge, Le
from pgm_places.plugins import needed

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    import numpy as np
    from numpy.typing import NDArray

    from pgm_places.io.maps.map_server import MapFile
    from pgm_places.progress import Progress
    from pgm_places.studio.export_folders import ExportFolders
    from pgm_places.studio.layers import GivenLabels
    from pgm_places.studio.session import MapSession
    from pgm_places.studio.session_pool import SessionPool


def studio(
    maps: Annotated[list[Path], Argument("MAP.yaml...")],
    labels: list[Path] | None = None,
    model: Annotated[str, Option("--model", "-m")] = "default",
    out: Annotated[Path | None, Option("--out", "-o")] = None,
    corrections: Path | None = None,
    drive: Path | None = None,
    export_to: list[Path] | None = None,
    port: Annotated[int, Ge(0), Le(65535)] = 0,
    no_browser: bool = False,
    unknown_value: UnknownValue = None,
    n_threads: Threads = None,
    quiet: Quiet = False,
) -> None:
    """Teach the labels of maps in the browser.

    Parameters
    ----------
    maps
        One or several map_server maps.
    labels
        Label image to compare with, such as the ground truth. Repeatable.
    model
        Folder written by 'train', or the name of a shipped model; none to train on the paint alone.
    out
        Folder for the paint and the exports; by default MAP-studio, or for several maps
        maps-studio with a folder for each.
    corrections : FILE
        Initial paint: a label image or GeoJSON, as exported by the studio. Cells that are already
        painted do not change.
    drive : LOG
        A drive in the map's frame; its path is shown.
    export_to : DIR
        A further folder for exports, besides those below the current one. Repeatable.
    port
        Port to listen on; 0 for any free port.
    no_browser
        Print the address without opening it.
    """
    for module in ("starlette", "uvicorn"):
        needed(module, extra="studio", purpose="the studio")
    from pgm_places.experiment.config import NO_MODEL
    from pgm_places.labelling.model import LoadedModel
    from pgm_places.labelling.options import ModelOptions
    from pgm_places.studio.export_folders import ExportFolders
    from pgm_places.studio.server import serve
    from pgm_places.studio.session import MapSession
    from pgm_places.studio.session_pool import SessionPool
    from pgm_places.teaching.paint import Paint
    from pgm_places.trained import NAMES

    progress = make_progress(quiet=quiet)
    if len(maps) > 1:
        own = {"--labels": labels, "--corrections": corrections, "--drive": drive}
        if name := next((name for name, value in own.items() if value), None):
            raise InputError(f"{name} belongs to one map; start the studio with that map alone")
    loaded_model = None if model == NO_MODEL else LoadedModel.load(ModelOptions(model=model))

    def opened(map_yaml: Path, folder: Path) -> MapSession:
        loaded = read_map(map_yaml, unknown_value, progress)
        session = MapSession(
            loaded,
            folder,
            loaded_model,
            model=model,
            given=_given(labels or (), loaded.grid),
            drive_xy_m=None if drive is None else _path(drive, loaded, progress),
            n_threads=n_threads,
        )
        if session.migration is not None:
            progress.warn(session.migration.message)
        if session.ids_notice:
            progress.warn(session.ids_notice)
        if corrections is not None:
            try:
                session.take(Paint.read(corrections, loaded.grid))
            except BaseException:
                session.close()
                raise
        return session

    tables = [path.with_suffix(".yaml") for path in labels or ()]
    inputs = [*maps, *(labels or ()), *tables, *(() if drive is None else (drive,))]
    if loaded_model is not None and model not in NAMES:
        inputs.append(Path(model))
    places = ExportFolders.started_here(export_to or (), inputs)
    if len(maps) == 1:
        with progress.stage("map"):
            session = opened(maps[0], out or Path(f"{maps[0].stem}-studio"))
        pool = SessionPool.of(session, places)
    else:
        pool = _session_pool(maps, out or Path("maps-studio"), opened, places)
    try:
        serve(
            pool, port=port, on_address=lambda address: _announce(address, browser=not no_browser)
        )
    finally:
        pool.close()


def _session_pool(
    maps: "Sequence[Path]",
    folder: Path,
    opened: "Callable[[Path, Path], MapSession]",
    export_folders: "ExportFolders",
) -> "SessionPool":
    """A pool of several maps, each with a folder of its own."""
    from pgm_places.studio.session_pool import MapEntry, SessionPool

    entries: list[MapEntry] = []
    for map_yaml in maps:
        if not map_yaml.is_file():
            raise InputError(f"{map_yaml}: no such file; give the YAML file of a map")
        same = map_yaml.stem == "map" or any(map_yaml.stem == entry.title for entry in entries)
        title = f"{map_yaml.resolve().parent.name}-{map_yaml.stem}" if same else map_yaml.stem
        if any(title == entry.title for entry in entries):
            raise InputError(f"{map_yaml}: two maps would be called {title!r}; rename one of them")
        own = folder / title
        entries.append(MapEntry(title, own, partial(opened, map_yaml, own)))
    folder.mkdir(parents=True, exist_ok=True)
    return SessionPool(entries, folder, export_folders)


def _given(paths: "Sequence[Path]", grid: "pp.OccupancyGrid") -> "list[GivenLabels]":
    """Labels to compare with, titled by file name."""
    from pgm_places.studio.layers import GivenLabels

    compared: list[GivenLabels] = []
    for path in paths:
        names, labels = read_labels(path, grid)
        title = path.name if all(path.name != other.title for other in compared) else str(path)
        compared.append(GivenLabels(title, labels, names))
    return compared


def _path(drive: Path, loaded: "MapFile", progress: "Progress") -> "NDArray[np.float64]":
    """The positions of a drive in metres; a drive that does not fit the map is refused."""
    from pgm_places.io.logs.trajectories import read_trajectory
    from pgm_places.sensing.map_agreement import check_agreement

    path = read_trajectory(drive).trajectory
    otherwise = "omit --drive to open the map without it"
    message = check_agreement(
        loaded.grid, path, str(loaded.yaml_path), force=False, otherwise=otherwise
    )
    if message is not None:
        progress.warn(message)
    return path.poses[:, :2]


def _announce(address: str, *, browser: bool) -> None:
    say(f"{address}\nOnly this computer can open it. Press Ctrl-C to stop; all edits are saved.")
    if browser:
        import webbrowser

        webbrowser.open(address)
