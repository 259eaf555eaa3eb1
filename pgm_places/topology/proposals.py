"""Proposed splits for a person to decide on: rooms joined by a missed doorway (paper, Fig. 9)."""

from dataclasses import dataclass

import numpy as np

from pgm_places.errors import InputError
from pgm_places.topology.clearance import squared_clearance
from pgm_places.topology.corrections import CorrectionRules
from pgm_places.topology.refinements import find_splits
from pgm_places.topology.topological_map import TopologicalMap

__all__ = ["ProposedSplit", "propose_splits"]


@dataclass(frozen=True)
class ProposedSplit:
    """Where a place could be split in two.

    Parameters
    ----------
    region : str
        Name of the place.
    start_m, end_m : (float, float)
        Ends of the line from wall to wall, in the map frame.
    areas_m2 : (float, float)
        Areas of the larger and the smaller part.
    """

    region: str
    start_m: tuple[float, float]
    end_m: tuple[float, float]
    areas_m2: tuple[float, float]

    @property
    def width_m(self) -> float:
        """Length of the line."""
        return float(np.hypot(*np.subtract(self.end_m, self.start_m)))

    @property
    def middle_m(self) -> tuple[float, float]:
        """The midpoint of the line."""
        (x0, y0), (x1, y1) = self.start_m, self.end_m
        return ((x0 + x1) / 2, (y0 + y1) / 2)


def propose_splits(
    topology: TopologicalMap, narrower_than_m: float, *, min_part_m2: float = 4.0
) -> list[ProposedSplit]:
    """Constrictions of places, except doorways, between two wide parts, widest part first.

    ``split_rooms_m`` of ``CorrectionRules`` would put a doorway there.

    Parameters
    ----------
    topology : TopologicalMap
    narrower_than_m : float
        Widest constriction to list, from wall to wall; openings between offices are up to 1.5 m
        wide.
    min_part_m2 : float
        Minimum area of either part.

    Raises
    ------
    InputError
        A width that is not positive, or a map without doorways among its labels.
    """
    if not narrower_than_m > 0:
        raise InputError(
            f"narrower_than_m must be a positive length in metres, got {narrower_than_m}"
        )
    rules = CorrectionRules(
        doorway_label=topology.doorway_label,
        split_rooms_m=narrower_than_m,
        min_part_m2=min_part_m2,
    )
    grid = topology.grid
    clearance = squared_clearance(topology.region == 0)
    splits = find_splits(topology.labels, clearance, topology.label_names, grid.resolution_m, rules)
    found = []
    for split in splits:
        row, column = split.cells[len(split.cells) // 2]
        ends = grid.cell_centres_m([split.chord.start_rc, split.chord.end_rc]).tolist()
        name = topology.place(int(topology.region[row, column])).name
        (x0, y0), (x1, y1) = ends
        found.append(ProposedSplit(name, (x0, y0), (x1, y1), split.areas_m2))
    return found
