"""What labelling gates and places together with the cells is worth: buildings left out.

``PGM_PLACES_DATA=DATA python -m experiments.space_field [--kept FOLDER]``

The lists are those of ``pgm-places reproduce buildings`` that take halls as corridors; they have
not seen the building that they score. Fields label the same lattice of cells. Their weights are
chosen, or learned, on the other folds of buildings.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import product

import numpy as np
from numpy.typing import NDArray

from experiments.setting import asked_setting
from pgm_places.evaluation.evaluation import Evaluation, evaluate
from pgm_places.graph.edge_kind import EdgeKind
from pgm_places.graph.label_graph import LabelGraph
from pgm_places.graph.layout import GridLayout
from pgm_places.graph.node_kind import NodeKind
from pgm_places.inference.backends import build
from pgm_places.inference.potentials import Potentials
from pgm_places.inference.problem import LabelingProblem
from pgm_places.labelers.space_problem import space_problem
from pgm_places.models.amn import AssociativeMarkovNetwork
from pgm_places.models.decoding import decode
from pgm_places.models.mrf import PottsField
from pgm_places.models.space_field import SpaceField
from pgm_places.reproduce.building_lists import DOORWAY, RECIPES, Scored, scored_maps
from pgm_places.reproduce.building_maps import (
    LATTICE_STEP,
    NAMES,
    building_numbers,
    sampled_maps,
)
from pgm_places.reproduce.building_scores import lattice_graph
from pgm_places.reproduce.buildings import N_FOLDS
from pgm_places.reproduce.figures import percent
from pgm_places.spaces.door_truth import match_doors
from pgm_places.spaces.gates import gate_candidates
from pgm_places.spaces.segmentation import Segmentation
from pgm_places.unary.space_model import MapSpaces, with_gates

LISTS = "halls as corridors"
WEIGHTS = {
    "weight": (0.25, 0.4),
    "place_weight": (0.1, 0.25, 0.5),
    "passage_weight": (0.0, 0.1),
    "gate_threshold": (0.5, 0.7),
}
"""What the grid tries."""

POTTS_WEIGHTS = (0.0, 0.1, 0.25, 0.4, 0.6)
PENALTY = 1000.0
LEARNED_MAPS = 16
"""Max margin learns from at most so many maps, the smallest of each kind of map in turn."""

Labels = NDArray[np.int64]


@dataclass(frozen=True, eq=False)
class Example:
    """A map of a building left out: its cells alone, and with its gates and places.

    Parameters
    ----------
    scored : Scored
    cells, whole : LabelingProblem
    truth : (N + G + P,) int64
        Labels of all nodes of ``whole``: of gates by the doors that they match, otherwise, as of
        places, that of most of their cells; -1 where unknown.
    """

    scored: Scored
    cells: LabelingProblem
    whole: LabelingProblem
    truth: Labels

    @classmethod
    def of(cls, scored: Scored) -> "Example":
        """The problems of a map."""
        item = scored.sample.known.item
        lattice = scored.sample.lattice
        log_z = with_gates(scored.folded(LISTS), scored.at_gate, DOORWAY)
        graph = lattice_graph(item.grid, np.argwhere(lattice), LATTICE_STEP)
        cells = LabelingProblem(graph, NAMES, log_z)
        gates = gate_candidates(Segmentation.of(item.grid))
        layout = GridLayout.of_mask(lattice, None, item.grid)
        whole = space_problem(cells, layout, MapSpaces.of(gates, scored.gate), DOORWAY)
        doors = match_doors(gates, item.labels, DOORWAY)
        truth = _majorities(whole.graph, scored.truth)
        of_gates = slice(graph.n_nodes, graph.n_nodes + len(gates))
        truth[of_gates][doors.is_doorway] = DOORWAY
        truth[of_gates][~doors.known & ~doors.is_doorway] = -1
        return cls(scored, cells, whole, truth)

    def figures(self, labels: Labels) -> tuple[float, float, float]:
        """Accuracy, balanced accuracy and doorway F1 of labels of the cells, or of all nodes."""
        truth = self.scored.truth
        found: Evaluation = evaluate(truth, labels[: len(truth)], NAMES)
        f1 = found.f1["doorway"]
        return found.accuracy, found.balanced_accuracy, np.nan if f1 is None else f1


def _majorities(graph: LabelGraph, of_cells: Labels) -> Labels:
    """(N + G + P,) the labels of the cells, and the one of most cells at each gate or place.

    Doorways are not counted.
    """
    assert graph.node_kind is not None and graph.edge_kind is not None
    votes = np.zeros((graph.n_nodes, len(NAMES)), np.int64)
    links = graph.edges[np.isin(graph.edge_kind, (EdgeKind.CELL_GATE, EdgeKind.CELL_PLACE))]
    np.add.at(votes, (links[:, 1], of_cells[links[:, 0]]), 1)
    votes[:, DOORWAY] = 0
    found = np.where(votes.any(axis=1), votes.argmax(axis=1), -1)
    found[: len(of_cells)] = of_cells
    return np.asarray(found)


# ------------------------------------------------------------------ methods


def potts(weight: float) -> Callable[[Example], Labels]:
    """The field of cells alone."""
    return lambda item: PottsField(weight).infer(item.cells).labels


def field(method: SpaceField) -> Callable[[Example], Labels]:
    """The field of cells, gates and places."""
    return lambda item: method.infer(item.whole).labels


def places_alone() -> Callable[[Example], Labels]:
    """The same without nodes of gates: their evidence is in the cells' scores, as by itself."""

    def label(item: Example) -> Labels:
        graph = item.whole.graph
        assert graph.node_kind is not None and item.whole.unary is not None
        unary = item.whole.unary.copy()
        unary[: item.cells.graph.n_nodes] = item.cells.unary
        problem = replace(item.whole, unary=unary)
        no_gates = problem.subproblem(graph.node_kind != NodeKind.GATE)
        return SpaceField().infer(no_gates).labels

    return label


