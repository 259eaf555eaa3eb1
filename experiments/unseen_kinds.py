"""Kinds of buildings never learned from: ``python -m experiments.unseen_kinds``.

Every generated kind is left out in turn, together with the kinds that resemble it, and its maps
are labelled by lists learned from all real buildings and the other kinds. Two buildings of each
kind are tested as drawn and as a robot maps them: scaled by 0.8 to 1.25, with cells of 2 to 10 cm,
furnished, bent, at times rotated, with 60 to 100 % of the places visited. They are never learned
from. ``--kept FOLDER`` keeps there what is slow to compute. Without PGM_PLACES_DATA, the
folder of the real maps, lists learn from generated buildings alone.
"""

import argparse
from collections import defaultdict
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from experiments.buildings.lists import AVERAGE, DOORWAY, RECIPES, Scored, scored_maps
from experiments.buildings.maps import (
    CELLS_M,
    GENERATED,
    NAMES,
    SIMULATED,
    WITH_HALLS,
    KnownMap,
    sampled,
    sampled_maps,
)
from experiments.buildings.scores import SHIPPED, doors_of, places_of, rescaled
from experiments.kept import KeptArrays
from experiments.page_tables import SideBySide, show_table, text_of, with_write_docs
from experiments.paper.section import Table
from experiments.paper.setting import Setting
from experiments.setting import setting_of, setting_parser
from pgm_places.datasets import MapSimulation, generate_building, simulate_map
from pgm_places.evaluation.evaluation import Evaluation, evaluate
from pgm_places.maps.coarsening import Coarsening, coarsen, coarsen_labels, refine
from pgm_places.maps.labelled_map import LabelledMap
from pgm_places.spaces.door_truth import DoorScores
from pgm_places.unary.space_model import with_gates

FOLDS = (
    ("cells", "home", "hotel"),
    ("clinic", "university"),
    ("hall", "museum"),
    ("mall", "open-plan", "suite"),
    ("ring", "school"),
    ("office", "varied"),
)
"""Kinds that resemble each other are left out together."""

PER_KIND, FIRST_SEED = 2, 5000
"""Buildings of each kind that are tested, with seeds that no training set has."""

CELLS_TRIED_M = (0.02, 0.03, 0.04, 0.05, 0.075, 0.1)
ROBOT = MapSimulation(scale=(0.8, 1.25), coverage=(0.6, 1.0))
CLEAN = "drawn"
TABLES = ("unseen_kinds",)
_RECIPES = {name: RECIPES[name] for name in (*RECIPES[AVERAGE].mean_of, AVERAGE)}


@dataclass(frozen=True, eq=False)
class Figures:
    """What is measured of one map."""

    cells: Evaluation
    doors: DoorScores
    gates: Evaluation | None
    places: Evaluation | None


