"""``pgm-places simulate-map``: robot-like maps of a labelled plan."""

from pathlib import Path
from typing import Annotated

from pgm_places.cli.arguments import Force, Out, Quiet, UnknownValue
from pgm_places.cli.declarations import Argument, Option
from pgm_places.cli.flags import option_flags
from pgm_places.cli.progress import make_progress
from pgm_places.cli.terminal import say_written
from pgm_places.datasets.map_simulation import MapSimulation
from pgm_places.options import Seed, Whole

__all__ = ["simulate_map"]

_ENDS = (".yaml", ".png", "_labels.png", "_labels.yaml")


@option_flags("options", MapSimulation)
def simulate_map(
    plan_yaml: Annotated[
        Path, Argument(metavar="PLAN.yaml", help="A clean map, such as one from CAD.")
    ],
    labels: Annotated[Path, Option(help="Label image of the plan.")],
    out: Out,
    *,
    seed: Annotated[Seed, Option(help="Seed of the first map.")] = 0,
    copies: Annotated[Whole, Option(help="Number of maps, a seed for each.")] = 1,
    options: MapSimulation,
    unknown_value: UnknownValue = None,
    force: Force = False,
    quiet: Quiet = False,
) -> None:
    """Turn a labelled plan into robot-like maps.

    Options written LOW,HIGH are ranges; each map draws a value from them.
    """
    from pgm_places.datasets.simulated_map import simulate_map as simulated
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
            save_map(made.grid, files.stage / stem)
            save_labels(files.stage / f"{stem}_labels.png", made.labels, names)
    say_written(files)
