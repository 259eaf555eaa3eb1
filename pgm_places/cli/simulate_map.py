"""``pgm-places simulate-map``: robot-like maps of a labelled plan."""

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from pgm_places.cli.progress import make_progress
from pgm_places.cli.terminal import say

if TYPE_CHECKING:
    from pgm_places.datasets.map_simulation import MapSimulation

__all__ = ["run_simulate_map"]


def run_simulate_map(
    plan_yaml: Path,
    labels: Path,
    out: Path,
    *,
    seeds: Sequence[int],
    options: "MapSimulation",
    unknown_value: int | None,
    quiet: bool,
) -> None:
    """``pgm-places simulate-map``."""
    from pgm_places.datasets.simulated_map import simulate_map
    from pgm_places.io.atomic import check_writable_folder
    from pgm_places.io.maps.label_image import load_labels, save_labels
    from pgm_places.io.maps.label_values import listed_names
    from pgm_places.io.maps.map_server import load_map, save_map
    from pgm_places.maps.labelled_map import LabelledMap

    check_writable_folder(out)
    progress = make_progress(quiet=quiet)
    with progress.stage("plan"):
        loaded = load_map(plan_yaml, unknown_value=unknown_value)
        for message in loaded.warnings:
            progress.warn(message)
        names = tuple(listed_names(labels, None))
        raster = load_labels(labels, names, grid=loaded.grid)
        plan = LabelledMap(loaded.grid, raster, name=plan_yaml.stem)
    with progress.stage("maps"):
        for seed in seeds:
            made = simulate_map(plan, names, seed=seed, options=options)
            stem = f"{plan_yaml.stem}_{seed}"
            written = [
                save_map(made.grid, out / stem),
                save_labels(out / f"{stem}_labels.png", made.labels, names)[0],
            ]
            for path in written:
                say(f"wrote {path}")
