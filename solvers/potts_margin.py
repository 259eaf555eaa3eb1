"""Max-margin learning of Potts models: one reward of agreement for all labels."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pgm_places.solvers.max_margin import MarginProblem, MaxMarginProblem


@dataclass(frozen=True, eq=False)
class PottsMarginProblem(MaxMarginProblem):
    """A :class:`~pgm_places.solvers.max_margin.MaxMarginProblem` with edge weights (F,).

    With weights per label, a label with larger edge rewards gains at every node inside a region,
    by the rewards of the node's edges. Next to an offset of likely labels, this relabels entire
    regions; with common weights only borders are left to learn.
    """

    @property
    def n_pair_weights(self) -> int:
        """D K + F: where the clique weights begin in the flat weight vector."""
        return self.n_free + self.edge_features.shape[1]

    def split(
        self, weights: NDArray[np.float64]
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Node weights (D, K) of a flat weight vector, and edge weights repeated for each label."""
        start, end = self.n_free, self.n_pair_weights
        of_edges = np.repeat(weights[start:end, None], self.n_labels, axis=1)
        return weights[:start].reshape(-1, self.n_labels), of_edges

    def edge_part(self, by_label: NDArray[np.float64]) -> NDArray[np.float64]:
        """Sums of edge features by label (F, K) as (F,) sums over all labels."""
        return np.asarray(by_label.sum(axis=1))

    def _less_than_truth(self, labels: NDArray[np.int64]) -> NDArray[np.float64]:
        return MarginProblem._less_than_truth(self, labels)
