"""Hypothesis strategies: arrays, small graphs and the potentials on them."""

from functools import cache
from typing import Any, Literal

import numpy as np
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from numpy.typing import NDArray

from tests.reference.energy import Model

Kind = Literal["associative", "agreement", "metric", "shared table", "tables"]

quarters = st.integers(-12, 12).map(lambda n: n / 4)
"""Values whose sums are exact, with many ties."""

reals = st.floats(-3, 3, allow_nan=False, width=32)
"""Values without structure."""


@cache
def varied_arrays(
    dtype: type[np.generic], shape: Any, *, elements: st.SearchStrategy[Any] | None = None
) -> st.SearchStrategy[NDArray[Any]]:
    """Arrays of which half are mostly of one value, as by default, and half drawn one by one.

    Large regions need the former; ties, and everything else between neighbours, the latter.
    """
    return arrays(dtype, shape, elements=elements) | arrays(
        dtype, shape, elements=elements, fill=st.nothing()
    )


@cache
@st.composite
def edge_lists(draw: st.DrawFn, n_nodes: int, *, forest: bool = False) -> NDArray[np.int64]:
    """(E, 2) pairs i < j, sorted, each once; without cycles where asked."""
    if forest:
        above = [draw(st.integers(-1, j - 1)) for j in range(1, n_nodes)]
        pairs = [(i, j) for j, i in enumerate(above, start=1) if i >= 0]
    else:
        every = [(i, j) for i in range(n_nodes) for j in range(i + 1, n_nodes)]
        pairs = [pair for pair in every if draw(st.booleans())]
    return np.array(sorted(pairs), np.int64).reshape(-1, 2)


@st.composite
def models(
    draw: st.DrawFn,
    kinds: tuple[Kind, ...] = ("associative", "agreement", "shared table", "tables"),
    *,
    n_labels: st.SearchStrategy[int] | None = None,
    max_nodes: int = 6,
    forest: bool = False,
    exact: bool = False,
    forbid: bool = True,
) -> Model:
    """A pairwise model of up to ``max_nodes`` nodes and 3 labels.

    ``exact`` keeps to values whose sums are exact; ``forbid`` lets unaries be -inf, though never
    for all labels of a node.
    """
    n_nodes = draw(st.integers(0, max_nodes))
    labels = draw(n_labels if n_labels is not None else st.integers(1, 3))
    edges = draw(edge_lists(n_nodes, forest=forest))
    values = quarters if exact else draw(st.sampled_from([quarters, reals]))
    unary = draw(varied_arrays(np.float64, (n_nodes, labels), elements=values))
    if forbid and draw(st.booleans()):
        barred = draw(varied_arrays(np.bool_, unary.shape))
        barred[np.arange(n_nodes), unary.argmax(axis=1)] = False
        unary = np.where(barred, -np.inf, unary)
    kind = draw(st.sampled_from(kinds))
    n_edges = len(edges)
    if kind in ("associative", "agreement"):
        reward = draw(varied_arrays(np.float64, (n_edges, labels), elements=values))
        return Model(unary, edges, np.abs(reward) if kind == "associative" else reward)
    if kind == "metric":
        positions = np.arange(labels)
        distance = np.minimum(np.abs(positions[:, None] - positions), 1.5)
        weight = np.abs(draw(varied_arrays(np.float64, (n_edges, 1, 1), elements=values)))
        return Model(unary, edges, pairwise=-weight * distance)
    shape = (labels, labels) if kind == "shared table" else (n_edges, labels, labels)
    return Model(unary, edges, pairwise=draw(varied_arrays(np.float64, shape, elements=values)))


@st.composite
def ruled_models(draw: st.DrawFn, *, forest: bool = False, max_nodes: int = 6) -> Model:
    """A model whose tables forbid pairs of labels, possibly every labelling."""
    model = draw(models(("shared table", "tables"), forest=forest, exact=True, max_nodes=max_nodes))
    assert model.pairwise is not None
    barred = draw(varied_arrays(np.bool_, model.pairwise.shape))
    return Model(model.unary, model.edges, pairwise=np.where(barred, -np.inf, model.pairwise))
