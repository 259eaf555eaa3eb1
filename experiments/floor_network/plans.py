"""Drawn floors, their robot-like copies, and real maps, by lists and networks held out."""

from collections import defaultdict
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from experiments.buildings.lists import DOORWAY, Scored, scored_maps
from experiments.buildings.maps import NAMES, building_numbers, sampled_maps
from experiments.buildings.scores import SHIPPED, rescaled
from experiments.floor_network.doors import MapDoors, door_table
from experiments.floor_network.floors import all_floors, fold_of, held_out_with
from experiments.floor_network.held_out import networks
from experiments.paper.setting import Setting
from experiments.unseen_kinds import scored_unseen
from pgm_places.evaluation.evaluation import Evaluation, evaluate
from pgm_places.graph.layout import GridLayout
from pgm_places.labelers.place_problem import doorways_at_gates
from pgm_places.progress import Progress
from pgm_places.spaces.door_truth import DoorScores
from pgm_places.unary.floor_model import FloorModel, with_floor
from pgm_places.unary.space_model import MapSpaces, with_gates

N_FOLDS_OF_LISTS = 6
STEPS = ("lists alone", "networks alone", "both, at gates", "and doorways 0.8 m deep")
DEPTH_M = 0.8
"""The depth of doorways on drawn floors."""


def measure_plans(data: Path, kept: Path, n_threads: int | None, progress: Progress) -> None:
    """Print accuracy / balanced accuracy / doorway F1, error of confidence and doors, by kind."""
    setting = Setting(data, progress, n_threads, kept)
    samples = sampled_maps(setting)
    scored = scored_maps(setting, samples, building_numbers(samples, N_FOLDS_OF_LISTS))
    _measure(scored, data, kept, progress)


def measure_kinds(data: Path, kept: Path, n_threads: int | None, progress: Progress) -> None:
    """The same for generated kinds that neither lists nor the network have learned from."""
    scored = scored_unseen(Setting(data, progress, n_threads, kept))
    _measure(scored, data, kept, progress)


def _measure(scored: Sequence[Scored], data: Path, kept: Path, progress: Progress) -> None:
    fold = fold_of(list(all_floors(data)))
    models = [FloorModel((network,), views_per_network=8) for network in networks(kept)]
    found: dict[str, dict[str, list[Evaluation]]] = defaultdict(lambda: defaultdict(list))
    doors: dict[str, list[tuple[DoorScores, ...]]] = defaultdict(list)
    with progress.stage("floors") as stage:
        for count, (item, log_z) in enumerate(zip(scored, rescaled(scored, SHIPPED), strict=True)):
            known = item.sample.known
            building = known.kind if known.kind in fold else held_out_with(known)
            model = models[fold[building]]
            at_doors = MapDoors.of(known, model, model.scores(known.item.grid), item.gate)
            doors[known.group].append(at_doors.scores())
            for step, log_p in _steps(item, log_z, model, at_doors):
                found[known.group][step].append(
                    evaluate(item.truth, log_p.argmax(axis=1), NAMES, beliefs=np.exp(log_p))
                )
            stage.update((count + 1) / len(scored), known.item.name)
    print(f"{_table(found)}\n\n{door_table(doors)}")


def _steps(
    item: Scored, log_z: NDArray[np.float64], model: FloorModel, doors: MapDoors
) -> Iterator[tuple[str, NDArray[np.float64]]]:
    """What the list alone, a network alone, and both say of the lattice's cells.

    Of both, doorways are kept at accepted gates, once as deep as was learned.
    """
    grid, lattice = item.sample.known.item.grid, item.sample.lattice
    layout, seen = GridLayout.of_mask(lattice, source=grid), doors.judge.seen
    yield STEPS[0], with_gates(log_z, item.at_gate, DOORWAY)
    alone = FloorModel((), share=1.0, doorway_share=1.0)
    yield STEPS[1], with_floor(log_z, seen, alone, layout)
    spaces = MapSpaces.of(doors.gates, doors.probability)
    both = with_floor(with_gates(log_z, spaces.at_gates(layout), DOORWAY), seen, model, layout)
    for step, depth_m in zip(STEPS[2:], (None, DEPTH_M), strict=True):
        yield step, doorways_at_gates(both, spaces.doorways, layout, DOORWAY, depth_m)


def _table(found: Mapping[str, Mapping[str, Sequence[Evaluation]]]) -> str:
    lines = [
        f"| kind | maps | {' | '.join(STEPS)} | error of confidence |",
        "|---" * (len(STEPS) + 3) + "|",
    ]
    for kind, steps in sorted(found.items()):
        figures = [" / ".join(f"{100 * v:.1f}" for v in _means(steps[step])) for step in STEPS]
        error = Evaluation.merged(steps[STEPS[2]]).expected_calibration_error or 0.0
        n_maps = len(steps[STEPS[0]])
        lines.append(f"| {kind} | {n_maps} | {' | '.join(figures)} | {100 * error:.1f} |")
    rows = [[_means(steps[step]) for steps in found.values()] for step in STEPS]
    means = [" / ".join(f"{100 * v:.1f}" for v in np.mean(row, axis=0)) for row in rows]
    lines.append(f"| **mean of kinds** | | {' | '.join(means)} | |")
    return "\n".join(lines)


def _means(maps: Sequence[Evaluation]) -> tuple[float, float, float]:
    doorway = [item.f1["doorway"] for item in maps]
    return (
        float(np.mean([item.accuracy for item in maps])),
        float(np.mean([item.balanced_accuracy for item in maps])),
        float(np.nanmean([np.nan if v is None else v for v in doorway])),
    )
