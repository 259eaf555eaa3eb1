"""Online filter of chain models: one observation at a time, from the previous belief."""

from abc import ABC, abstractmethod
from typing import Any, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pgm_places._checks import finite_array, number_array
from pgm_places._travelling import travels


@travels
class StepFilter(ABC):
    """Online interface of chain models."""

    def advance(
        self,
        unary: ArrayLike,
        state: Any = None,
        *,
        moved_m: float | None = None,
        further: ArrayLike | None = None,
    ) -> tuple[NDArray[np.float64], Any, bool]:
        """The belief (K,) after one more observation, the next state, and whether it was possible.

        Parameters
        ----------
        unary : (K,) float
            Log-probabilities of the labels from the classifier; -inf forbids a label, NaN for all
            labels means no observation.
        state : optional
            State after the step before, None at the first step: the belief (K,) in a hidden Markov
            model.
        moved_m : float, optional
            Distance from the step before, for ``stay_below_m``; None counts as moved.
        further : (K,) float, optional
            Log-likelihoods of other observations.
        """
        row = number_array("unary", unary)
        if row.ndim != 1 or not row.size or not np.isnan(row).all():
            row = finite_array("unary", row, ("K",), allow_minus_inf=True)
        observed = self._log_likelihood(row[None])[0]
        if further is not None:
            observed += finite_array("further", further, row.shape)
        belief, after, was_possible = self._next(observed, state, moved_m)
        if not was_possible and (row == -np.inf).any() and row.max() > -np.inf:
            belief, after, _ = self._all_possible._next(observed, state, moved_m)
        return belief, after, was_possible

    @abstractmethod
    def _log_likelihood(self, unary: NDArray[np.float64]) -> NDArray[np.float64]:
        """(T, K) ``log P(z_t | l)`` up to a constant per step; -inf where a label is forbidden."""

    @property
    @abstractmethod
    def _all_possible(self) -> Self:
        """The model without probabilities of 0 that known labels could contradict."""

    @abstractmethod
    def _next(
        self, observed: NDArray[np.float64], state: Any, moved_m: float | None
    ) -> tuple[NDArray[np.float64], Any, bool]:
        """:meth:`advance` for checked log-likelihoods."""
