"""Scaling of feature columns, so that regularisation treats their weights alike."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from pgm_places._checks import is_sparse, set_frozen, stacked_rows
from pgm_places.errors import InputError

Scale = Literal["auto", "deviation", "none"]

CLIP = 5.0
"""Scaled node features are clipped here, so that a linear model does not depend on outliers."""

# Columns correlated beyond this carry the same information to a linear model.
SAME_COLUMN = 1.0 - 1e-9


@dataclass(frozen=True, eq=False)
class Standardization:
    """Selection and scaling of node feature columns, learned on training nodes."""

    n_columns: int
    """Columns of the input."""
    columns: NDArray[np.int64]
    """(D',) selected columns: neither constant nor a repetition of an earlier one."""
    mean: NDArray[np.float64]
    scale: NDArray[np.float64]
    """(D',) offset to subtract from each, then divisor."""
    clip: float = CLIP
    """Limit of the result's magnitude; infinite for none."""

    def __post_init__(self) -> None:
        set_frozen(self, columns=self.columns, mean=self.mean, scale=self.scale)

    @classmethod
    def of(cls, features: NDArray[np.float64], scale: Scale = "auto") -> "Standardization":
        """The standardisation for (N, D) training features.

        ``deviation`` subtracts the mean and divides by the standard deviation; sparse columns are
        only divided. ``auto`` leaves indicators (dense columns of zeros and ones) unchanged, and
        divides sparse columns by their size (:func:`column_sizes`), since the tiny deviation of
        rare columns would give them the weight of frequent ones. ``none`` leaves all columns
        unchanged. Constant columns are dropped, and dense ones equal to an earlier one up to shift,
        scale and sign: their weights would not be unique.
        """
        mean, spread = mean_and_spread(features)
        columns = _informative(features, mean, spread)
        mean, spread = mean[columns], spread[columns]
        if scale == "none":
            zero, one = np.zeros(len(columns)), np.ones(len(columns))
            return cls(features.shape[1], columns, zero, one, np.inf)
        if is_sparse(features):
            sizes = spread if scale == "deviation" else column_sizes(features)[columns]
            return cls(features.shape[1], columns, np.zeros(len(columns)), sizes)
        if scale == "auto":
            selected = features[:, columns]
            indicator = ((selected == 0) | (selected == 1)).all(axis=0)
            mean, spread = np.where(indicator, 0.0, mean), np.where(indicator, 1.0, spread)
        return cls(features.shape[1], columns, mean, spread)

    @classmethod
    def of_all(
        cls, features: Sequence[NDArray[np.float64]], scale: Scale = "auto"
    ) -> "Standardization":
        """The common standardisation of several training problems."""
        if len({matrix.shape[1] for matrix in features}) > 1:
            raise InputError(
                "training problems must have the same number of node features, got "
                f"{[matrix.shape[1] for matrix in features]}"
            )
        return cls.of(stacked_rows(features), scale)

    def apply(self, features: NDArray[np.float64]) -> NDArray[np.float64]:
        """(N, D' + 1): selected columns scaled and clipped, then the constant 1."""
        if features.shape[1] != self.n_columns:
            raise InputError(
                f"the model was trained on {self.n_columns} node features, this problem has "
                f"{features.shape[1]}; compute them as for training"
            )
        if is_sparse(features):
            return self._apply_to_sparse(features)
        out = np.empty((len(features), len(self.columns) + 1))
        np.subtract(features[:, self.columns], self.mean, out=out[:, :-1])
        out[:, :-1] /= self.scale
        np.clip(out[:, :-1], -self.clip, self.clip, out=out[:, :-1])
        out[:, -1] = 1.0
        return out

    def _apply_to_sparse(self, features: Any) -> NDArray[np.float64]:
        """:meth:`apply` for sparse features; zeros stay zeros, since no mean is subtracted."""
        import scipy.sparse as sp

        if self.mean.any():
            raise InputError(
                "the model was trained on dense node features, whose means it subtracts; pass "
                "node_features.toarray(), or train it on sparse ones"
            )
        scaled = features[:, self.columns].multiply(1.0 / self.scale).tocsr()
        np.clip(scaled.data, -self.clip, self.clip, out=scaled.data)
        constant = sp.csr_array(np.ones((features.shape[0], 1)))
        with_constant: Any = sp.hstack([scaled, constant], format="csr")
        return with_constant


def column_sizes(features: NDArray[np.float64]) -> NDArray[np.float64]:
    """(D,) root mean square of the non-zero entries of each column; 1 without any.

    Division by it removes the unit, and leaves zeros and indicators unchanged.
    """
    if not features.shape[0]:
        return np.ones(features.shape[1])
    entries: Any = abs(features)
    peak = _row(entries.max(axis=0))
    peak[peak == 0] = 1.0
    # Relative to the peak, so that squares of huge entries do not overflow.
    shares = entries.multiply(1.0 / peak) if is_sparse(features) else entries / peak
    squares = _row((shares * shares).sum(axis=0))
    count = np.maximum(_row((entries != 0).sum(axis=0)), 1)
    return np.where(squares > 0, peak * np.sqrt(squares / count), 1.0)


def _row(values: Any) -> NDArray[np.float64]:
    """A row by SciPy or NumPy as an array (D,)."""
    dense = values.toarray() if is_sparse(values) else values
    return np.array(dense, np.float64).ravel()


def mean_and_spread(
    features: NDArray[np.float64],
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """(D,) means and standard deviations of columns, dense or sparse."""
    if not is_sparse(features):
        return features.mean(axis=0), features.std(axis=0)
    mean = np.asarray(features.mean(axis=0)).ravel()
    square = np.asarray((features * features).mean(axis=0)).ravel()
    return mean, np.sqrt(np.maximum(square - mean**2, 0.0))


def _informative(
    features: NDArray[np.float64], mean: NDArray[np.float64], spread: NDArray[np.float64]
) -> NDArray[np.int64]:
    """The columns that are neither constant nor, in dense features, repeat an earlier one."""
    columns = np.flatnonzero(spread > 1e-12 * np.abs(mean))
    if is_sparse(features):
        return columns
    centred = (features[:, columns] - mean[columns]) / spread[columns]
    likeness = np.abs(centred.T @ centred) / len(features)
    return columns[~np.triu(likeness > SAME_COLUMN, k=1).any(axis=0)]
