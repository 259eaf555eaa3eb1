"""Lists learned without a fold of buildings, and their scores for the maps of that fold."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from experiments.buildings.maps import DRAWN, GENERATED, NAMES, SIMULATED, Sample
from experiments.kept import Arrays, KeptArrays, fingerprint
from experiments.paper.setting import Setting
from pgm_places._version import __version__
from pgm_places.graph.layout import GridLayout
from pgm_places.kernels.threads import thread_limit
from pgm_places.models.boosted_list import BoostedList
from pgm_places.models.list_average import list_average
from pgm_places.models.strong_classifier import BoostedTrees
from pgm_places.progress import Progress, Stage
from pgm_places.spaces.door_truth import match_doors
from pgm_places.spaces.gates import Gates, gate_candidates, gate_features
from pgm_places.spaces.segmentation import Segmentation
from pgm_places.unary.cell_scorers import aligned_log_proba
from pgm_places.unary.list_learning import with_explicit_order
from pgm_places.unary.options import SpaceOptions
from pgm_places.unary.space_learning import gate_list
from pgm_places.unary.space_model import MapSpaces, gate_probabilities

CORRIDOR, DOORWAY = NAMES.index("corridor"), NAMES.index("doorway")
N_LASER, N_SEGMENTS = 321, 321 + 121
_CONTENT = ("scores", "at gate", "gate")
"""What is kept of a map."""

_ROUNDS_AVERAGED = 66
"""Of each list that is averaged, so that three have as many trees as two lists."""


@dataclass(frozen=True)
class Recipe:
    """How a list is learned.

    Parameters
    ----------
    without : str, optional
        Leave out maps of this source in training.
    mean_of : tuple of str
        Learn nothing: average the first rounds of the lists by these recipes.
    """

    without: str | None = None
    mean_of: tuple[str, ...] = ()


AVERAGE = "average of lists"
_WITHOUT = {
    f"without {words}": Recipe(without=source)
    for source, words in (
        (SIMULATED, "robot-like copies"),
        (GENERATED, "generated buildings"),
        (DRAWN, "drawn floors"),
    )
}
RECIPES: Mapping[str, Recipe] = {
    **_WITHOUT,
    AVERAGE: Recipe(mean_of=tuple(_WITHOUT)),
}


@dataclass(frozen=True, eq=False)
class Scored:
    """The scores of one map by lists that were trained without its building.

    Parameters
    ----------
    sample : Sample
    fold : int
    log_z : mapping of str to (m, K + 1) float64
        The scores of the lattice's cells by each recipe; halls last.
    at_gate : (m,) float32
        The probability of the likeliest gate that each cell lies at, 0 for none.
    gate : (G,) float64
        The probability that each gate is a doorway.
    """

    sample: Sample
    fold: int
    log_z: Mapping[str, NDArray[np.float64]]
    at_gate: NDArray[np.float32]
    gate: NDArray[np.float64]

    @property
    def truth(self) -> NDArray[np.int64]:
        """(m,) the labels of the lattice's cells."""
        return self.sample.known.item.labels[self.sample.lattice].astype(np.int64)

    @property
    def finer(self) -> NDArray[np.int64]:
        """(m,) the labels of the lattice's cells, halls apart."""
        return self.sample.known.finer[self.sample.lattice].astype(np.int64)


@dataclass(frozen=True, eq=False)
class _GateRows:
    """The gates of all maps: features (G, F), truth, whether that is known, map and fold."""

    values: NDArray[np.float32]
    truth: NDArray[np.int64]
    known: NDArray[np.bool_]
    map: NDArray[np.int64]
    fold: NDArray[np.int64]

    def without(self, folds: set[int], n_threads: int | None) -> BoostedList | None:
        """The list of gates trained without some folds."""
        seen = self.known & ~np.isin(self.fold, list(folds))
        with thread_limit(n_threads):
            return gate_list(self.values, self.truth, self.fold, seen)


