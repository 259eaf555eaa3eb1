"""Doors found by lists, by lists and networks, and by lines that networks see: kind by kind."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import chain
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from experiments.buildings.lists import DOORWAY
from experiments.buildings.maps import KnownMap
from experiments.floor_network.floors import all_floors, fold_of
from experiments.robot_maps.catalogue import robot_maps
from pgm_places.floor.view import FloorScores
from pgm_places.progress import Progress
from pgm_places.spaces.door_truth import DoorScores, match_doors
from pgm_places.spaces.gates import Gates, gate_candidates, gate_features
from pgm_places.spaces.places import places_between
from pgm_places.spaces.segmentation import Segmentation
from pgm_places.trained import trained_labeler
from pgm_places.unary.floor_model import FloorJudge, FloorModel
from pgm_places.unary.space_model import gate_probabilities

DOOR_STEPS = ("lists alone", "lists and networks", "and door lines")

_SAME_M = 0.15
"""A gate no farther from one of before is the same."""


@dataclass(frozen=True, eq=False)
class MapDoors:
    """The gates of a map before networks have added any, and all.

    Parameters
    ----------
    known : KnownMap
    narrow : Gates
        The candidates where passages narrow.
    of_list : (N,) float64
        What a list that has not seen the building says of them.
    judge : FloorJudge
        Networks that have not seen it either.
    gates : Gates
        All candidates.
    probability : (G,) float64
        What both say of these.
    """

    known: KnownMap
    narrow: Gates
    of_list: NDArray[np.float64]
    judge: FloorJudge
    gates: Gates
    probability: NDArray[np.float64]

    @classmethod
    def of(
        cls,
        known: KnownMap,
        model: FloorModel,
        seen: FloorScores,
        of_list: NDArray[np.float64] | None = None,
    ) -> "MapDoors":
        """By the shipped list, where nothing is given."""
        narrow, judge = gate_candidates(Segmentation.of(known.item.grid)), FloorJudge(model, seen)
        if of_list is None:
            space = trained_labeler().unary_model_.space
            assert space is not None  # the shipped model has such a list
            of_list = gate_probabilities(space.gates, gate_features(narrow))
        cuts = judge.cuts(narrow)
        gates = (
            gate_candidates(Segmentation.of(known.item.grid, cuts=cuts)) if len(cuts) else narrow
        )
        probability = judge.judged(gates, _known_before(narrow, of_list, gates))
        return cls(known, narrow, of_list, judge, gates, probability)

    def scores(self) -> tuple[DoorScores, ...]:
        """Door by door, after each of ``DOOR_STEPS``."""
        both = self.judge.judged(self.narrow, self.of_list)
        steps = (
            (self.narrow, self.of_list),
            (self.narrow, both),
            (self.gates, self.probability),
        )
        return tuple(self._scores(*step) for step in steps)

    def _scores(self, gates: Gates, probability: NDArray[np.float64]) -> DoorScores:
        match = match_doors(gates, self.known.item.labels, DOORWAY)
        return match.scores(places_between(gates, probability).accepted)


def door_table(doors: Mapping[str, Sequence[Sequence[DoorScores]]]) -> str:
    """Doors found, gates that are none, and the share of gates that are doors, by kind."""
    entries = [f"{step}: found, none, precision" for step in DOOR_STEPS]
    lines = [f"| kind | doors | {' | '.join(entries)} |", "|---" * 5 + "|"]
    for kind, maps in [*sorted(doors.items()), ("**all**", [*chain(*doors.values())])]:
        totals = [DoorScores.total(step) for step in zip(*maps, strict=True)]
        entries = [f"{s.found}, {s.invented}, {_percent(s.precision)}" for s in totals]
        lines.append(f"| {kind} | {totals[0].doors} | {' | '.join(entries)} |")
    return "\n".join(lines)


def measure_robots_doors(
    data: Path, models: Sequence[FloorModel], progress: Progress
) -> Mapping[str, Sequence[Sequence[DoorScores]]]:
    """The doors of robots' maps, each by the network that has not seen its building."""
    floors = list(all_floors(data))
    fold, building = fold_of(floors), {each.name: each.building for each in floors}
    found: dict[str, list[tuple[DoorScores, ...]]] = {}
    maps = list(robot_maps(data))
    with progress.stage("doors") as stage:
        for count, (known, _) in enumerate(maps, start=1):
            model = models[fold[building[f"robot_{known.item.name}"]]]
            doors = MapDoors.of(known, model, model.scores(known.item.grid))
            found.setdefault(known.group, []).append(doors.scores())
            stage.update(count / len(maps), known.item.name)
    return found


def _known_before(
    narrow: Gates, probability: NDArray[np.float64], gates: Gates
) -> NDArray[np.float64]:
    """(G,) what the list said of each gate before there were cuts; 0 if it was none.

    At cuts, where the list has no say, that is never asked.
    """
    found = np.zeros(len(gates))
    for g, centre in enumerate(gates.centre_m):
        away = np.hypot(*(narrow.centre_m - centre).T)
        if len(away) and away.min() < _SAME_M:
            found[g] = probability[away.argmin()]
    return found


def _percent(share: float | None) -> str:
    return "-" if share is None else f"{100 * share:.0f} %"
