"""Problems of one's own, side by side with other libraries.

Each peer is used where it is installed (``pip install sklearn-crfsuite hmmlearn dynamax pgmpy``);
for the best labelling of a pairwise model see the section of the decoders above. ``counting
digits``: chains of handwritten digits, twelve to learn from and six to label; all methods see the
same held-out scores of one logistic regression. ``few labels``: 3,000 steps of a chain of four
states, one in ten labelled, observed as one of six symbols; peers that know no labels get their
states named by these. ``marginals``: of a random chain, against exact ones. Processor seconds of
learning and labelling together, one thread where a library lets us; the second run, so that nothing
is compiled in it.
"""

import os
import time
import warnings
from collections.abc import Callable, Iterator
from functools import partial
from importlib.util import find_spec
from typing import Any

import numpy as np
from numpy.typing import NDArray
from sklearn.datasets import load_digits
from sklearn.linear_model import LogisticRegression
from sklearn.model_selection import GroupKFold, cross_val_predict
from sklearn.pipeline import make_pipeline
from sklearn.preprocessing import StandardScaler

from pgm_places import LabelGraph, LabelingProblem, build
from pgm_places.solvers.forest import forest_marginals
from pgm_places.solvers.pairwise import pairwise_model

Array = NDArray[np.float64]
Labels = NDArray[np.int64]
Work = Callable[[], NDArray[Any]]


def measured(work: Work) -> tuple[NDArray[Any], float]:
    """What it returns, and the processor seconds of its second run."""
    work()
    start = time.process_time()
    found = work()
    return found, time.process_time() - start


# ---------------------------------------------------------------- counting digits


def digit_chains(seed: int) -> Iterator[tuple[LabelingProblem, Labels]]:
    """A counter's handwritten digits with noise; each stays for four steps in the mean."""
    rng = np.random.default_rng(seed)
    pictures, digits = load_digits(return_X_y=True)
    order = rng.permutation(len(digits))
    names = [str(digit) for digit in range(10)]
    for number in range(18):
        pool = order[:900] if number < 12 else order[900:]
        truth = np.cumsum(rng.random(150) < 0.25) % 10
        features = np.stack([pictures[rng.choice(pool[digits[pool] == d])] for d in truth])
        features = features + rng.normal(scale=6.0, size=features.shape)
        graph = LabelGraph.from_lattice((len(truth),))
        yield LabelingProblem(graph, names, node_features=features), truth


def scored(
    chains: list[tuple[LabelingProblem, Labels]], n_train: int
) -> tuple[list[LabelingProblem], list[LabelingProblem]]:
    """The first chains with held-out scores of logistic regression, and the others."""
    model = make_pipeline(StandardScaler(), LogisticRegression(C=0.01))
    features = np.stack([np.asarray(problem.node_features) for problem, _ in chains])
    length, n_features = features.shape[1:]
    rows, truth = features[:n_train].reshape(-1, n_features), [labels for _, labels in chains]
    groups, known = np.repeat(np.arange(n_train), length), np.concatenate(truth[:n_train])
    held_out = cross_val_predict(
        model, rows, known, groups=groups, cv=GroupKFold(4), method="predict_proba"
    )
    others = model.fit(rows, known).predict_proba(features[n_train:].reshape(-1, n_features))
    scores = np.log(np.maximum(np.concatenate([held_out, others]), 1e-4))
    problems = [
        problem.with_unary(rows)
        for (problem, _), rows in zip(chains, scores.reshape(len(chains), length, -1), strict=True)
    ]
    return problems[:n_train], problems[n_train:]


def ours_on_chains(name: str, options: dict[str, Any], data: Any) -> NDArray[Any]:
    """A method of ours, learned and used."""
    train, test, truths = data
    method = build(name, options).fit(train, truths[: len(train)])
    return np.concatenate([method.infer(problem).labels for problem in test])


