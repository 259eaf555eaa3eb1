"""What the defaults of `hmm` and `potts` are chosen by: python -m experiments.defaults.

Every problem is drawn from a seed; classifiers are fitted on other problems than those labelled,
and methods learn from held-out scores. Prints the tables of docs/hmm.md and
docs/own_problem.md.
"""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray
from sklearn.datasets import load_digits
from sklearn.linear_model import LogisticRegression
from sklearn.model_selection import GroupKFold, cross_val_predict
from sklearn.naive_bayes import GaussianNB
from sklearn.pipeline import make_pipeline
from sklearn.preprocessing import StandardScaler

from experiments.paper.markdown import markdown_table
from experiments.paper.section import Table
from pgm_places import LabelGraph, LabelingProblem, LabelledMap
from pgm_places.datasets import generate_building
from pgm_places.evaluation.confusion import accuracy, balanced_accuracy, confusion_matrix
from pgm_places.models.hmm import MODES, HiddenMarkovModel
from pgm_places.models.mrf import PottsField
from pgm_places.sensing.simulated_robot import SimulatedRobot

OBSERVATIONS: tuple[Literal["hard", "soft", "posterior", "auto"], ...]
OBSERVATIONS = ("hard", "soft", "posterior", "auto")
WEIGHTS = ("auto", 0.1, 0.25, 0.5, 1.0)
Truth = NDArray[np.int64]
Labelled = tuple[LabelingProblem, Truth]


def digit_chains(seed: int) -> Iterator[Labelled]:
    """A counter's handwritten digits with noise; each stays for four steps in the mean."""
    rng = np.random.default_rng(seed)
    pictures, digits = load_digits(return_X_y=True)
    order = rng.permutation(len(digits))
    for number in range(18):
        pool = order[:900] if number < 12 else order[900:]
        truth = np.cumsum(rng.random(150) < 0.25) % 10
        looks = np.stack([pictures[rng.choice(pool[digits[pool] == d])] for d in truth])
        looks = looks + rng.normal(scale=6.0, size=looks.shape)
        yield _chain(looks, [str(digit) for digit in range(10)]), truth


def normal_chains(seed: int) -> Iterator[Labelled]:
    """Three labels that see normal clouds which overlap, each for ten steps in the mean."""
    rng = np.random.default_rng(seed)
    for _ in range(18):
        truth = np.cumsum(rng.random(150) < 0.1) % 3
        yield _chain(np.eye(3)[truth] + rng.normal(size=(150, 3)), ["a", "b", "c"]), truth


def drives(seed: int) -> Iterator[Labelled]:
    """A simulated robot in small generated buildings; a step every 0.4 m, ranges by quantile."""
    for number in range(18):
        building = generate_building(100 * seed + number, size="small")
        names = tuple(building.label_names)
        path = SimulatedRobot(scan_every_s=1.0).explore(
            building.grid, max_length_m=80.0, seed=number
        )
        path = path.labelled_by(LabelledMap(building.grid, building.labels), names)
        assert path.ranges_m is not None
        assert path.labels is not None
        ranges = np.sort(np.minimum(path.ranges_m, 10.0), axis=1)
        looks = np.log(np.maximum(ranges[:, ::12], 0.05))
        yield _chain(looks, names), path.labels.astype(np.int64)


def _chain(features: NDArray[np.float64], names: Sequence[str]) -> LabelingProblem:
    return LabelingProblem(LabelGraph.from_lattice((len(features),)), names, node_features=features)


PROBLEMS: dict[str, tuple[Callable[[int], Iterator[Labelled]], Callable[[], object]]] = {
    "digits, logistic": (digit_chains, lambda: LogisticRegression(C=0.01)),
    "digits, naive Bayes": (digit_chains, GaussianNB),
    "normal clouds, logistic": (normal_chains, LogisticRegression),
    "drives, logistic": (drives, LogisticRegression),
    "drives, naive Bayes": (drives, GaussianNB),
}


def observation_rows(seeds: Sequence[int]) -> Iterator[tuple[str, ...]]:
    """Per problem and observation: accuracy (balanced) of every mode, in percent."""
    for name, (draw, classifier) in PROBLEMS.items():
        rates = np.mean([_rates(list(draw(seed)), classifier()) for seed in seeds], axis=0)
        for seen, of_modes in zip(OBSERVATIONS, rates, strict=True):
            yield (name, f"`{seen}`", *(f"{a:.1f} ({b:.1f})" for a, b in of_modes))