def truncated(share: float) -> Callable[[Example], Labels]:
    """The same, where a place may be mixed: it then costs as if ``share`` of it disagreed."""

    def label(item: Example) -> Labels:
        method = SpaceField()
        known, graph = method.potentials(item.whole), item.whole.graph
        assert known.agreement is not None and graph.node_kind is not None
        mixed = np.full((graph.n_nodes, 1), -np.inf)
        of_place = graph.node_kind == NodeKind.PLACE
        in_place = graph.edges[graph.edge_kind == EdgeKind.CELL_PLACE, 1]
        size = np.bincount(in_place, minlength=graph.n_nodes)[of_place]
        mixed[of_place, 0] = (1 - share) * method.place_weight * size
        unary = np.concatenate([known.unary, mixed], axis=1)
        earned = np.concatenate([known.agreement, np.zeros((graph.n_edges, 1))], axis=1)
        return decode(graph, Potentials(unary, agreement=earned)).labels

    return label


# ------------------------------------------------------------------ choosing and learning


def chosen(
    examples: Sequence[Example], tries: Mapping[str, Callable[[Example], Labels]]
) -> tuple[NDArray[np.float64], list[str]]:
    """(M, 3) figures of each map by the try that is best on the other folds; and these tries."""
    found = {
        name: np.array([item.figures(method(item)) for item in examples])
        for name, method in tries.items()
    }
    fold = np.array([item.scored.fold for item in examples])
    groups = np.array([item.scored.sample.known.group for item in examples])
    result, names = np.empty((len(examples), 3)), []
    for number in range(N_FOLDS):
        others = fold != number
        best = max(found, key=lambda name: _mean(found[name][others], groups[others]).mean())
        result[~others] = found[best][~others]
        names.append(best)
    return result, names


def _mean(figures: NDArray[np.float64], groups: NDArray[np.str_]) -> NDArray[np.float64]:
    """(3,) mean over kinds of maps of the means over their maps."""
    parts = [np.nanmean(figures[groups == name], axis=0) for name in np.unique(groups)]
    return np.asarray(np.mean(parts, axis=0))


def max_margin(examples: Sequence[Example], penalty: float, *, spaces: bool) -> NDArray[np.float64]:
    """(M, 3) figures of associative Markov networks, each learned on the other folds.

    With ``spaces`` nodes are cells, gates and places, each kind of edge has its own weights, and
    node features are told apart by the kind of node; else nodes are the cells alone.
    """
    unfitted = AssociativeMarkovNetwork(
        C=penalty,
        edge_features=("kind",) if spaces else ("constant",),
        node_features="raw" if spaces else "logz",
        learning_tolerance=0.02,
        max_cuts=200,
        certify_learning=False,
    )
    figures = np.empty((len(examples), 3))
    for number in range(N_FOLDS):
        some = _smallest([item for item in examples if item.scored.fold != number])
        if spaces:
            network = unfitted.fit([_by_kind(item) for item in some], [i.truth for i in some])
        else:
            network = unfitted.fit([i.cells for i in some], [i.scored.truth for i in some])
        for k, item in enumerate(examples):
            if item.scored.fold == number:
                problem = _by_kind(item) if spaces else item.cells
                figures[k] = item.figures(network.infer(problem).labels)
    return figures


