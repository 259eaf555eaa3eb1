from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray
from scipy.optimize import minimize_scalar

from pgm_places import LabelGraph, Labeling, LabelingProblem, Status
from pgm_places.errors import InputError
from pgm_places.inference.temperature import calibrated, likeliest_temperature, tempered
from pgm_places.models.decoders import Decoder
from pgm_places.models.mrf import Independent, PottsField
from tests.refusals import refused


def beliefs_of(seed: int, n: int = 200, sharpness: float = 1.0) -> NDArray[np.float64]:
    values = np.exp(sharpness * np.random.default_rng(seed).normal(scale=1.5, size=(n, 3)))
    found: NDArray[np.float64] = values / values.sum(axis=1, keepdims=True)
    return found


def drawn_from(beliefs: NDArray[np.float64], seed: int) -> NDArray[np.int64]:
    below = np.random.default_rng(seed).random((len(beliefs), 1)) < beliefs.cumsum(axis=1)
    return below.argmax(axis=1)


def beliefs_at(temperature: float, given: Labeling) -> NDArray[np.floating]:
    found = tempered(given, temperature).beliefs
    assert found is not None
    return found


@given(st.integers(0, 2**32), st.floats(0.05, 20.0), st.sampled_from([np.float32, np.float64]))
def test_each_row_is_divided_by_its_own_sum(
    seed: int, temperature: float, dtype: type[np.floating]
) -> None:
    beliefs = beliefs_of(seed, 20).astype(dtype)
    given = Labeling(beliefs.argmax(axis=1), Status.CONVERGED, beliefs=beliefs, score=-1.5)
    found = tempered(given, temperature)
    for row, old in zip(beliefs_at(temperature, given), beliefs.astype(np.float64), strict=True):
        powers = [value ** (1 / temperature) for value in old / old.max()]
        np.testing.assert_allclose(row, np.array(powers) / sum(powers), rtol=1e-4, atol=1e-30)
    assert beliefs_at(temperature, given).dtype == dtype
    assert found.labels is given.labels
    assert (found.score, found.status) == (given.score, given.status)


def test_what_is_certain_stays_certain_and_what_is_cold_is_left() -> None:
    sure = Labeling(np.array([1]), Status.EXACT, beliefs=np.array([[0.0, 1.0, 0.0]]))
    for temperature in (0.01, 1.4, 50.0):
        assert beliefs_at(temperature, sure).tolist() == [[0.0, 1.0, 0.0]]
    close = Labeling(np.array([0]), Status.EXACT, beliefs=np.full((1, 3), 1 / 3))
    np.testing.assert_allclose(beliefs_at(1e-4, close), 1 / 3, rtol=1e-12)


def test_temperatures_have_limits() -> None:
    assert likeliest_temperature([[[0.6, 0.4]] * 5], [[0] * 5]) == 1.0  # always right
    assert likeliest_temperature([[[1.0, 0.0]] * 5], [[1] * 5]) == pytest.approx(100.0, rel=1e-5)
    wanted = "no node has a true label, so no temperature"
    refused(InputError, wanted, likeliest_temperature, [[[0.5, 0.5]]], [[-1]])


@pytest.mark.parametrize("temperature", ["auto", 1.0])
def test_nothing_to_do_is_no_copy(temperature: float) -> None:
    found = Labeling(np.array([0]), Status.EXACT, beliefs=np.array([[0.8, 0.2]]))
    assert tempered(found, temperature) is found
    assert tempered(Labeling(np.array([0]), Status.EXACT), 2.0).beliefs is None


@pytest.mark.parametrize("n", [7, 300_000])
def test_any_number_of_threads_gives_the_same_bits(n: int, monkeypatch: pytest.MonkeyPatch) -> None:
    beliefs = beliefs_of(3, n).astype(np.float32)
    given = Labeling(beliefs.argmax(axis=1), Status.CONVERGED, beliefs=beliefs)
    found = []
    for threads in ("1", "3"):
        monkeypatch.setenv("PGM_PLACES_NUM_THREADS", threads)
        found.append(beliefs_at(1.3, given))
    np.testing.assert_array_equal(found[0], found[1])