def scored_maps(
    setting: Setting,
    samples: Sequence[Sample],
    fold: NDArray[np.int64],
    recipes: Mapping[str, Recipe] = RECIPES,
    *,
    learned: NDArray[np.bool_] | None = None,
) -> list[Scored]:
    """Every test map, scored by lists trained without its building.

    The lists are retrained for each fold, those of gates twice: what a training map is told of its
    gates comes from a list that saw neither its fold nor the test fold.

    Parameters
    ----------
    setting : Setting
    samples : sequence of Sample
    fold : (M,) int64
        The fold of each map; the last one is never tested.
    recipes : mapping of str to Recipe
        How lists are learned.
    learned : (M,) bool, optional
        Maps to train on when their fold is not the test fold; all by default.
    """
    learned = np.ones(len(samples), np.bool_) if learned is None else learned
    kept = KeptArrays(setting.kept)
    stems = [each.stem for each in samples]
    options = SpaceOptions()
    run = fingerprint(__version__, _CONTENT, recipes, options, stems, fold, learned)
    tested = range(int(fold.max()))
    names = {number: f"{run}-fold-{number}" for number in tested}
    missing = [number for number in tested if not kept.has(names[number])]
    rows = _Rows.of(setting, samples, fold, missing, learned) if missing else None
    found = []
    for number in tested:
        with setting.progress.stage(f"buildings left out: {number + 1} of {len(tested)}") as stage:

            def make(
                number: int = number, stage: Stage = stage, rows: "_Rows | None" = rows
            ) -> Arrays:
                assert rows is not None  # some fold is missing
                return rows.score(number, recipes, setting.n_threads, stage)

            arrays = kept.arrays(names[number], make)
        found += _scored(samples, fold, number, recipes, arrays)
    return found


def _scored(
    samples: Sequence[Sample],
    fold: NDArray[np.int64],
    number: int,
    recipes: Mapping[str, Recipe],
    arrays: Arrays,
) -> list[Scored]:
    return [
        Scored(
            samples[k],
            number,
            {name: arrays[f"{k} {name}"].astype(np.float64) for name in recipes},
            arrays[f"{k} at gate"],
            arrays[f"{k} gate"],
        )
        for k in np.flatnonzero(fold == number).tolist()
    ]


@dataclass(frozen=True, eq=False)
class _Rows:
    """The examples of the maps that are learned from, and all gates."""

    samples: Sequence[Sample]
    fold: NDArray[np.int64]
    gates: _GateRows
    values: NDArray[np.float32]
    of_places: Mapping[int, NDArray[np.float32]]
    truth: NDArray[np.int64]
    map: NDArray[np.int64]

    @classmethod
    def of(
        cls,
        setting: Setting,
        samples: Sequence[Sample],
        fold: NDArray[np.int64],
        tested: Sequence[int],
        learned: NDArray[np.bool_],
    ) -> "_Rows":
        """The rows of these maps; the columns of places once for each fold that is tested."""
        gates = _gates_of(samples, fold, learned, setting.progress)
        judges = _judges(gates, fold, tested, setting)
        parts: list[NDArray[np.float32]] = []
        of_places: dict[int, list[NDArray[np.float32]]] = {number: [] for number in tested}
        with setting.progress.stage("what examples see of spaces") as stage:
            used = np.flatnonzero(learned).tolist()
            for count, k in enumerate(used, start=1):
                each = samples[k]
                found = _spaces_of_examples(
                    each, gates.values[gates.map == k], judges[int(fold[k])]
                )
                for number, around in found.items():
                    of_places[number].append(around[:, N_SEGMENTS - N_LASER :])
                segments = found[tested[0]][:, : N_SEGMENTS - N_LASER]
                parts.append(np.concatenate([each.example_features(), segments], axis=1))
                stage.update(count / len(used), each.known.item.name)
        labels = [samples[k].known.finer[samples[k].examples] for k in used]
        return cls(
            samples,
            fold,
            gates,
            np.concatenate(parts),
            {number: np.concatenate(columns) for number, columns in of_places.items()},
            np.concatenate(labels).astype(np.int64),
            np.repeat(used, [len(part) for part in parts]),
        )

    def score(
        self,
        number: int,
        recipes: Mapping[str, Recipe],
        n_threads: int | None,
        stage: Stage,
    ) -> dict[str, NDArray[Any]]:
        """The scores of a fold's maps by some recipes, from lists trained without them."""
        values = np.concatenate([self.values, self.of_places[number]], axis=1)
        lists: dict[str, BoostedList] = {}
        for count, (name, recipe) in enumerate(recipes.items(), start=1):
            if recipe.mean_of:
                parts = [_first_rounds(lists[part]) for part in recipe.mean_of]
                lists[name] = list_average(parts)
            else:
                lists[name] = self._learned(recipe, values, number, n_threads)
            stage.update(count / (len(recipes) + 1), name)
        judge = self.gates.without({number}, n_threads)
        found: dict[str, NDArray[Any]] = {}
        for k in np.flatnonzero(self.fold == number).tolist():
            gate = gate_probabilities(judge, self.gates.values[self.gates.map == k])
            scores = _scores_of_map(self.samples[k], recipes, lists, gate, n_threads)
            found |= {f"{k} {name}": array for name, array in scores.items()}
        return found

    def _learned(
        self, recipe: Recipe, values: NDArray[np.float32], number: int, n_threads: int | None
    ) -> BoostedList:
        source = np.array([each.known.source for each in self.samples])
        others = self.fold != number
        seen = (others & (source != recipe.without))[self.map]
        unfitted = SpaceOptions().classifier()
        unfitted.set_params(n_threads=n_threads, calibration="none")  # that comes later
        # One order for all sources, or their lists could not be averaged.
        learner = with_explicit_order(unfitted, self.truth[others[self.map]])
        fitted: BoostedList = learner.fit(
            values[seen], self.truth[seen], groups=self.fold[self.map][seen]
        ).boosted_list_
        return fitted


