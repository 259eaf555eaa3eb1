"""Map checks of ``pgm-places doctor``: details of one map, a table of several."""

import tempfile
import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

import pgm_places as pp
from pgm_places.batch.found_maps import find_maps
from pgm_places.batch.map_task import Failure, MapTask, label_one
from pgm_places.cli.terminal import make_progress, say, shares_line, text_table
from pgm_places.errors import InputError, MapError, OutputError
from pgm_places.io.maps.map_server import MapFile, correct_map, save_map
from pgm_places.labelers.labelled_places import at_model_resolution
from pgm_places.labelling.model import LoadedModel
from pgm_places.labelling.options import LabelOptions
from pgm_places.options import UnknownGrey
from pgm_places.progress import duration
from pgm_places.simulation.building import generate_building
from pgm_places.spaces.unentered import find_unentered

# Costs in units of labelling one free cell at the model's resolution: a constant per map, and per
# cell of the original map for reading and painting. Fitted to processor times on one thread.
_OF_A_MAP, _OF_A_CELL = 15_000, 0.05


@dataclass(frozen=True)
class Forecast:
    """Cells of a map, and free cells at the model's resolution, which get labels."""

    n_cells: int
    n_free: int

    @property
    def work(self) -> float:
        """Labelling time in units of one free cell.

        Examples
        --------
        >>> Forecast(n_cells=1_000_000, n_free=200_000).work
        265000.0
        """
        return _OF_A_MAP + _OF_A_CELL * self.n_cells + self.n_free


def seconds_per_cell(options: LabelOptions) -> float:
    """Processor time per unit of work with a model, measured on a small generated floor."""
    model = LoadedModel.load(options)
    grid = generate_building(1, size="small", resolution_m=0.05).grid
    used, _ = at_model_resolution(model.labeler, grid)
    with tempfile.TemporaryDirectory(prefix="pgm-places-") as temporary:
        folder = Path(temporary)
        map_yaml, out = save_map(grid, folder / "floor"), folder / "out"
        _, *seconds = [  # the first warms up
            _processor_seconds(MapTask("floor", map_yaml, out / name, options, model.sha256))
            for name in ("first", "second", "third", "fourth")
        ]
    # Other load on the machine makes a run slower, never faster.
    return min(seconds) / Forecast(grid.cells.size, int(used.free.sum())).work


def _processor_seconds(task: MapTask) -> float:
    """The processor time of a task; elapsed time depends on other load."""
    start = time.process_time()
    outcome = label_one(task)
    if isinstance(outcome, Failure):
        raise InputError(f"the speed of this machine could not be measured: {outcome.message}")
    return time.process_time() - start


_UNENTERED = "'label' gives it no label, or all of it with --unentered"


def check_map(
    path: Path, labeler: pp.PlaceLabeler, unknown_value: UnknownGrey | None, *, fix: bool
) -> None:
    """Print the properties and problems of one map."""
    loaded = pp.load_map(path, unknown_value=unknown_value)
    if fix:
        loaded = _corrected(path, loaded)
    grid = loaded.grid
    height, width = grid.shape
    size = f"{width * grid.resolution_m:.1f} m x {height * grid.resolution_m:.1f} m"
    say(f"{path}: image {loaded.image_path}")
    say(f"{width} x {height} cells of {grid.resolution_m:g} m ({size})")
    say(f"origin {grid.origin_xy_m}, yaw {grid.yaw_rad:g} rad")
    say(shares_line(loaded.fractions))
    (used, problems), notes = _examined(loaded, labeler), list[str]()
    if unentered := find_unentered(grid):
        notes.append(f"{unentered}; {_UNENTERED}")
    if grid.yaw_rad:
        notes.append(
            f"the map is rotated by {np.degrees(grid.yaw_rad):.4g} degrees about its origin: "
            "positions of places are in the map frame, rasters are aligned with the image; "
            "Nav2's costmaps ignore the rotation"
        )
    if used is not None:
        say(f"{int(used.free.sum()):,} cells of {used.resolution_m:g} m to label")
    for note in notes:
        say(f"note: {note}")
    for message in problems:
        say(f"warning: {message}")
    if not problems:
        say("no problems found")