def _smallest(examples: Sequence[Example]) -> list[Example]:
    """The smallest maps of each kind in turn."""
    order = sorted(examples, key=lambda item: item.whole.graph.n_nodes)
    rank: dict[str, int] = {}
    turns: list[tuple[int, int, Example]] = []
    for item in order:
        group = item.scored.sample.known.group
        turns.append((rank.setdefault(group, 0), len(turns), item))
        rank[group] += 1
    return [item for *_, item in sorted(turns, key=lambda turn: turn[:2])[:LEARNED_MAPS]]


def _by_kind(item: Example) -> LabelingProblem:
    """The problem with its unary in columns of their own for each kind of node.

    A gate's evidence counts as often as it has cells, as in :class:`SpaceField`.
    """
    kinds, unary = item.whole.graph.node_kind, item.whole.unary
    assert kinds is not None and unary is not None
    is_cell, is_gate = kinds == NodeKind.CELL, kinds == NodeKind.GATE
    floored = np.maximum(unary, -12.0)
    odds = floored[:, DOORWAY] - floored[:, 0]
    n_cells = item.whole.graph.degree - 2
    columns = np.concatenate(
        [
            np.where(is_cell[:, None], floored, 0.0),
            np.where(is_gate, n_cells * odds, 0.0)[:, None],
            np.stack([is_gate, kinds == NodeKind.PLACE], axis=1),
        ],
        axis=1,
    )
    return replace(item.whole, node_features=columns.astype(np.float64))


# ------------------------------------------------------------------ the table


def table(examples: Sequence[Example], log: Callable[[str], None]) -> str:
    """One row for each method, one column for each kind of map."""
    groups = np.array([item.scored.sample.known.group for item in examples])
    kinds = np.unique(groups)
    lines = [
        f"| method | {' | '.join(kinds)} | mean of kinds |",
        f"|---{'|---' * (len(kinds) + 1)}|",
    ]

    def add(name: str, figures: NDArray[np.float64]) -> None:
        parts = [np.nanmean(figures[groups == kind], axis=0) for kind in kinds]
        cells = [" / ".join(map(percent, part)) for part in [*parts, np.mean(parts, axis=0)]]
        lines.append(f"| {name} | {' | '.join(cells)} |")
        log(lines[-1])

    def of(method: Callable[[Example], Labels]) -> NDArray[np.float64]:
        return np.array([item.figures(method(item)) for item in examples])

    add("list with spaces, doorways weighed by gates", of(potts(0.0)))
    add("Potts 0.25, cells alone", of(potts(0.25)))
    figures, names = chosen(examples, {f"{w:g}": potts(w) for w in POTTS_WEIGHTS})
    add(f"Potts, weight chosen: {_counted(names)}", figures)
    add("gates, places and passages: `space_field`", of(field(SpaceField())))
    add("gates and places, no passages", of(field(SpaceField(passage_weight=0.0))))
    add("gates alone", of(field(SpaceField(place_weight=0.0, passage_weight=0.0))))
    add("places alone, doorways weighed by gates", of(places_alone()))
    add("`space_field`, mixed places truncated at 0.25", of(truncated(0.25)))
    add("`space_field`, gates from 0.5 on", of(field(SpaceField(gate_threshold=0.5))))
    for spaces in (False, True):
        what = "cells, gates and places" if spaces else "cells alone"
        figures = max_margin(examples, PENALTY, spaces=spaces)
        add(f"max margin, C = {PENALTY:g}, {what}", figures)
    grid = [dict(zip(WEIGHTS, values, strict=True)) for values in product(*WEIGHTS.values())]
    tries = {" ".join(f"{v:g}" for v in w.values()): field(build("space_field", w)) for w in grid}
    figures, names = chosen(examples, tries)
    add(f"weights chosen ({', '.join(WEIGHTS)}): {_counted(names)}", figures)
    return "\n".join(lines)


def _counted(names: Sequence[str]) -> str:
    return ", ".join(f"{name} x {names.count(name)}" for name in dict.fromkeys(names))


def main() -> None:
    """Print the table."""
    setting = asked_setting(__doc__)
    samples = sampled_maps(setting)
    recipes = {LISTS: RECIPES[LISTS]}
    scored = scored_maps(setting, samples, building_numbers(samples, N_FOLDS), recipes)
    print(table([Example.of(item) for item in scored], lambda line: print(line, flush=True)))


if __name__ == "__main__":
    main()
