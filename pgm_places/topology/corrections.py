"""The paper's heuristic corrections of regions (section 6.2), each one recorded."""

import heapq
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import chain
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from pgm_places.graph.bands import bands_of_rows
from pgm_places.maps.components import Components, connected_components, squared_clearance
from pgm_places.topology.regions import contacts
from pgm_places.topology.rules import CorrectionRules

LabelType = TypeVar("LabelType", np.int16, np.int32)


@dataclass(frozen=True)
class Correction:
    """One region that got the label of a neighbour.

    ``cell_rc`` is a cell of the region. ``reason`` is ``"too small"``, ``"no room"`` for a disc of
    ``min_clearance_m``, ``"joins nothing"``, or
    ``"touches nothing"`` if it lost its label; ``became`` is then empty. Painted doorways
    that no gate touches have the reason ``"no gate"`` and an empty ``became``: they are filled with
    the nearest labels.
    """

    cell_rc: tuple[int, int]
    area_m2: float
    was: str
    became: str
    reason: str


def correct_regions(
    labels: NDArray[LabelType],
    label_names: Sequence[str],
    resolution_m: float,
    rules: CorrectionRules | None = None,
    *,
    fixed_doorways: bool = False,
    free: NDArray[np.bool_] | None = None,
) -> tuple[NDArray[LabelType], list[Correction]]:
    """The corrected label raster and the corrections.

    The smallest wrong region is corrected first. It gets the label of the neighbour with the
    longest common border (ties go to the first in reading order from the bottom) and merges with
    all its neighbours of that label. This is repeated until no wrong region has neighbours. The
    remaining wrong regions are dropped: a robot cannot reach such specks, which are free cells
    inside furniture or behind windows.

    ``labels`` (H, W): label per cell, -1 for none. ``label_names``: labels with equal names are
    distinct. ``resolution_m``: side of a cell. ``fixed_doorways``: regions become part of a doorway
    only if they touch nothing else. ``free`` (H, W): cells on which a disc of ``min_clearance_m``
    may lie; by default the labelled cells.
    """
    rules = rules or CorrectionRules()
    pieces = connected_components(np.asarray(labels))
    has_room = np.ones(pieces.count, np.bool_)
    if rules.min_clearance_m > 0:
        least = rules.min_clearance_m / resolution_m + 0.5  # from centre to centre
        squared = squared_clearance(labels < 0 if free is None else ~free)
        inside = (squared >= least**2 - 1e-9) & (pieces.piece >= 0)
        has_room[:] = np.bincount(pieces.piece[inside], minlength=pieces.count) > 0
    merging = _Merging(pieces, label_names, resolution_m**2, rules, fixed_doorways, has_room)
    log = list(chain(merging.run(), merging.drop_islands()))
    label = merging.final_labels().astype(labels.dtype)
    same = label.dtype == pieces.piece.dtype  # saves a raster, for huge maps
    return pieces.on_cells(label, -1, out=pieces.piece if same else None), log