def _examined(
    loaded: MapFile, labeler: pp.PlaceLabeler
) -> tuple[pp.OccupancyGrid | None, list[str]]:
    """The map at the model's resolution, or None; the warnings of 'label'."""
    try:
        used, warnings = at_model_resolution(labeler, loaded.grid)
    except MapError as error:
        return None, [*loaded.warnings, str(error)]
    return used, [*loaded.warnings, *warnings]


@dataclass(frozen=True)
class _Row:
    """One row of the table; numbers are None for an unreadable map."""

    name: str
    resolution_m: float | None = None
    free_m2: float | None = None
    forecast: Forecast | None = None
    problems: tuple[str, ...] = ()

    def cells(self, speed: float) -> list[str]:
        """Texts of the table's columns; ``speed`` in seconds per unit of work."""
        seconds = None if self.forecast is None else speed * self.forecast.work
        return [
            self.name,
            "-" if self.resolution_m is None else f"{self.resolution_m:g}",
            "-" if self.free_m2 is None else f"{self.free_m2:,.1f}",
            "-" if self.forecast is None else f"{self.forecast.n_free:,}",
            "-" if seconds is None else duration(max(1.0, seconds)),
            str(len(self.problems) or "-"),
        ]


def check_maps(
    arguments: Sequence[str], model: str, unknown_value: UnknownGrey | None, *, fix: bool
) -> bool:
    """Print a table of several maps with estimated labelling times; whether all can be labelled."""
    chosen = find_maps(arguments)
    options = LabelOptions(model=model)
    labeler = LoadedModel.load(options).labeler
    rows, progress = [], make_progress(quiet=False)
    with progress.stage("maps") as stage:
        for found_map in chosen.maps:
            rows.append(_row(found_map.name, found_map.path, labeler, unknown_value, fix=fix))
            stage.update(len(rows) / len(chosen.maps), found_map.name)
    forecasts = [row.forecast for row in rows if row.forecast is not None]
    if not forecasts:
        say(f"\n{_table(rows, 0.0)}")
    else:
        with progress.stage("speed of this machine"):
            speed = seconds_per_cell(options)
        say(f"\n{_table(rows, speed)}\n")
        say(
            f"{len(forecasts):,} of {len(rows):,} maps can be labelled: "
            f"{sum(forecast.n_free for forecast in forecasts):,} cells in about "
            f"{duration(speed * sum(forecast.work for forecast in forecasts))} of processor time"
        )
        say(
            "(estimated for one thread from a generated floor, with labels, places and files: "
            f"{1e6 * speed:.0f} µs per cell)"
        )
    for row in rows:
        for problem in row.problems:
            say(f"{row.name}: {problem}")
    return len(forecasts) == len(rows)


def _table(rows: Sequence[_Row], speed: float) -> str:
    heading = ["map", "cell (m)", "free (m²)", "cells to label", "time (about)", "problems"]
    return text_table([heading, *(row.cells(speed) for row in rows)])


def _row(
    name: str, path: Path, labeler: pp.PlaceLabeler, unknown_value: UnknownGrey | None, *, fix: bool
) -> _Row:
    problems = []
    try:
        loaded = pp.load_map(path, unknown_value=unknown_value)
    except MapError as error:
        return _Row(name, problems=(str(error),))
    if fix:
        try:
            loaded = _corrected(path, loaded)
        except (MapError, OutputError) as error:  # go on with the other maps
            problems.append(str(error))
    used, found_problems = _examined(loaded, labeler)
    grid, forecast = loaded.grid, None
    if used is not None:
        forecast = Forecast(grid.cells.size, int(used.free.sum()))
    free_m2 = float(loaded.fractions.free * grid.cells.size * grid.resolution_m**2)
    return _Row(name, grid.resolution_m, free_m2, forecast, (*problems, *found_problems))


def _corrected(path: Path, loaded: MapFile) -> MapFile:
    """Correct the thresholds or image path in the map's file, if needed, and reload the map."""
    if not loaded.corrections:
        return loaded
    original = correct_map(path, loaded.corrections)
    changes = ", ".join(f"{key} {value}" for key, value in loaded.corrections.items())
    say(f"corrected {path}: {changes}; original saved as {original.name}")
    return pp.load_map(path, unknown_value=loaded.unknown_value)
