"""The unary as evidence: posteriors, or posteriors divided by a power of the labels' prior."""

from typing import Any, Literal, TypeVar

import numpy as np
from numpy.typing import NDArray

from pgm_places.inference.problem import LabelingProblem
from pgm_places.options import Probability

Evidence = Literal["posterior", "likelihood"] | Probability
"""``"posterior"``, ``"likelihood"``, or the exponent of the prior to divide by (0 and 1)."""


Real = TypeVar("Real", bound=np.floating[Any])


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
    """(N, K) a problem's unary less ``share`` of the log-prior; rows without an observation stay.

    ``prior`` (K,) holds the shares of the labels.
    """
    divided: NDArray[Real] = unary - (share * np.log(prior)).astype(unary.dtype)
    if problem.unseen is not None:
        divided[problem.unseen] = unary[problem.unseen]
    return divided
