"""Observation model and evidence weight of chains, chosen on training sequences."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import partial
from typing import Any, Literal, NamedTuple, TypeVar

import numpy as np
from numpy.typing import NDArray

from pgm_places._checks import learned_number
from pgm_places.evaluation.bootstrap import is_ahead, stretches
from pgm_places.evaluation.evaluation import accuracy, balanced_accuracy, confusion_matrix
from pgm_places.inference.problem import LabelingProblem
from pgm_places.options import Probability
from pgm_places.solvers.relaxation import starting_beliefs

Evidence = Literal["posterior", "likelihood"] | Probability
"""``"posterior"``, ``"likelihood"``, or the exponent of the prior to divide by (0 and 1)."""


Real = TypeVar("Real", bound=np.floating)


def divided_share(evidence: str | float) -> float:
    """The exponent of the prior by which posteriors are divided.

    Examples
    --------
    >>> [divided_share(evidence) for evidence in ("posterior", 0.25, "likelihood")]
    [0.0, 0.25, 1.0]
    """
    return (
        {"posterior": 0.0, "likelihood": 1.0}[evidence] if isinstance(evidence, str) else evidence
    )


def without_prior(
    problem: LabelingProblem, unary: NDArray[Real], prior: NDArray[np.float64], share: float
) -> NDArray[Real]:
    """(N, K) a problem's unary less ``share`` of the log-``prior`` (K,); unobserved rows stay."""
    divided: NDArray[Real] = unary - (share * np.log(prior)).astype(unary.dtype)
    if problem.unseen is not None:
        divided[problem.unseen] = unary[problem.unseen]
    return divided


Observation = Literal["posterior", "hard", "soft"]

OBSERVATIONS: tuple[Observation, ...] = ("soft", "hard", "posterior")
"""Observation models in the order of trial; of equals, the first is chosen."""

# Probability in place of a learned 0 if known labels contradict it: too small to matter elsewhere,
# large enough not to underflow when multiplied by a belief.
LEAST = 1e-200


def log_likelihood(
    unary: NDArray[np.float64],
    observation: Observation,
    confusion: NDArray[np.float64],
    prior: NDArray[np.float64],
    weight: float,
) -> NDArray[np.float64]:
    """(T, K) ``log P(z_t | l)`` up to a constant per step; -inf where a label is forbidden.

    ``unary`` (T, K) are the classifier's log-probabilities, ``confusion`` (K, K) the probability of
    its best label (column) at each true one (row), ``prior`` (K,) the share of each label,
    ``weight`` the exponent. Allowed labels have equal likelihoods if the confusions exclude them
    all, or without an observation: all labels forbidden, or the allowed ones NaN.
    """
    missing = np.isnan(unary)
    unary = np.where(missing, 0.0, unary)
    scores = np.full(unary.shape, -np.inf)
    observed = np.flatnonzero(unary.max(axis=1, initial=-np.inf) > -np.inf)
    with np.errstate(divide="ignore"):
        if observation == "hard":
            scores[observed] = np.log(confusion.T)[unary[observed].argmax(axis=1)]
        elif observation == "soft":
            scores[observed] = np.log(starting_beliefs(unary[observed]) @ confusion.T)
        else:
            scores[observed] = unary[observed] - np.log(np.where(prior > 0, prior, 1.0))
    scores *= weight
    scores[missing.any(axis=1)] = 0.0
    allowed = unary > -np.inf
    restricted = ~allowed.all(axis=1)
    scores[restricted] = np.where(allowed[restricted], scores[restricted], -np.inf)
    excluded = restricted & (scores.max(axis=1, initial=-np.inf) == -np.inf)
    scores[excluded] = np.where(allowed[excluded], 0.0, -np.inf)
    return scores


def possible(probabilities: NDArray[np.float64]) -> NDArray[np.float64]:
    """The table with the least probability in place of 0, for transitions that evidence proves."""
    return np.maximum(probabilities, LEAST)


WEIGHTS = (0.05, 0.1, 0.2, 0.3, 0.5, 0.7, 1.0)
"""Candidates of the evidence weight."""

BALANCES = (0.0, 0.25, 0.5, 0.75, 1.0)
"""Candidates of the exponent of the labels' shares."""

SHRINKAGES = (0.0, 0.3, 0.6)
"""Candidates of the shrinkage of transitions, with ``posterior`` observations."""


class FittedWeights(NamedTuple):
    """The best evidence weight and exponent of the labels' shares, with their scores."""

    weight: float
    balance: float
    accuracy: float
    balanced_accuracy: float
    """On the known steps of the training sequences."""


