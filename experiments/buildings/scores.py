"""The quality of held-out scores by kind of map: cells, doors and probabilities."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from experiments.buildings.lists import AVERAGE, DOORWAY, RECIPES, WHOLE, Scored, folded
from experiments.buildings.maps import LATTICE_STEP, NAMES
from pgm_places.evaluation.evaluation import Evaluation, evaluate
from pgm_places.graph.label_graph import LabelGraph
from pgm_places.inference.labeling import Labeling
from pgm_places.inference.problem import LabelingProblem
from pgm_places.inference.temperature import likeliest_temperature, tempered
from pgm_places.maps.occupancy_grid import OccupancyGrid
from pgm_places.models.list_training import platt, temperature
from pgm_places.models.mrf import PottsField
from pgm_places.spaces.door_truth import DoorScores, match_doors
from pgm_places.spaces.gates import gate_candidates
from pgm_places.spaces.segmentation import Segmentation
from pgm_places.unary.space_model import with_gates

GATES, AVERAGED, SHIPPED = "gates on doorways", "average", "temperature"
RESCALED = ("platt", SHIPPED)
"""The calibrations of the list to compare."""

POTTS = {f"Potts {weight:g}": weight for weight in (0.25, 0.5, 1.0)}
"""Potts weights to compare on the scores of the shipped model's list."""

_FIELD = next(iter(POTTS))
TEMPERED = f"{_FIELD}, tempered"
"""The field of the shipped models, its beliefs calibrated on other folds."""

_ORDER = {3: (2, 0, 1), 4: (2, 3, 0, 1)}
"""The list's classes, the rarest first, without and with halls."""


@dataclass(frozen=True, eq=False)
class MapResult:
    """A map's figures.

    Parameters
    ----------
    scored : Scored
    evaluations : mapping of str to Evaluation
        Of the lattice's cells, by step of the method.
    labels : (m,) int64
        Those of the shipped scores, gates included.
    doors : DoorScores
        Of the gates that are doorways rather than not.
    gates : Evaluation or None
        Of all gates whose truth is known, with the reliability of their probabilities.
    places : Evaluation or None
        Of all places of at least 1 m2, likewise.
    """

    scored: Scored
    evaluations: Mapping[str, Evaluation]
    labels: NDArray[np.int64]
    doors: DoorScores
    gates: Evaluation | None
    places: Evaluation | None


@dataclass(frozen=True)
class Means:
    """Figures of several maps: means over the maps, calibration errors over all cells and gates.

    Parameters
    ----------
    accuracy, balanced_accuracy : float
    doorway_f1, cell_error, gate_error, place_error : float or None
        The last three are expected calibration errors.
    """

    accuracy: float
    balanced_accuracy: float
    doorway_f1: float | None
    cell_error: float | None
    gate_error: float | None
    place_error: float | None


def means(results: Sequence[MapResult], step: str) -> Means:
    """The figures of a step over some maps."""
    found = [item.evaluations[step] for item in results]
    doorways = [value for item in found if (value := item.f1["doorway"]) is not None]
    gates = [item.gates for item in results if item.gates is not None]
    places = [item.places for item in results if item.places is not None]
    return Means(
        float(np.mean([item.accuracy for item in found])),
        float(np.mean([item.balanced_accuracy for item in found])),
        float(np.mean(doorways)) if doorways else None,
        Evaluation.merged(found).expected_calibration_error,
        Evaluation.merged(gates).expected_calibration_error if gates else None,
        Evaluation.merged(places).expected_calibration_error if places else None,
    )


def map_results(scored: Sequence[Scored], note: Callable[[float], None]) -> list[MapResult]:
    """The figures of every map."""
    scaled = {name: rescaled(scored, name) for name in RESCALED}
    fields = []
    for count, (item, log_z) in enumerate(zip(scored, scaled[SHIPPED], strict=True), start=1):
        fields.append(_smoothed(item, with_gates(log_z, item.at_gate, DOORWAY)))
        note(0.5 * count / len(scored))
    lightest = [found[_FIELD] for found in fields]
    for found, labeling in zip(fields, tempered_fields(scored, lightest), strict=True):
        found[TEMPERED] = labeling
    results = []
    for number, item in enumerate(scored):
        own = {name: every[number] for name, every in scaled.items()}
        results.append(_result(item, own, fields[number]))
        note(0.5 + 0.5 * (number + 1) / len(scored))
    return results