def crfsuite_on_chains(data: Any) -> NDArray[Any]:
    """CRFsuite by L-BFGS on the same scores, as probabilities: on logarithms it does not learn."""
    import sklearn_crfsuite

    train, test, truths = data

    def items(problem: LabelingProblem) -> list[dict[str, float]]:
        assert problem.unary is not None
        rows = np.exp(problem.unary)
        return [{str(k): float(v) for k, v in enumerate(row)} for row in rows]

    model = sklearn_crfsuite.CRF(algorithm="lbfgs", c2=0.1, max_iterations=200)
    names = [[str(k) for k in truth] for truth in truths[: len(train)]]
    model.fit([items(problem) for problem in train], names)
    return np.array([int(k) for row in model.predict([items(p) for p in test]) for k in row])


def chain_rows(quick: bool) -> Iterator[dict[str, Any]]:
    """Learned transitions, ours and CRFsuite's."""
    chains = list(digit_chains(0))
    train, test = scored(chains, 12)
    if quick:
        train = train[:4]
    truths = [truth for _, truth in chains[: len(train)]]
    data = (train, test, truths)
    methods: dict[str, Work] = {
        "ours, hmm": partial(ours_on_chains, "hmm", {"mode": "viterbi"}, data),
        "ours, crf by likelihood": partial(ours_on_chains, "crf", {}, data),
        "ours, crf by margin": partial(ours_on_chains, "crf", {"learner": "max-margin"}, data),
    }
    if find_spec("sklearn_crfsuite"):
        methods["sklearn-crfsuite"] = partial(crfsuite_on_chains, data)
    truth = np.concatenate([labels for _, labels in chains[12:]])
    for name, work in methods.items():
        found, seconds = measured(work)
        yield {
            "problem": "counting digits",
            "method": name,
            "accuracy %": 100 * float((found == truth).mean()),
            "seconds": seconds,
        }


# ---------------------------------------------------------------- few labels


def few_labels(quick: bool) -> tuple[Labels, Labels, Labels]:
    """Symbols, the true states and the labels (-1 for most) of a chain."""
    rng = np.random.default_rng(0)
    n_steps = 600 if quick else 3_000
    follow = 0.8 * np.eye(4) + 0.2 * np.roll(np.eye(4), 1, axis=1)
    emit = rng.dirichlet(np.full(6, 0.5), 4)
    states = np.zeros(n_steps, np.int64)
    for t in range(1, n_steps):
        states[t] = rng.choice(4, p=follow[states[t - 1]])
    symbols = np.array([rng.choice(6, p=emit[state]) for state in states])
    labels = np.where(rng.random(n_steps) < 0.1, states, -1)
    return symbols, states, labels


def ours_on_few(symbols: Labels, labels: Labels, options: dict[str, Any]) -> NDArray[Any]:
    """Scores of the symbols from the labelled steps, then the hidden Markov model."""
    seen = np.ones((4, 6))
    np.add.at(seen, (labels[labels >= 0], symbols[labels >= 0]), 1.0)
    unary = np.log((seen / seen.sum(axis=0)).T[symbols])
    problem = LabelingProblem(LabelGraph.from_lattice((len(symbols),)), list("abcd"), unary)
    model = build("hmm", {"mode": "smooth", **options}).fit([problem], [labels])
    return np.asarray(model.infer(problem).labels)


def named_states(states: NDArray[Any], labels: Labels) -> NDArray[Any]:
    """States of a library that knows no labels, each named by most of its labelled steps."""
    table = np.zeros((4, 4))
    known = labels >= 0
    np.add.at(table, (states[known], labels[known]), 1)
    return np.asarray(table.argmax(axis=1)[states])


def hmmlearn_on_few(symbols: Labels, labels: Labels) -> NDArray[Any]:
    """hmmlearn: Baum-Welch from one random start."""
    from hmmlearn.hmm import CategoricalHMM

    model = CategoricalHMM(4, n_iter=100, tol=1e-4, random_state=0).fit(symbols[:, None])
    return named_states(model.predict(symbols[:, None]), labels)


