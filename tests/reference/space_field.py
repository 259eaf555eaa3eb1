"""The field over cells, gates and places term by term, from lists instead of a graph."""

from dataclasses import dataclass
from itertools import pairwise, product

import numpy as np
from numpy.typing import NDArray

from pgm_places.graph.edge_kind import EdgeKind
from pgm_places.graph.label_graph import LabelGraph
from pgm_places.graph.node_kind import NodeKind
from pgm_places.inference.problem import LabelingProblem

DOORWAY = 2
NAMES = ("corridor", "room", "doorway")


@dataclass(frozen=True)
class TinyFloor:
    """A few cells in a row with their log z (n, 3), and the spaces they belong to."""

    log_z: NDArray[np.float64]
    place_of_cell: tuple[int, ...]  # -1 for none
    cells_of_gate: tuple[tuple[int, ...], ...]
    sides_of_gate: tuple[tuple[int, int], ...]
    probability: tuple[float, ...]
    n_places: int

    @property
    def problem(self) -> LabelingProblem:
        n, g = len(self.log_z), len(self.probability)
        edges = [((i, i + 1), EdgeKind.AXIS) for i in range(n - 1)]
        for i, place in enumerate(self.place_of_cell):
            if place >= 0:
                edges.append(((i, n + g + place), EdgeKind.CELL_PLACE))
        for k in range(g):
            edges += [((i, n + k), EdgeKind.CELL_GATE) for i in self.cells_of_gate[k]]
            edges += [((n + k, n + g + s), EdgeKind.GATE_PLACE) for s in self.sides_of_gate[k]]
        kinds = [NodeKind.CELL] * n + [NodeKind.GATE] * g + [NodeKind.PLACE] * self.n_places
        graph = LabelGraph.from_edges(
            len(kinds),
            [pair for pair, _ in edges],
            edge_kind=[kind for _, kind in edges],
            node_kind=kinds,
        )
        gates = [[np.log(1 - p), np.log(1 - p), np.log(p)] for p in self.probability]
        places = [[0.0, 0.0, -np.inf]] * self.n_places
        unary = np.concatenate([self.log_z, np.reshape(gates, (g, 3)), np.reshape(places, (-1, 3))])
        return LabelingProblem(graph, NAMES, unary)

    def labelings(self) -> list[tuple[int, ...]]:
        return list(product(range(3), repeat=self.problem.graph.n_nodes))

    def score(
        self,
        labels: tuple[int, ...],
        *,
        weight: float,
        place_weight: float,
        doorway_weight: float,
        gate_weight: float,
        passage_weight: float,
        gate_threshold: float,
    ) -> float:
        n, g = len(self.log_z), len(self.probability)
        cells, gates, places = labels[:n], labels[n : n + g], labels[n + g :]
        if DOORWAY in places:
            return -np.inf
        total = sum(float(self.log_z[i, label]) for i, label in enumerate(cells))
        total += sum(weight for a, b in pairwise(cells) if a == b)
        for label, place in zip(cells, self.place_of_cell, strict=True):
            if place >= 0 and label in (DOORWAY, places[place]):
                total += place_weight
        for k, label in enumerate(gates):
            evidence = float(np.log(1 - self.probability[k]))
            if label == DOORWAY:
                odds = gate_threshold / (1 - gate_threshold)
                evidence = float(np.log(self.probability[k] / odds))
            total += gate_weight * len(self.cells_of_gate[k]) * evidence
            if label == DOORWAY:
                total += sum(doorway_weight for i in self.cells_of_gate[k] if cells[i] == DOORWAY)
            sizes = [self.place_of_cell.count(side) for side in self.sides_of_gate[k]]
            for side in self.sides_of_gate[k]:
                if label in (DOORWAY, places[side]):
                    total += passage_weight * min(sizes)
        return total
