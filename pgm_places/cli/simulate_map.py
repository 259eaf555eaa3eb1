"""``pgm-places simulate-map``: robot-like maps of a labelled plan."""

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from pgm_places.cli.progress import make_progress
from pgm_places.cli.terminal import say_written

if TYPE_CHECKING:
    from pgm_places.datasets.map_simulation import MapSimulation

__all__ = ["run_simulate_map"]

_ENDS = (".yaml", ".png", "_labels.png", "_labels.yaml")


def run_simulate_map(
    plan_yaml: Path,
    labels: Path,
    out: Path,
    *,
    seeds: Sequence[int],
    options: "MapSimulation",
    force: bool,
    unknown_value: int | None,
    quiet: bool,
) -> None:
    """``pgm-places simulate-map``."""
    from pgm_places.datasets.simulated_map import simulate_map
    from pgm_places.io.maps.label_image import load_labels, save_labels
    from pgm_places.io.maps.label_values import listed_names
    from pgm_places.io.maps.map_server import load_map, save_map
    from pgm_places.io.output_set import output_set
    from pgm_places.maps.labelled_map import LabelledMap

    progress = make_progress(quiet=quiet)
    with progress.stage("plan"):
        loaded = load_map(plan_yaml, unknown_value=unknown_value)
        for message in loaded.warnings:
            progress.warn(message)
        names = tuple(listed_names(labels, None))
        raster = load_labels(labels, names, grid=loaded.grid)
        plan = LabelledMap(loaded.grid, raster, name=plan_yaml.stem)
    stems = {seed: f"{plan_yaml.stem}_{seed}" for seed in seeds}
    listed = [f"{stem}{end}" for stem in stems.values() for end in _ENDS]
    by = f"simulate-map {plan_yaml.stem} {seeds[0]}-{seeds[-1]}"
    with (
        output_set(out, by, names=listed, force=force, shared=True) as files,
        progress.stage("maps"),
    ):
        for seed, stem in stems.items():
            made = simulate_map(plan, names, seed=seed, options=options)
            save_map(made.grid, files.stage / stem)
            save_labels(files.stage / f"{stem}_labels.png", made.labels, names)
    say_written(files)