def best_weights(
    labels_at: Callable[[float, float, LabelingProblem], NDArray[np.integer]],
    problems: Sequence[LabelingProblem],
    labelings: Sequence[NDArray[np.int64]],
    *,
    weights: Sequence[float] = WEIGHTS,
    balances: Sequence[float] = BALANCES,
    node_weights: Sequence[NDArray[np.float64]] | None = None,
    least_accuracy: float = 0.0,
    is_enough: Callable[[NDArray[np.integer]], bool] | None = None,
) -> FittedWeights | None:
    """The evidence weight and the exponent of the labels' shares with the best labels.

    The criterion is the mean of accuracy and balanced accuracy over the known steps, since accuracy
    alone sacrifices rare and short labels such as doorways. Of equals, the largest weight and the
    least exponent win. An exponent above the least one must not reduce accuracy. Pairs below
    ``least_accuracy`` are chosen only if all are below, and then by accuracy.

    ``labels_at(weight, exponent, problem)`` infers labels (N,) from unaries that should be
    held-out. ``is_enough`` tests the labels of all known steps; None if no pair passes.
    """
    truth = np.concatenate([np.asarray(labels) for labels in labelings])
    known = np.flatnonzero(truth >= 0)
    counts = None if node_weights is None else np.concatenate(node_weights)[known]

    def tried_with(balance: float) -> list[FittedWeights]:
        candidates = []
        for weight in sorted(weights, reverse=True):
            answers = np.concatenate([labels_at(weight, balance, one) for one in problems])
            if is_enough is not None and not is_enough(answers[known]):
                continue
            confusion = confusion_matrix(truth[known], answers[known], weights=counts)
            right, balanced = float(accuracy(confusion)), float(balanced_accuracy(confusion))
            candidates.append(FittedWeights(weight, balance, right, balanced))
        return candidates

    plain, *further = sorted(balances)
    tried = tried_with(plain)
    best = _best_of(tried, least_accuracy)
    if not further:
        return best
    others = [candidate for balance in further for candidate in tried_with(balance)]
    by_weight = sorted([*tried, *others], key=lambda candidate: -candidate.weight)
    return _best_of(by_weight, least_accuracy if best is None else best.accuracy)


def fitted_by_mode(
    models: Sequence[Any],
    modes: Sequence[str],
    problems: Sequence[LabelingProblem],
    labelings: Sequence[NDArray[np.int64]],
    node_weights: Sequence[NDArray[np.float64]] | None = None,
) -> dict[str, Any]:
    """The best observation model, weight and exponent of each mode, by name; None if not fitted.

    ``models`` are hidden Markov models with equal options, one for each sequence, preferably
    counted on other sequences. Choices less accurate than independent steps are avoided if there
    are others. For other arguments see :func:`best_weights`.

    If observation model, weight and shrinkage are all to be fitted, a mode must be significantly
    more accurate than independent steps (:func:`pgm_places.evaluation.bootstrap.is_ahead`), or no
    less accurate in any stretch; else steps are independent: shrinkage 1, ``posterior``
    observations of weight 1.
    """
    model, of_problem = models[0], dict(zip(map(id, problems), models, strict=True))
    weight, balance = model.evidence_weight, model.balance
    weights = WEIGHTS if weight == "fitted" else (weight,)
    balances = BALANCES if balance == "fitted" else (balance,)
    kinds = OBSERVATIONS if model.observation == "auto" else (model.observation,)
    alone, is_enough = _alone(problems, labelings, node_weights)
    is_open = model.can_shrink and (weight, model.observation) == ("fitted", "auto")
    variants: list[tuple[Observation, float]] = [(kind, 0.0) for kind in kinds]
    if is_open:
        variants += [("posterior", share) for share in SHRINKAGES[1:]]

    def labels_at(
        options: Mapping[str, Any], weight: float, balance: float, problem: LabelingProblem
    ) -> NDArray[np.integer]:
        own = of_problem[id(problem)]
        other = replace(own, **options, evidence_weight=weight, balance=balance)
        labels: NDArray[np.int64] = other.infer(problem).labels
        return labels

    chosen: list[tuple[tuple[Observation, float], FittedWeights]] = []
    for mode in modes:
        best_fits: dict[FittedWeights, tuple[Observation, float]] = {}
        for kind, share in variants:
            options: dict[str, Any] = {"mode": mode, "observation": kind}
            if is_open:
                options["shrinkage"] = share
            best = best_weights(
                partial(labels_at, options),
                problems,
                labelings,
                weights=weights,
                balances=(0.0,) if mode == "viterbi" else balances,
                node_weights=node_weights,
                least_accuracy=alone[0],
                is_enough=is_enough if is_open else None,
            )
            if best is not None:
                best_fits[best] = best_fits.get(best, (kind, share))
        best = _best_of(list(best_fits), alone[0])
        if best is None:
            chosen.append((("posterior", 1.0), FittedWeights(1.0, 0.0, *alone)))
        else:
            chosen.append((best_fits[best], best))
    of_modes = np.array([fitted[:2] for _, fitted in chosen]).T
    numbers = np.array([OBSERVATIONS.index(kind) for (kind, _), _ in chosen], np.int64)
    return {
        "fitted_weights": of_modes[0] if weight == "fitted" else None,
        "fitted_balances": of_modes[1] if balance == "fitted" else None,
        "fitted_observations": numbers if model.observation == "auto" else None,
        "fitted_shrinkages": np.array([share for (_, share), _ in chosen]) if is_open else None,
        "fitted_scores": np.array([[*fitted[2:], *alone] for _, fitted in chosen]),
    }


