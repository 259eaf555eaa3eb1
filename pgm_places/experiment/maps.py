"""Loading the labelled maps of an experiment, resampled and with windows as configured."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pgm_places.errors import LabelError
from pgm_places.experiment.experiment import Experiment
from pgm_places.experiment.map_config import MapConfig
from pgm_places.io.maps.label_image import load_labels
from pgm_places.io.maps.map_server import load_map
from pgm_places.io.maps.regions import load_regions
from pgm_places.io.maps.windows import window_mask
from pgm_places.maps.coarsening import coarsen, coarsen_labels
from pgm_places.maps.labelled_map import LabelledMap
from pgm_places.maps.occupancy_grid import OccupancyGrid, at_cells
from pgm_places.teaching.paint import Paint


def load_maps(experiment: Experiment, part: str) -> list[LabelledMap]:
    """The maps among the sources of ``"train"`` or ``"test"``, resampled and with windows."""
    return experiment.loaded(part, "maps", lambda item: not item.is_drive, load_map_of)


def load_map_of(experiment: Experiment, source: MapConfig, where: str) -> LabelledMap:
    """A labelled map as configured; ``where`` names it in messages.

    Raises
    ------
    LabelError
        No free cell inside the window has a label.
    """
    limits = source.window
    if source.generated is None:
        grid, labels, origin = _read_map(experiment, source)
    else:
        grid, labels, origin, split = _generated(experiment, source.generated, source.drawn)
        if source.half is not None:
            limits["columns"] = (0, split) if source.half == "left" else (split, None)
    name = source.name or _default_name(source, origin)
    building = source.building or str(origin)
    fine = LabelledMap(grid, labels, window_mask(grid, **limits), name, building, source.domain)
    made = (_coarsened if source.simulated is None else _simulated)(experiment, source, fine)
    if not made.labelled_cells.any():
        raise LabelError(
            f"{where} ({name}): no free cell inside the window has a label; check that the labels "
            "belong to this map and that the window covers them"
        )
    return made


def _coarsened(experiment: Experiment, _source: MapConfig, fine: LabelledMap) -> LabelledMap:
    """A map with cells of the configured size."""
    grid, target_m = fine.grid, experiment.config.resolution_m
    if target_m is None or np.isclose(target_m, grid.resolution_m, rtol=1e-3, atol=0):
        return fine
    coarse = coarsen(grid, target_m)
    # A coarse cell belongs to the window that contains its centre.
    centres = coarse.cell_centres_m(np.argwhere(np.ones(coarse.shape, np.bool_)))
    assert fine.window is not None
    chosen = at_cells(fine.window, grid.cells_at_m(centres), False)
    labels = coarsen_labels(fine.labels, grid, coarse)
    return replace(fine, grid=coarse, labels=labels, window=chosen.reshape(coarse.shape))


def _simulated(experiment: Experiment, source: MapConfig, plan: LabelledMap) -> LabelledMap:
    """The simulated robot map of a plan, with cells of the configured size."""
    from pgm_places.simulation.simulated_map import simulate_map

    config = experiment.config
    made = simulate_map(
        plan,
        config.labels.names,
        seed=source.simulated or 0,
        options=source.simulation,
        resolution_m=config.resolution_m,
    )
    return replace(made, name=source.name or made.name, domain=source.domain)


def load_grid(experiment: Experiment, source: MapConfig) -> LabelledMap:
    """The map of a log, with cells of the configured size; all labels are -1 without a file."""
    grid, labels, origin = _read_map(experiment, source)
    name = source.name or _default_name(source, origin)
    window = window_mask(grid, **source.window)
    return _coarsened(experiment, source, LabelledMap(grid, labels, window, name, str(origin)))


def _read_map(
    experiment: Experiment, source: MapConfig
) -> tuple[OccupancyGrid, NDArray[np.int16], Path]:
    names = experiment.config.labels.names
    yaml_path = experiment.resolve(str(source.map))
    loaded = load_map(yaml_path, compat=source.compat, unknown_value=source.unknown_value)
    for message in loaded.warnings:
        experiment.warn(f"{loaded.name}: {message}")
    for path in (loaded.yaml_path, loaded.image_path):
        experiment.record_input(path)
    labels = np.full(loaded.grid.shape, -1, np.int16)
    if source.labels is not None:
        path = experiment.resolve(source.labels)
        labels = load_labels(path, names, grid=loaded.grid, classes=source.classes)
        experiment.record_input(path)
    elif source.regions is not None:
        path = experiment.resolve(source.regions)
        labels = load_regions(path, names, loaded.grid, classes=source.classes)
        experiment.record_input(path)
    if source.corrections is not None:
        path = experiment.resolve(source.corrections)
        known = Paint.read(path, loaded.grid, names).labels
        experiment.record_input(path)
        labels = np.where(known >= 0, known, labels)
    return loaded.grid, labels, yaml_path


def _generated(
    experiment: Experiment, seed: int, drawn: dict[str, Any]
) -> tuple[OccupancyGrid, NDArray[np.int16], Path, int]:
    """A generated building with the configuration's labels, its title, and the border column."""
    from pgm_places.simulation.building import generate_building

    building = generate_building(seed, **drawn)
    names = experiment.config.labels.names
    numbers = [names.index(name) if name in names else -1 for name in building.label_names]
    # The last entry is for -1, "no label".
    labels = np.array([*numbers, -1], np.int16)[building.labels]
    how = ", ".join(f"{key} {value}" for key, value in drawn.items())
    title = Path(f"generated building {seed}" + (f" ({how})" if how else ""))
    return building.grid, labels, title, building.split_column


def _default_name(source: MapConfig, origin: Path) -> str:
    name = origin.stem if origin.stem != "map" else origin.parent.name
    parts = [] if source.half is None else [f"{source.half} half"]
    for axis, limits in source.window.items():
        low, high = ("" if value is None else f"{value:g}" for value in limits)
        parts.append(f"{axis} {low}..{high}")
    return f"{name} ({', '.join(parts)})" if parts else name