def _rates(chains: list[Labelled], classifier: Any) -> NDArray[np.float64]:
    """(observations, modes, 2) accuracy and balanced accuracy on the last six chains."""
    train, test_problems = scored(chains, 12, classifier)
    test = chains[12:]
    rates = np.empty((len(OBSERVATIONS), len(MODES), 2))
    for s, seen in enumerate(OBSERVATIONS):
        weight: Any = "fitted" if seen == "auto" else 1.0
        model = HiddenMarkovModel(observation=seen, evidence_weight=weight)
        fitted = model.fit(train, [truth for _, truth in chains[:12]])
        for m, mode in enumerate(MODES):
            found = [replace(fitted, mode=mode).infer(problem).labels for problem in test_problems]
            confusion = confusion_matrix(_truth(test), np.concatenate(found))
            rates[s, m] = accuracy(confusion), balanced_accuracy(confusion)
    return 100 * rates


def scored(
    examples: list[Labelled], n_train: int, classifier: Any
) -> tuple[list[LabelingProblem], list[LabelingProblem]]:
    """The examples to learn from, scored without having been seen, and the others."""
    train, test = examples[:n_train], examples[n_train:]
    groups = np.repeat(np.arange(n_train), [len(truth) for _, truth in train])
    model = make_pipeline(StandardScaler(), classifier)
    looks, truth = np.concatenate([_looks(item) for item in train]), _truth(train)
    scores = cross_val_predict(
        model, looks, truth, groups=groups, cv=GroupKFold(min(4, n_train)), method="predict_proba"
    )
    model.fit(looks, truth)
    unseen = [
        _with_scores(problem, scores[groups == number]) for number, (problem, _) in enumerate(train)
    ]
    new = [_with_scores(item[0], model.predict_proba(_looks(item))) for item in test]
    return unseen, new


def _with_scores(problem: LabelingProblem, scores: NDArray[np.float64]) -> LabelingProblem:
    return problem.with_unary(np.log(np.maximum(scores, 1e-4)))


def _looks(item: Labelled) -> NDArray[np.float64]:
    assert item[0].node_features is not None
    return item[0].node_features


def _truth(chains: list[Labelled]) -> Truth:
    return np.concatenate([truth for _, truth in chains])


def fields(seed: int) -> Iterator[tuple[str, LabelingProblem, Truth]]:
    """Four blocks of three labels, seen through noise, on graphs of degree 2 to 26."""
    rng = np.random.default_rng(seed)
    points = rng.random((1600, 2))
    square = np.mgrid[:40, :40].reshape(2, -1).T / 40
    cube = np.mgrid[:12, :12, :12].reshape(3, -1).T / 12
    graphs = {
        "chain": (LabelGraph.from_lattice((1600,)), np.arange(1600)[:, None] / 400 % 4 / 4),
        "grid, 4 neighbours": (LabelGraph.from_lattice((40, 40)), square),
        "grid, 8 neighbours": (LabelGraph.from_lattice((40, 40), diagonals=True), square),
        "points, 8 nearest": (LabelGraph.from_points(points, n_neighbours=8), points),
        "cube, 26 neighbours": (LabelGraph.from_lattice((12, 12, 12), diagonals=True), cube),
    }
    for name, (graph, where) in graphs.items():
        truth = (np.floor(4 * where).astype(np.int64).sum(axis=1)) % 3
        seen = np.eye(3)[truth] + rng.normal(scale=0.8, size=(len(truth), 3))
        log_odds = seen / 0.8**2  # of equal normal clouds: calibrated
        unary = log_odds - np.logaddexp.reduce(log_odds, axis=1, keepdims=True)
        yield name, LabelingProblem(graph, ["a", "b", "c"], unary), truth


def weight_rows(seeds: Sequence[int]) -> Iterator[tuple[str, ...]]:
    """Per graph: accuracy of each node by itself and with each weight, in percent."""
    found: dict[str, NDArray[np.float64]] = {}
    for seed in seeds:
        for name, problem, truth in fields(seed):
            assert problem.unary is not None
            rates = [(problem.unary.argmax(axis=1) == truth).mean()]
            for weight in WEIGHTS:
                labels = PottsField(weight).infer(problem).labels  # type: ignore[arg-type]
                rates.append((labels == truth).mean())
            found[name] = found.get(name, 0.0) + np.array(rates) / len(seeds)
    for name, rates in found.items():
        yield (name, *(f"{100 * rate:.1f}" for rate in rates))


def main() -> None:
    """Print both tables."""
    heads = ("graph", "alone", *(f"`{weight}`" for weight in WEIGHTS))
    print(markdown_table(Table("", heads, tuple(weight_rows(range(5))))))
    heads = ("problem", "observation", *MODES)
    print(markdown_table(Table("", heads, tuple(observation_rows(range(3))))))


if __name__ == "__main__":
    main()
