"""The order of label names changes the order of tables and no figure."""

from dataclasses import replace

import pytest

from experiments.label_order import METHODS, ORDERS, UNARIES, compared, differences

WITHOUT_LEARNING = METHODS[:3]
SMALL = {
    0.2: (20, "laser", (((0, 200), (200, 400)), (100, 300))),
    0.1: (4, "context", (((30, 130), (130, 230)), (200, 320))),
    0.05: (2, "space", (((60, 120), (120, 180)), (210, 270))),
}
"""Rounds of boosting, what AMN and CRF learn from, and small parts of the building, by cells."""


@pytest.mark.parametrize("resolution_m", SMALL)
def test_figures_do_not_depend_on_the_order_of_names(resolution_m: float) -> None:
    n_rounds, learned_from, parts = SMALL[resolution_m]
    methods = [(method, unary) for method in WITHOUT_LEARNING for unary in UNARIES]
    methods += [(method, learned_from) for method in METHODS[3:]]
    first, *others = [compared(names, resolution_m, n_rounds, methods, parts) for names in ORDERS]
    assert all(None not in method.evaluation.recall.values() for method in first.methods)
    for other in others:
        assert list(differences(first, other)) == []


def test_a_difference_is_named() -> None:
    methods = [("independent", "laser")]
    found = compared(ORDERS[0], 0.2, 5, methods, (((0, 200), (200, 400)), (100, 300)))
    [method] = found.methods
    [labeling] = method.labelings
    labels = labeling.labels.copy()
    labels[0] = (labels[0] + 1) % 3
    changed = replace(method, labelings=(replace(labeling, labels=labels),))
    other = replace(found, methods=(changed,))
    assert list(differences(found, other)) == ["independent laser: 1 labels"]
