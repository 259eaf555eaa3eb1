"""Sign test: whether one method is better than another in more buildings than chance allows."""

from collections.abc import Sequence
from dataclasses import dataclass
from math import comb
from typing import Self

__all__ = ["SignTest"]


@dataclass(frozen=True)
class SignTest:
    """In how many buildings a method is better than another, worse, or as good.

    Examples
    --------
    >>> test = SignTest.of([0.9, 0.8, 0.9, 0.7, 0.9, 0.8, 0.5], [0.8, 0.7, 0.8, 0.6, 0.8, 0.7, 0.5])
    >>> test, round(test.p_value, 3)
    (SignTest(better=6, worse=0, even=1), 0.031)
    """

    better: int
    worse: int
    even: int

    @classmethod
    def of(cls, first: Sequence[float], second: Sequence[float]) -> Self:
        """From the figure of both methods in each building."""
        pairs = list(zip(first, second, strict=True))
        better, worse = sum(a > b for a, b in pairs), sum(a < b for a, b in pairs)
        return cls(better, worse, len(pairs) - better - worse)

    @property
    def n_buildings(self) -> int:
        """All of them, those where the methods are even, too."""
        return self.better + self.worse + self.even

    @property
    def p_value(self) -> float:
        """Probability of so uneven a count, or a more uneven one, if both were equally good.

        Two-sided and exact; buildings where both are even say nothing and are left out. Below 0.05
        it takes six buildings.
        """
        n = self.better + self.worse
        tail = sum(comb(n, k) for k in range(min(self.better, self.worse) + 1))
        return min(1.0, 2.0 * tail / 2.0**n)
