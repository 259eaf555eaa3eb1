"""The choice of options on held-out parts: which nodes count, and what is held out."""

import numpy as np
from numpy.typing import NDArray

from pgm_places import LabelGraph, LabelingProblem
from pgm_places.models import labelled_examples
from pgm_places.models.held_out_choice import Path, choose
from pgm_places.models.labelled_examples import held_out_parts, searched_parts

N_CELLS, N_STEPS = 200, 20


def choice_of(steps: NDArray[np.bool_]) -> float:
    """The C that is chosen: 1 labels all cells right and no step, 10 nine cells of ten, and all."""
    truth = np.arange(N_CELLS + N_STEPS) % 2
    few = np.arange(N_CELLS + N_STEPS) % 8 == 0
    wrong = {1.0: np.arange(N_CELLS + N_STEPS) >= N_CELLS, 10.0: few & ~steps}
    if not steps.any():
        wrong[10.0] = few & (np.arange(N_CELLS + N_STEPS) < N_CELLS)
    parts = np.arange(N_CELLS + N_STEPS) // 2 % 2

    def begin(part: NDArray[np.bool_], _name: str, _learner: str) -> Path:
        def at(penalty: float) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
            return np.where(wrong[penalty], 1 - truth, truth)[part], np.zeros(1)

        return at

    asked, kinds = np.ones(len(truth), np.bool_), (("logz",), ("qp",))
    return choose(truth, asked, parts, kinds, (1.0, 10.0), 10.0, begin, steps=steps).best.penalty


def test_few_linked_steps_count_as_much_as_many_cells() -> None:
    steps = np.arange(N_CELLS + N_STEPS) >= N_CELLS
    assert choice_of(np.zeros(N_CELLS + N_STEPS, np.bool_)) == 1.0
    assert choice_of(steps) == 10.0


def test_half_of_the_parts_are_held_out_where_problems_are_many() -> None:
    problem = LabelingProblem(LabelGraph.from_lattice((2,)), ("a", "b"), np.zeros((2, 2)))
    many = [(problem, np.array([0, 1]))] * labelled_examples.MANY
    assert np.unique(searched_parts(many, 4)).tolist() == [-1, 0, 1]
    assert np.mean(searched_parts(many, 4) < 0) == 0.5
    assert (searched_parts(many[1:], 4) == held_out_parts(many[1:], 4)).all()
    assert held_out_parts(many[:3], 4).tolist() == [0, 0, 1, 1, 2, 2]  # each problem whole