class _Merging:
    """Regions as nodes of a graph of borders; a correction merges nodes, not rasters."""

    def __init__(
        self,
        pieces: Components,
        names: Sequence[str],
        cell_m2: float,
        rules: CorrectionRules,
        fixed_doorways: bool,
        has_room: NDArray[np.bool_],
    ) -> None:
        self.has_room: list[bool] = has_room.tolist()
        self.names, self.cell_m2, self.rules = names, cell_m2, rules
        self.fixed_doorways, self.width = fixed_doorways, pieces.piece.shape[1]
        self.label: list[int] = pieces.label.tolist()
        self.size: list[int] = pieces.size.tolist()
        self.parent = list(range(pieces.count))
        self.first = list(range(pieces.count))  # the first of the pieces merged into each
        self.first_cell = _first_cells(pieces)
        self.borders: list[dict[int, int]] = [{} for _ in range(pieces.count)]
        touching = contacts(pieces.piece, pieces.count)
        # Lengths in thousandths of a side, a corner counting as one, so that sums are exact.
        lengths = 1000 * touching.sides + touching.corners
        for (i, j), length in zip(touching.pairs.tolist(), lengths.tolist(), strict=True):
            self.borders[i][j] = self.borders[j][i] = length

    def run(self) -> Iterator[Correction]:
        """Correct regions until no wrong one has neighbours."""
        queue = [(self.size[r], self.first[r], r) for r in range(len(self.label)) if self.reason(r)]
        heapq.heapify(queue)
        while queue:
            size, _, region = heapq.heappop(queue)
            reason = self.reason(region)
            if self.parent[region] != region or self.size[region] != size or not reason:
                continue  # merged since it was queued
            around = self.borders[region]
            best = min(around, key=lambda other: self.rank(region, other))
            became = self.label[best]
            yield self.entry(region, self.names[became], reason)
            for changed in self.relabel(region, became):
                if self.reason(changed):
                    heapq.heappush(queue, (self.size[changed], self.first[changed], changed))

    def drop_islands(self) -> Iterator[Correction]:
        """Drop wrong regions without neighbours, in the order of their first cells."""
        roots = (r for r, parent in enumerate(self.parent) if r == parent and not self.borders[r])
        for region in sorted(roots, key=lambda root: self.first[root]):
            if self.is_wrong(region):
                yield self.entry(region, "", "touches nothing")
                self.label[region] = -1

    def reason(self, region: int) -> str:
        """Why a region is wrong; empty if it is correct, or no neighbour has a label for it."""
        return self.is_wrong(region) if self.borders[region] else ""

    def rank(self, region: int, other: int) -> tuple[bool, int, int]:
        """Sort key: the neighbour whose label a region gets comes first."""
        last = self.fixed_doorways and self.is_doorway(other)
        return last, -self.borders[region][other], self.first[other]

    def is_doorway(self, region: int) -> bool:
        """Whether a region connects places."""
        return self.names[self.label[region]] == self.rules.doorway_label

    def is_wrong(self, region: int) -> str:
        """Why a region is wrong, whether or not it can be corrected."""
        rules = self.rules
        is_doorway = self.is_doorway(region)
        limit = rules.min_doorway_area_m2 if is_doorway else rules.min_area_m2
        if self.size[region] * self.cell_m2 < limit:
            return "too small"
        if not (is_doorway or self.has_room[region]):
            return "no room"
        idle = is_doorway and rules.doorways_join_two and len(self.borders[region]) < 2
        return "joins nothing" if idle else ""

    def relabel(self, region: int, label: int) -> list[int]:
        """Relabel a region and merge it with equal neighbours; the regions to test again."""
        group = {region, *(o for o in self.borders[region] if self.label[o] == label)}
        # The member with the most borders absorbs the others, so that it is never copied.
        root = max(group, key=lambda member: (len(self.borders[member]), -member))
        self.label[root] = label
        around = self.borders[root]
        touched = {root}
        for member in group - {root}:
            for other, length in self.borders[member].items():
                del self.borders[other][member]
                if other not in group:
                    around[other] = self.borders[other][root] = around.get(other, 0) + length
                    touched.add(other)
            self.borders[member] = {}
            self.parent[member] = root
            self.size[root] += self.size[member]
            self.has_room[root] |= self.has_room[member]
            self.first[root] = min(self.first[root], self.first[member])
        return sorted(touched)

    def final_labels(self) -> NDArray[np.int32]:
        """(R,) label of each of the original pieces."""
        final = np.empty(len(self.parent), np.int32)
        for region in range(len(self.parent)):
            root = region
            while self.parent[root] != root:
                root = self.parent[root]
            self.parent[region] = root
            final[region] = self.label[root]
        return final

    def entry(self, region: int, became: str, reason: str) -> Correction:
        cell, area_m2 = int(self.first_cell[self.first[region]]), self.size[region] * self.cell_m2
        was = self.names[self.label[region]]
        return Correction(divmod(cell, self.width), area_m2, was, became, reason)


def _first_cells(pieces: Components) -> NDArray[np.int64]:
    """(R,) flat index of the first cell of each piece."""
    firsts = []
    highest = np.int32(-1)
    for rows in bands_of_rows(pieces.piece.shape):
        flat = pieces.piece[rows].ravel()
        # A new maximum marks a first cell, because pieces are numbered in that order.
        record = np.maximum.accumulate(flat)
        new = np.flatnonzero(np.diff(record, prepend=highest) > 0)
        new = new[record[new] > highest]
        firsts.append(new + rows.start * pieces.piece.shape[1])
        highest = max(highest, record[-1])
    first: NDArray[np.int64] = np.concatenate(firsts)
    return first