@pytest.mark.parametrize("sharpness", [1.0, 1.4, 3.0])
def test_beliefs_made_too_sure_are_given_back_their_doubt(sharpness: float) -> None:
    honest, sharp = beliefs_of(5, 40_000), beliefs_of(5, 40_000, sharpness)
    found = likeliest_temperature([sharp], [drawn_from(honest, 6)])
    assert found == pytest.approx(sharpness, rel=0.03)


def test_it_makes_the_true_labels_likeliest_with_every_graph_weighing_the_same() -> None:
    beliefs = [beliefs_of(1, 50, 4.0), beliefs_of(2, 500, 2.0)]
    truths = [drawn_from(beliefs_of(seed, n), 3) for seed, n in ((1, 50), (2, 500))]
    truths[1][::3] = -1

    def cross_entropy(power: float) -> float:
        total = 0.0
        for part, truth in zip(beliefs, truths, strict=True):
            log = power * np.log(part)
            log -= np.logaddexp.reduce(log, axis=1, keepdims=True)
            total -= np.mean([log[i, k] for i, k in enumerate(truth) if k >= 0])
        return total

    best = minimize_scalar(cross_entropy, bounds=(0.01, 1.0), options={"xatol": 1e-8})
    assert likeliest_temperature(beliefs, truths) == pytest.approx(1 / best.x, rel=1e-4)


def noisy_floor(seed: int) -> tuple[LabelingProblem, NDArray[np.int64]]:
    """Two halves, and scores whose errors come in patches: neighbours see the same."""
    truth = np.zeros((24, 24), np.int64)
    truth[:, 12:] = 1
    wrong = np.kron(np.random.default_rng(seed).random((6, 6)) < 0.2, np.ones((4, 4))) > 0
    shown = np.where(wrong, 1 - truth, truth)
    unary = np.log(np.where(shown.reshape(-1, 1) == [[0, 1]], 0.8, 0.2))
    graph = LabelGraph.from_grid(np.ones((24, 24), np.bool_))
    return LabelingProblem(graph, ["left", "right"], unary), truth.ravel()


@pytest.mark.parametrize("decoder", ["mean-field", "sum-product"])
def test_calibrated_methods_are_less_sure_and_label_alike(decoder: Decoder) -> None:
    problems, truths = zip(*map(noisy_floor, range(10)), strict=True)
    method = PottsField(0.25, inference=decoder)
    found = calibrated(method, problems, truths)
    assert found.temperature > 1.2
    pairs = [noisy_floor(seed) for seed in range(10, 20)]
    before, after = ([m.infer(problem) for problem, _ in pairs] for m in (method, found))
    for old, new in zip(before, after, strict=True):
        np.testing.assert_array_equal(new.labels, old.labels)
    assert _brier(after, pairs) < 0.97 * _brier(before, pairs)


def _brier(found: list[Labeling], pairs: list[tuple[LabelingProblem, NDArray[np.int64]]]) -> float:
    """The mean squared difference of beliefs from certainty of the true label."""
    beliefs = [item.beliefs for item in found if item.beliefs is not None]
    errors = [part - np.eye(2)[truth] for part, (_, truth) in zip(beliefs, pairs, strict=True)]
    return float(np.mean(np.square(errors)))


@pytest.mark.parametrize(
    "method", [PottsField(), Independent(), PottsField(inference="mean-field", temperature=1.5)]
)
def test_what_has_no_beliefs_or_a_temperature_stays(method: Any) -> None:
    problem, truth = noisy_floor(1)
    assert calibrated(method, [problem], [truth]) is method


def test_nodes_that_the_problem_knows_do_not_count() -> None:
    """Their beliefs are given, so they would tell that the method is right whenever it is sure."""
    problem, truth = noisy_floor(2)
    left = truth == 0
    known = LabelingProblem(
        problem.graph, problem.label_names, problem.unary, known=np.where(left, truth, -1)
    )
    method = PottsField(0.25, inference="mean-field")
    found = calibrated(method, [known], [truth])
    assert found == calibrated(method, [known], [np.where(left, -1, truth)])
    assert found.temperature > 1.0
    all_known = LabelingProblem(problem.graph, problem.label_names, problem.unary, known=truth)
    assert calibrated(method, [all_known], [truth]) is method
