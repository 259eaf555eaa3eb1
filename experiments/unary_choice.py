"""Choice of the unary: accuracy in held-out buildings by the number of training buildings.

``python -m experiments.unary_choice curve`` and ``... transfers`` renew two tables of
docs/results.md from the real maps of ``$PGM_PLACES_DATA``, with cells of 0.2 m; ``--kept FOLDER``
keeps what was computed.
"""

import argparse
import os
from collections.abc import Iterator, Mapping, Sequence
from itertools import combinations
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from experiments.array_cache import ArrayCache, fingerprint
from experiments.known_maps import NAMES, real_maps
from experiments.page_tables import text_of, write_table
from experiments.paper.section import Table
from pgm_places.evaluation.evaluation import evaluate
from pgm_places.experiment.experiment import FeatureCache
from pgm_places.labelers.place_labeler import PlaceLabeler, PlaceMethod
from pgm_places.maps.coarsening import coarsen, coarsen_labels
from pgm_places.maps.labelled_map import LabelledMap

CELLS_M, MAX_EXAMPLES = 0.2, 1000
METHODS = ("laser", "context", "laser+space", "space", "auto")
TRAINED = (1, 2, 3, 5, 10, 20)
REPEATS, N_TESTS = 3, 6
JUDGED = ("building 79", "building 52", "cold_saarbrucken_seq2")
"""The maps of robots among the transfers; the others are every twelfth drawn floor."""

_LEFT_OUT = ("building 79, redrawn", "cold_saarbrucken_seq1")
"""Not a robot's map; and hardly more than a corridor."""


def maps_of(data: Path) -> list[LabelledMap]:
    """A map of every building, in coarse cells."""
    found: dict[str, LabelledMap] = {}
    for known in real_maps(data):
        if known.item.name not in _LEFT_OUT and known.building not in found:
            found[known.building] = _coarse(known.item)
    return list(found.values())


def _coarse(item: LabelledMap) -> LabelledMap:
    grid = coarsen(item.grid, CELLS_M)
    labels = coarsen_labels(item.labels, item.grid, grid)
    return LabelledMap(grid, labels, None, item.name, item.building)


def figures(
    train: Sequence[LabelledMap], tests: Sequence[LabelledMap], cache: ArrayCache
) -> Mapping[str, NDArray[np.float64]]:
    """(M, T, 2) accuracy and balanced accuracy of the methods on each test map; ``chosen`` (1,)."""

    def make() -> dict[str, NDArray[np.float64]]:
        methods = {
            name: PlaceMethod("independent", name)  # type: ignore[arg-type]
            for name in METHODS
        }
        labeler = PlaceLabeler(NAMES, methods, max_examples_per_map=MAX_EXAMPLES)
        feature_cache = None if cache.folder is None else FeatureCache(cache.folder / "features")
        labeler.fit(train, n_threads=1, feature_cache=feature_cache)
        rates = np.empty((len(METHODS), len(tests), 2))
        for t, item in enumerate(tests):
            graph, scores = labeler.scores(item.grid, mask=item.cells, n_threads=1)
            for m, name in enumerate(METHODS):
                labels = labeler.infer(graph, scores, method=name).labels
                scored = evaluate(item.truth(graph), labels, NAMES)
                rates[m, t] = scored.accuracy, scored.balanced_accuracy
        assert labeler.unary_choice_ is not None  # a method left it open
        chosen = METHODS.index(labeler.unary_choice_.unary)
        return {"rates": rates, "chosen": np.array([chosen])}

    names = [[item.name for item in part] for part in (train, tests)]
    return cache.arrays(f"unary-choice-{fingerprint(METHODS, MAX_EXAMPLES, names)}", make)


def curve(data: Path, cache: ArrayCache) -> Table:
    """Accuracy and balanced accuracy on buildings left out, by the number of buildings."""
    maps, rows = maps_of(data), []
    rates: dict[int, list[NDArray[np.float64]]] = {n: [] for n in TRAINED}
    chosen: dict[int, list[str]] = {n: [] for n in TRAINED}
    for n in TRAINED:
        for seed in range(REPEATS):
            order = np.random.default_rng(seed).permutation(len(maps)).tolist()
            tests = [maps[k] for k in order[:N_TESTS]]
            found = figures([maps[k] for k in order[N_TESTS : N_TESTS + n]], tests, cache)
            rates[n].append(found["rates"].mean(axis=1))
            chosen[n].append(METHODS[int(found["chosen"][0])])
            print(n, seed, chosen[n][-1], (100 * rates[n][-1]).round(1).tolist(), flush=True)
        mean = 100 * np.mean(rates[n], axis=0)
        taken = ", ".join(dict.fromkeys(chosen[n]))
        rows.append((f"{n}", *(f"{a:.1f} / {b:.1f}" for a, b in mean), taken))
    heading = ("training buildings", *(f"`{name}`" for name in METHODS), "chosen")
    return Table("", heading, tuple(rows))


def transfers(data: Path, cache: ArrayCache) -> Table:
    """One or two single maps to every other building; auto against each fixed unary."""
    maps = maps_of(data)
    floors = [item for item in maps if item.name.startswith(("office_", "school_"))][::12]
    judged = [item for item in maps if item.name in JUDGED] + floors
    rows = []
    for n in (1, 2):
        rates, chosen = [], []
        for train in combinations(judged, n):
            tests = [item for item in judged if item not in train]
            found = figures(train, tests, cache)
            rates.append(found["rates"])
            chosen.append(METHODS[int(found["chosen"][0])])
            words = (100 * found["rates"].mean(axis=1)).round(1).tolist()
            print([item.name for item in train], chosen[-1], words, flush=True)
        every = 100 * np.concatenate(rates, axis=1)
        rows += list(_transfer_rows(n, every, chosen))
    heading = ("trained on", "unary", "accuracy", "balanced", "worst against `laser`", "pairs")
    return Table("", heading, tuple(rows))


def _transfer_rows(
    n: int, rates: NDArray[np.float64], chosen: Sequence[str]
) -> Iterator[tuple[str, ...]]:
    behind = rates - rates[METHODS.index("laser")]
    for m, name in enumerate(METHODS):
        accuracy, balanced = rates[m].mean(axis=0)
        worst = " / ".join(f"{value:+.1f}" for value in behind[m].min(axis=0))
        taken = ", ".join(dict.fromkeys(chosen)) if name == "auto" else ""
        words = f"`{name}`" + (f" ({taken})" if taken else "")
        of = "1 map" if n == 1 else f"{n} maps"
        yield (of, words, f"{accuracy:.1f}", f"{balanced:.1f}", worst, f"{rates.shape[1]}")


_PARTS = {"curve": curve, "transfers": transfers}
TABLES = tuple(f"unary-{part}" for part in _PARTS)


def parser() -> argparse.ArgumentParser:
    """What the command takes."""
    prog = "python -m experiments.unary_choice"
    result = argparse.ArgumentParser(prog=prog, description=__doc__)
    result.add_argument("table", choices=_PARTS)
    result.add_argument("--kept", type=Path, help="folder for cached results")
    return result


def main() -> None:
    """Renew one of the tables."""
    arguments = parser().parse_args()
    data = Path(os.environ.get("PGM_PLACES_DATA") or "../shared/data")
    table = _PARTS[arguments.table](data, ArrayCache(arguments.kept))
    print(write_table(f"unary-{arguments.table}", text_of([table])))


if __name__ == "__main__":
    main()