def tempered_fields(scored: Sequence[Scored], labelings: Sequence[Labeling]) -> list[Labeling]:
    """The labellings with the temperatures that the held-out cells of other folds ask for."""
    fold = np.array([item.fold for item in scored])
    factor = {}
    for number in np.unique(fold).tolist():
        others = np.flatnonzero(fold != number).tolist()
        beliefs = [found for k in others if (found := labelings[k].beliefs) is not None]
        factor[number] = likeliest_temperature(beliefs, [scored[k].truth for k in others])
    return [tempered(found, factor[k]) for k, found in zip(fold.tolist(), labelings, strict=True)]


def _result(
    scored: Scored,
    scaled: Mapping[str, NDArray[np.float64]],
    fields: Mapping[str, Labeling],
) -> MapResult:
    truth, steps = scored.truth, {name: scored.folded(name) for name in RECIPES}
    for name, recipe in RECIPES.items():
        if recipe.without is not None:
            steps[name] = with_gates(steps[name], scored.at_gate, DOORWAY)
    steps[GATES] = with_gates(steps[WHOLE], scored.at_gate, DOORWAY)
    steps[AVERAGED] = with_gates(steps.pop(AVERAGE), scored.at_gate, DOORWAY)
    for name, log_z in scaled.items():
        steps[name] = with_gates(log_z, scored.at_gate, DOORWAY)
    evaluations = {
        name: evaluate(truth, log_z.argmax(axis=1), NAMES, beliefs=np.exp(log_z))
        for name, log_z in steps.items()
    }
    for name, found in fields.items():
        evaluations[name] = evaluate(truth, found.labels, NAMES, beliefs=found.beliefs)
    doors, gates = doors_of(scored)
    labels, places = steps[SHIPPED].argmax(axis=1), places_of(scored, steps[SHIPPED])
    return MapResult(scored, evaluations, labels, doors, gates, places)


def doors_of(scored: Scored) -> tuple[DoorScores, Evaluation | None]:
    """The doors found and invented, and all gates whose truth is known with their probabilities."""
    item = scored.sample.known.item
    match = match_doors(gate_candidates(Segmentation.of(item.grid)), item.labels, DOORWAY)
    known = match.known | match.is_doorway
    accepted = scored.gate > 0.5
    doors = match.scores(accepted)
    if not known.any():
        return doors, None
    beliefs = np.stack([1 - scored.gate, scored.gate], axis=1)[known]
    truth, found = match.is_doorway[known].astype(np.int64), accepted[known].astype(np.int64)
    return doors, evaluate(truth, found, ("other", "doorway"), beliefs=beliefs)


def places_of(scored: Scored, log_z: NDArray[np.float64]) -> Evaluation | None:
    """The places of at least 1 m2: their most frequent label, and the mean of their cells' beliefs.

    In a perfect labelling, the former is the label with the largest mean. Cells at accepted gates
    belong to no place; None without any place.
    """
    inside = (scored.place >= 0) & (scored.at_gate <= 0.5)
    n_places = int(scored.place.max(initial=-1)) + 1
    place, beliefs = scored.place[inside], np.exp(log_z[inside])
    votes = np.stack(
        [
            np.bincount(place[scored.truth[inside] == k], minlength=n_places)
            for k in range(len(NAMES))
        ]
    )
    sums = np.stack([np.bincount(place, column, n_places) for column in beliefs.T])
    cell_m2 = (LATTICE_STEP * scored.sample.known.item.grid.resolution_m) ** 2
    large = votes.sum(axis=0) * cell_m2 >= 1.0
    if not large.any():
        return None
    means = (sums[:, large] / sums[:, large].sum(axis=0)).T
    truth = votes[:, large].argmax(axis=0).astype(np.int64)
    return evaluate(truth, means.argmax(axis=1), NAMES, beliefs=means)