def _best_of(tried: Sequence[FittedWeights], least: float) -> FittedWeights | None:
    """The best candidate of sufficient accuracy, else the most accurate; of equals the first."""
    if not tried:
        return None
    enough = [fit for fit in tried if fit.accuracy >= least - 1e-9]
    if not enough:
        return max(tried, key=lambda fit: round(fit.accuracy, 9))
    return max(enough, key=lambda fit: round(fit.accuracy + fit.balanced_accuracy, 9))


def _alone(
    problems: Sequence[LabelingProblem],
    labelings: Sequence[NDArray[np.int64]],
    node_weights: Sequence[NDArray[np.float64]] | None,
) -> tuple[tuple[float, float], Callable[[NDArray[np.integer]], bool]]:
    """Both accuracies of independent steps, and a test whether other labels beat them."""
    truth = np.concatenate([np.asarray(labels) for labels in labelings])
    known = np.flatnonzero(truth >= 0)
    best = [np.asarray(problem.unary, np.float64).argmax(axis=1) for problem in problems]
    counts = None if node_weights is None else np.concatenate(node_weights)[known]
    predicted, true = np.concatenate(best)[known], truth[known]
    confusion = confusion_matrix(true, predicted, weights=counts)
    total = None if node_weights is None else float(sum(part.sum() for part in node_weights))
    stretch = stretches([len(labels) for labels in labelings], total)[known]

    def is_enough(answers: NDArray[np.integer]) -> bool:
        lead = (answers == true).astype(np.float64) - (predicted == true)
        return not (np.bincount(stretch, lead) < 0).any() or is_ahead(lead, stretch, counts)

    return (float(accuracy(confusion)), float(balanced_accuracy(confusion))), is_enough


def chosen_observation(model: Any, mode: int) -> Observation:
    """The observation model of a hidden Markov model in the mode of this index."""
    if model.observation != "auto":
        option: Observation = model.observation
        return option
    chosen = model.fitted_observations
    if chosen is None:
        return "soft"
    return OBSERVATIONS[learned_number("fitted_observations", chosen, mode, len(OBSERVATIONS))]


def words_of_choices(model: Any, mode: int) -> dict[str, str]:
    """The choices on training sequences for the mode of this index, in words by option."""
    if model.fitted_scores is None:
        return {}
    chosen = {}
    if model.observation == "auto":
        chosen["observation"] = str(chosen_observation(model, mode))
    if model.fitted_weights is not None:
        chosen["evidence_weight"] = f"{model.fitted_weights[mode]:g}"
    if model.fitted_shrinkages is not None:
        share = float(model.fitted_shrinkages[mode])
        chosen["shrinkage"] = f"{share:g}" if share < 1 else "1: each step by itself"
    if model.fitted_balances is not None:
        chosen["balance"] = f"{model.fitted_balances[mode]:g}"
    right, balanced, alone, alone_balanced = (100 * model.fitted_scores[mode]).tolist()
    if chosen:
        chosen[next(iter(chosen))] += (
            f" (accuracy on the training sequences {right:.1f}, balanced {balanced:.1f}; each step "
            f"alone {alone:.1f}, {alone_balanced:.1f})"
        )
    return chosen


def weights_at(
    weights: NDArray[np.float64] | None, from_m: float, to_m: float
) -> NDArray[np.float64] | None:
    """Fitted weights for updates farther apart: they grow with the distance, up to 1.

    Fewer observations then have the same weight per metre. Weights do not change for nearer
    updates.
    """
    return None if weights is None else np.minimum(weights * max(to_m / from_m, 1.0), 1.0)