def dynamax_on_few(symbols: Labels, labels: Labels) -> NDArray[Any]:
    """Dynamax: expectation maximisation from one random start."""
    import jax.numpy as jnp
    import jax.random as jr
    from dynamax.hidden_markov_model import CategoricalHMM

    model = CategoricalHMM(4, 1, 6)
    parameters, properties = model.initialize(jr.PRNGKey(0))
    seen = jnp.asarray(symbols[:, None])
    parameters, _ = model.fit_em(parameters, properties, seen, num_iters=50, verbose=False)
    found = model.smoother(parameters, seen).smoothed_probs.argmax(axis=1)
    return named_states(np.asarray(found), labels)


def few_label_rows(quick: bool) -> Iterator[dict[str, Any]]:
    """Accuracy on the unlabelled steps."""
    symbols, states, labels = few_labels(quick)
    hidden = {"observation": "soft", "unlabelled": "hidden"}
    methods: dict[str, Work] = {
        "ours, labelled steps only": partial(ours_on_few, symbols, labels, {"observation": "soft"}),
        "ours, Baum-Welch from labelled steps": partial(ours_on_few, symbols, labels, hidden),
    }
    if find_spec("hmmlearn"):
        methods["hmmlearn, Baum-Welch"] = partial(hmmlearn_on_few, symbols, labels)
    if find_spec("dynamax"):
        methods["dynamax, EM"] = partial(dynamax_on_few, symbols, labels)
    for name, work in methods.items():
        found, seconds = measured(work)
        yield {
            "problem": "few labels",
            "method": name,
            "accuracy %": 100 * float((found == states)[labels < 0].mean()),
            "seconds": seconds,
        }


# ---------------------------------------------------------------- marginals


def pgmpy_marginals(unary: Array, tables: Array) -> NDArray[Any]:
    """Pgmpy: belief propagation on a junction tree."""
    from pgmpy.factors.discrete import DiscreteFactor
    from pgmpy.inference import BeliefPropagation
    from pgmpy.models import DiscreteMarkovNetwork

    n, k = unary.shape
    names = [f"x{i}" for i in range(n)]
    model = DiscreteMarkovNetwork([(names[i], names[i + 1]) for i in range(n - 1)])
    factors = [DiscreteFactor([names[i]], [k], np.exp(unary[i])) for i in range(n)]
    factors += [
        DiscreteFactor([names[i], names[i + 1]], [k, k], np.exp(tables[i])) for i in range(n - 1)
    ]
    model.add_factors(*factors)
    solver = BeliefPropagation(model)
    solver.calibrate()
    return np.stack([solver.query([name], show_progress=False).values for name in names])


def marginal_rows(quick: bool) -> Iterator[dict[str, Any]]:
    """Exact marginals of a chain."""
    rng = np.random.default_rng(0)
    n, k = (10, 3) if quick else (60, 5)
    unary, tables = rng.normal(size=(n, k)), rng.normal(size=(n - 1, k, k))
    edges = np.stack([np.arange(n - 1), np.arange(1, n)], axis=1)
    methods: dict[str, Work] = {
        "ours, exact": lambda: (
            forest_marginals(pairwise_model(unary, edges, pairwise=tables)).beliefs
        )
    }
    if find_spec("pgmpy"):
        methods["pgmpy, junction tree"] = partial(pgmpy_marginals, unary, tables)
    reference: NDArray[Any] | None = None
    for name, work in methods.items():
        found, seconds = measured(work)
        reference = found if reference is None else reference
        yield {
            "problem": f"marginals of {n} nodes",
            "method": name,
            "difference": float(np.abs(found - reference).max()),
            "seconds": seconds,
        }


def run(quick: bool) -> list[dict[str, Any]]:
    """The rows of the tables."""
    os.environ.setdefault("JAX_PLATFORMS", "cpu")
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # of peers that do not converge
        return [*chain_rows(quick), *few_label_rows(quick), *marginal_rows(quick)]