def _first_rounds(item: BoostedList) -> BoostedList:
    """The list as it was after some rounds; boosting never looks ahead."""
    trees = [part for part in item.classifiers if isinstance(part, BoostedTrees)]
    return replace(item, classifiers=tuple(part[:_ROUNDS_AVERAGED] for part in trees))


def _candidates(sample: Sample) -> Gates:
    return gate_candidates(Segmentation.of(sample.known.item.grid))


def _gates_of(
    samples: Sequence[Sample],
    fold: NDArray[np.int64],
    learned: NDArray[np.bool_],
    progress: Progress,
) -> _GateRows:
    values, truth, known, sizes = [], [], [], []
    with progress.stage("gates of all maps") as stage:
        for k, each in enumerate(samples):
            gates = _candidates(each)
            match = match_doors(gates, each.known.item.labels, DOORWAY)
            values.append(gate_features(gates).astype(np.float32))
            truth.append(match.is_doorway.astype(np.int64))
            known.append((match.known | match.is_doorway) & learned[k])
            sizes.append(len(gates))
            stage.update((k + 1) / len(samples), each.known.item.name)
    return _GateRows(
        np.concatenate(values),
        np.concatenate(truth),
        np.concatenate(known),
        np.repeat(np.arange(len(samples)), sizes),
        np.repeat(fold, sizes),
    )


def _judges(
    gates: _GateRows, fold: NDArray[np.int64], tested: Sequence[int], setting: Setting
) -> dict[int, dict[int, BoostedList | None]]:
    """For each fold of maps and each test fold, the list of gates trained on neither."""
    pairs = {frozenset({a, b}) for a in tested for b in np.unique(fold).tolist()}
    lists = {}
    with setting.progress.stage("lists of gates") as stage:
        for count, pair in enumerate(sorted(pairs, key=sorted), start=1):
            lists[pair] = gates.without(set(pair), setting.n_threads)
            stage.update(count / len(pairs))
    return {b: {a: lists[frozenset({a, b})] for a in tested} for b in np.unique(fold).tolist()}


def _spaces_of_examples(
    sample: Sample, gates: NDArray[np.float32], judges: Mapping[int, BoostedList | None]
) -> dict[int, NDArray[np.float32]]:
    """(n, F) the features of spaces at the examples of a map, for a test fold."""
    candidates, cells = _candidates(sample), np.argwhere(sample.examples)
    return {
        number: MapSpaces.of(candidates, gate_probabilities(judge, gates)).features.lookup(cells)
        for number, judge in judges.items()
    }


def _scores_of_map(
    sample: Sample,
    recipes: Mapping[str, Recipe],
    lists: Mapping[str, BoostedList],
    gate: NDArray[np.float64],
    n_threads: int | None,
) -> dict[str, NDArray[Any]]:
    """The scores of the cells of a map's lattice, and the gates that they lie at."""
    spaces = MapSpaces.of(_candidates(sample), gate)
    cells = np.argwhere(sample.lattice)
    around = spaces.features.lookup(cells)
    values = np.concatenate([sample.lattice_features(n_threads), around], axis=1)
    found: dict[str, NDArray[Any]] = {"gate": gate}
    for name in recipes:
        log_z = aligned_log_proba(lists[name], values, len(NAMES) + 1, n_threads)
        found[name] = log_z.astype(np.float32)
    found["at gate"] = spaces.at_gates(GridLayout.of_mask(sample.lattice))
    return found