def _smoothed(scored: Scored, log_z: NDArray[np.float64]) -> dict[str, Labeling]:
    """The lattice's labels by Potts fields, with the beliefs of mean field."""
    cells = np.argwhere(scored.sample.lattice)
    graph = lattice_graph(scored.sample.known.item.grid, cells, LATTICE_STEP)
    problem = LabelingProblem(graph, NAMES, log_z)
    options: Any = {"inference": "mean-field", "max_iterations": 20}
    return {name: PottsField(weight, **options).infer(problem) for name, weight in POTTS.items()}


def lattice_graph(grid: OccupancyGrid, cells_rc: NDArray[np.int64], step: int) -> LabelGraph:
    """Cells ``step`` apart as nodes, joined to those of their eight neighbours with a free way."""
    node = np.full(grid.shape, -1)
    node[tuple(cells_rc.T)] = np.arange(len(cells_rc))
    pairs = []
    for direction in ((0, 1), (1, -1), (1, 0), (1, 1)):
        to = cells_rc + step * np.array(direction)
        inside = ((to >= 0) & (to < grid.shape)).all(axis=1)
        first, second = np.flatnonzero(inside), node[tuple(to[inside].T)]
        free = second >= 0
        for along in range(1, step):
            free &= grid.free[tuple((cells_rc[inside] + along * np.array(direction)).T)]
        pairs.append(np.stack([first[free], second[free]], axis=1))
    return LabelGraph.from_edges(len(cells_rc), np.concatenate(pairs))


def rescaled(scored: Sequence[Scored], how: str) -> list[NDArray[np.float64]]:
    """(m, K) log z of every map with confidences rescaled by the held-out cells of other folds.

    ``how`` is one of ``RESCALED``. All maps have the same weight, as in training.
    """
    fold = np.array([item.fold for item in scored])
    order = _ORDER[scored[0].log_z[AVERAGE].shape[1]]
    logits = [_logits(item.log_z[AVERAGE], order) for item in scored]
    scales = {}
    for number in np.unique(fold).tolist():
        others = [k for k in range(len(scored)) if fold[k] != number]
        truths = [scored[k].finer for k in others]
        scales[number] = _scales(truths, [logits[k] for k in others], order, how)
    found = [
        _log_z(own, scales[item.fold], order) for item, own in zip(scored, logits, strict=True)
    ]
    return [folded(log_z) for log_z in found]


def _logits(log_z: NDArray[np.float64], order: tuple[int, ...]) -> NDArray[np.float64]:
    """(K - 1, m) log odds that each confidence of the list, rarest label first, stands for."""
    found = []
    for i, k in enumerate(order[:-1]):
        rest = np.logaddexp.reduce(log_z[:, order[i + 1 :]], axis=1)
        found.append(log_z[:, k] - rest)
    return np.array(found)


def _scales(
    truths: Sequence[NDArray[np.int64]],
    logits: Sequence[NDArray[np.float64]],
    order: tuple[int, ...],
    how: str,
) -> list[tuple[float, float]]:
    truth, values = np.concatenate(truths), np.concatenate(logits, axis=1)
    weight = np.concatenate([np.full(len(part), 1000.0 / max(len(part), 1)) for part in truths])
    found = []
    for i, k in enumerate(order[:-1]):
        remaining = np.isin(truth, order[i:])
        examples = values[i, remaining], truth[remaining] == k, weight[remaining]
        found.append(platt(*examples) if how == "platt" else (temperature(*examples), 0.0))
    return found


def _log_z(
    logits: NDArray[np.float64], scales: Sequence[tuple[float, float]], order: tuple[int, ...]
) -> NDArray[np.float64]:
    found = np.empty((logits.shape[1], len(order)))
    remaining = np.zeros(logits.shape[1])
    for k, values, (slope, offset) in zip(order, logits, scales, strict=False):
        scaled = slope * values + offset
        found[:, k] = remaining - np.logaddexp(0.0, -scaled)
        remaining = remaining - np.logaddexp(0.0, scaled)
    found[:, order[-1]] = remaining
    return found
