"""Regularity: which pairwise potentials a minimum cut can handle."""

import numpy as np
from numpy.typing import NDArray

from pgm_places.errors import InputError
from pgm_places.solvers.pairwise import PairwiseModel

_ROUNDING = 1e-9
"""Tables may miss regularity by this share of their largest entry: that much is rounding."""


def require_regular(model: PairwiseModel) -> None:
    """Raise InputError, naming edge and labels, where an expansion move is no minimum cut."""
    if model.n_labels == 1 or model.around.n_edges == 0:
        return
    if model.agreement is not None:
        _require_regular_agreement(model, model.agreement)
    else:
        _require_regular_tables(model, model.tables)


def _require_regular_agreement(model: PairwiseModel, agreement: NDArray[np.float64]) -> None:
    worst = agreement if model.n_labels > 2 else agreement.sum(axis=1, keepdims=True)
    if worst.min() >= 0:
        return
    edge, label = (int(index) for index in np.argwhere(worst < 0)[0])
    others = [k for k in range(model.n_labels) if k != label]
    keep = (others[0], others[-1])
    wanted = "at least 0" if model.n_labels > 2 else "at least 0 in sum over the two labels"
    raise _not_regular(
        model, edge, keep, label, f"agreement must be {wanted}, got {agreement[edge].tolist()}"
    )


def _require_regular_tables(model: PairwiseModel, tables: NDArray[np.float64]) -> None:
    if not np.isfinite(tables).all():
        table, first, second = (int(index) for index in np.argwhere(~np.isfinite(tables))[0])
        raise InputError(
            f"expansion needs finite pairwise log-potentials, got {tables[table, first, second]} "
            f"for labels {first} and {second} at edge {table}; use a large negative number"
        )
    slack = _ROUNDING * np.abs(tables).max(axis=(1, 2), initial=0.0)[:, None, None]
    for label in range(model.n_labels):
        gain = tables + tables[:, label, None, None, label]
        gain = gain - tables[:, :, None, label] - tables[:, label, None, :]
        bad = np.argwhere(gain < -slack)
        if len(bad):
            edge, first, second = (int(index) for index in bad[0])
            raise _not_regular(
                model,
                edge,
                (first, second),
                label,
                "pairwise[b, c] + pairwise[a, a] must be at least pairwise[b, a] + pairwise[a, c], "
                f"got {gain[edge, first, second]:.6g} too little",
            )


def _not_regular(
    model: PairwiseModel, edge: int, keep: tuple[int, int], label: int, reason: str
) -> InputError:
    i, j = model.around.edges[edge]
    return InputError(
        f"no expansion on label a={label} over labels b={keep[0]}, c={keep[1]} at edge {edge} "
        f"({i}, {j}): {reason}. Use 'trw-s' or another decoder for such potentials"
    )
