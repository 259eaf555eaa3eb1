"""Kinds of buildings never learned from.

Every generated kind is left out in turn, together with the kinds that resemble it, and its maps
are labelled by lists learned from all real buildings and the other kinds. Two buildings of each
kind are tested as drawn and as a robot maps them: scaled by 0.8 to 1.25, with cells of 2 to 10 cm,
furnished, bent, at times rotated, with 60 to 100 % of the places visited. They are never learned
from. ``python -m experiments.floor_network kinds`` measures them.
"""

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from experiments.buildings.lists import Scored, scored_maps
from experiments.buildings.maps import (
    CELLS_M,
    GENERATED,
    SIMULATED,
    WITH_HALLS,
    KnownMap,
    sampled,
    sampled_maps,
)
from experiments.kept import KeptArrays
from experiments.paper.setting import Setting
from pgm_places.datasets import MapSimulation, generate_building, simulate_map
from pgm_places.maps.coarsening import Coarsening, coarsen, coarsen_labels, refine
from pgm_places.maps.labelled_map import LabelledMap

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
    found = scored_maps(setting, samples, np.array(fold), learned=learned)
    return [item for item in found if item.sample.known.source != GENERATED]