def unseen_maps() -> Iterator[KnownMap]:
    """Buildings of every kind, as drawn and as robots map them."""
    kinds = sorted(kind for fold in FOLDS for kind in fold)
    for number in range(PER_KIND * len(kinds)):
        kind, seed = kinds[number // PER_KIND], FIRST_SEED + number
        made = generate_building(
            seed,
            style=kind,  # type: ignore[arg-type]
            halls="hall",
            furniture=False,
            slam_noise=False,
        )
        plan = LabelledMap(made.grid, made.labels, name=f"{kind} {seed}")
        yield KnownMap.of(plan, kind, CLEAN)
        cells_m = CELLS_TRIED_M[number * 5 % len(CELLS_TRIED_M)]
        mapped = simulate_map(
            plan, WITH_HALLS.names, seed=seed, options=ROBOT, resolution_m=cells_m
        )
        yield KnownMap.of(at_model_cells(mapped), kind, SIMULATED)


def at_model_cells(item: LabelledMap) -> LabelledMap:
    """The map with the cells that models are trained at, as labelling does it."""
    if item.grid.resolution_m < CELLS_M:
        grid = coarsen(item.grid, CELLS_M)
        return replace(item, grid=grid, labels=coarsen_labels(item.labels, item.grid, grid))
    grid = refine(item.grid, CELLS_M)
    if grid is item.grid:
        return item
    cells = np.argwhere(grid.free)
    labels = np.full(grid.shape, -1, np.int16)
    labels[tuple(cells.T)] = item.labels[tuple(Coarsening(grid, item.grid).holders(cells).T)]
    return replace(item, grid=grid, labels=labels)


def scored_unseen(setting: Setting) -> list[Scored]:
    """The maps of every kind by lists that learned from no building of its fold."""
    fold_of = {kind: number for number, fold in enumerate(FOLDS) for kind in fold}
    training = sampled_maps(setting)
    kept = KeptArrays(setting.kept)
    samples = training + [sampled(known, kept) for known in unseen_maps()]
    never = len(FOLDS)  # real buildings, and their copies, are in no fold that is tested
    fold = [
        fold_of[each.known.kind] if each.known.source == GENERATED else never for each in training
    ]
    fold += [fold_of[each.known.kind] for each in samples[len(training) :]]
    learned = np.arange(len(samples)) < len(training)
    found = scored_maps(setting, samples, np.array(fold), _RECIPES, learned=learned)
    return [item for item in found if item.sample.known.source != GENERATED]


def figures(scored: Sequence[Scored]) -> dict[str, list[Figures]]:
    """The figures of all maps, by kind of building and of map."""
    found = defaultdict(list)
    for item, log_z in zip(scored, rescaled(scored, SHIPPED), strict=True):
        weighed = with_gates(log_z, item.at_gate, DOORWAY)
        cells = evaluate(item.truth, weighed.argmax(axis=1), NAMES, beliefs=np.exp(weighed))
        found[item.sample.known.group].append(
            Figures(cells, *doors_of(item), places_of(item, weighed))
        )
    return dict(found)


SHOWN = SideBySide(
    ("kind left out",),
    "{map}",
    "{accuracy / balanced / doorway F1}",
    {
        "doors": "{doors found / invented}",
        "ECE": "{ECE of cells / gates / places}",
        "worst": "{worst map}",
    },
)


def row(kind: str, source: str, maps: Sequence[Figures]) -> tuple[str, ...]:
    """A row of the table."""
    per_map = [(f.cells.accuracy, f.cells.balanced_accuracy, f.cells.f1["doorway"]) for f in maps]
    means = np.nanmean(np.array(per_map, np.float64), axis=0)
    doors, found = sum(f.doors.doors for f in maps), sum(f.doors.found for f in maps)
    accepted, right = sum(f.doors.accepted for f in maps), sum(f.doors.right for f in maps)
    errors = []
    for part in ("cells", "gates", "places"):
        known = [getattr(f, part) for f in maps if getattr(f, part) is not None]
        errors.append(100 * (Evaluation.merged(known).expected_calibration_error or 0.0))
    return (
        kind,
        source,
        " / ".join(f"{100 * value:.1f}" for value in means),
        f"{100 * min(accuracy for accuracy, _, _ in per_map):.1f}",
        f"{100 * found / doors:.1f} / {100 * (accepted - right) / max(accepted, 1):.1f}",
        " / ".join(f"{value:.1f}" for value in errors),
    )


def table(found: Mapping[str, Sequence[Figures]]) -> Table:
    """A row per kind of building and of map, and for all of them."""
    heading = (
        "kind left out",
        "map",
        "accuracy / balanced / doorway F1",
        "worst map",
        "doors found / invented",
        "ECE of cells / gates / places",
    )
    rows = []
    for name, maps in sorted(found.items()):
        kind, _, source = name.partition(", ")
        rows.append(row(kind, source, maps))
    for source in (CLEAN, SIMULATED):
        every = [f for name, maps in found.items() if name.endswith(source) for f in maps]
        rows.append(row("all", source, every))
    return Table("", heading, tuple(rows))


def parser() -> argparse.ArgumentParser:
    """What the command takes."""
    return with_write_docs(setting_parser(__doc__))


def main() -> None:
    """Write the table."""
    given = parser().parse_args()
    found = figures(scored_unseen(setting_of(given)))
    show_table("unseen_kinds", text_of([SHOWN.of(table(found))]), write=given.write_docs)


if __name__ == "__main__":
    main()
