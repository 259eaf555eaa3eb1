"""What the page of all maps shows, gathered row by row."""

import heapq
from dataclasses import dataclass, field

from pgm_places.batch.growing_table import Row

MOST_ROWS = 2000
"""Maps listed, those with most area in doubt; the table of all is in ``summary.csv``."""


@dataclass
class Overview:
    """Sums over all maps, and the rows that the page has room for.

    Parameters
    ----------
    labels : tuple of str
    n_rows, n_failures, n_places, n_gone : int
        Maps that are labelled, failures, places, and labelled maps that are no longer in the input.
    area_m2, known_m2, doubtful_m2 : float
        The area of all maps, of those whose doubt is known, and what is in doubt of it.
    failures : list of Row
        The first ones.
    gone : list of str
        The first names.
    """

    labels: tuple[str, ...]
    n_rows: int = 0
    n_failures: int = 0
    n_places: int = 0
    n_gone: int = 0
    area_m2: float = 0.0
    known_m2: float = 0.0
    doubtful_m2: float = 0.0
    failures: list[Row] = field(default_factory=list)
    gone: list[str] = field(default_factory=list)
    _most: list[tuple[float, int, Row]] = field(default_factory=list)

    def count(self, row: Row) -> None:
        """Take a map into account."""
        area_m2, doubtful_m2 = _number(row["area_m2"]), _number(row["doubtful_m2"])
        self.n_rows += 1
        self.n_places += int(_number(row["places"]))
        self.area_m2 += area_m2
        if row["doubtful_m2"]:
            self.known_m2 += area_m2
            self.doubtful_m2 += doubtful_m2
        if row["in_input"] == "no":
            self.n_gone += 1
            self.gone += [row["name"]] if self.n_gone <= MOST_ROWS else []
        item = (doubtful_m2, -self.n_rows, row)
        if len(self._most) < MOST_ROWS:
            heapq.heappush(self._most, item)
        else:
            heapq.heappushpop(self._most, item)

    def count_failure(self, row: Row) -> None:
        """Take a failure into account."""
        self.n_failures += 1
        self.failures += [row] if self.n_failures <= MOST_ROWS else []

    @property
    def rows(self) -> list[Row]:
        """The maps with most area in doubt, those first; then by name."""
        return [row for *_, row in sorted(self._most, key=lambda item: (-item[0], -item[1]))]


def _number(text: str) -> float:
    """A number of the table; 0 for what is none."""
    try:
        return float(text)
    except ValueError:
        return 0.0
