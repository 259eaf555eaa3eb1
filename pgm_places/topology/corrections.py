"""The paper's heuristic corrections of regions (section 6.2), each one listed."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pgm_places.errors import InputError
from pgm_places.topology.borders import contacts
from pgm_places.topology.components import Components, connected_components

__all__ = ["Correction", "CorrectionRules", "correct_regions"]


@dataclass(frozen=True)
class CorrectionRules:
    """When a region is taken for a classification error.

    Parameters
    ----------
    min_area_m2 : float
        A room or corridor smaller than this is an error (the paper: 1 m²).
    min_doorway_area_m2 : float
        A doorway smaller than this is an error (the paper: 0.1 m²).
    doorways_join_two : bool
        Whether a doorway that touches fewer than two regions is an error.
    doorway_label : str
        Which label is the doorway.
    """

    min_area_m2: float = 1.0
    min_doorway_area_m2: float = 0.1
    doorways_join_two: bool = True
    doorway_label: str = "doorway"

    def __post_init__(self) -> None:
        for name in ("min_area_m2", "min_doorway_area_m2"):
            value = getattr(self, name)
            if not value >= 0:
                raise InputError(f"{name} must be at least 0 square metres, got {value}")


@dataclass(frozen=True)
class Correction:
    """One region that took the label of a neighbour.

    ``cell_rc`` is a cell of the region, ``reason`` is ``"too small"`` or ``"joins nothing"``.
    """

    cell_rc: tuple[int, int]
    area_m2: float
    was: str
    became: str
    reason: str


def correct_regions(
    labels: NDArray[np.int16],
    label_names: Sequence[str],
    resolution_m: float,
    rules: CorrectionRules | None = None,
) -> tuple[NDArray[np.int16], list[Correction]]:
    """The corrected label raster and what was corrected.

    The smallest wrong region goes first and takes the label of the neighbour that it shares its
    longest border with; then regions are formed anew, until none is wrong. A wrong region that
    touches no other keeps its label: there is nothing to take.

    Parameters
    ----------
    labels : (H, W) int16
        Label per cell, -1 for none.
    label_names : sequence of str
    resolution_m : float
        Side of a cell.
    rules : CorrectionRules, optional

    Every correction lowers the number of regions, so there is an end.
    """
    rules = rules or CorrectionRules()
    corrected = np.array(labels, np.int16)
    log: list[Correction] = []
    while True:
        changed = _one_pass(corrected, label_names, resolution_m**2, rules, log)
        if not changed:
            return corrected, log


def _one_pass(
    labels: NDArray[np.int16],
    names: Sequence[str],
    cell_m2: float,
    rules: CorrectionRules,
    log: list[Correction],
) -> bool:
    """Relabel wrong regions that do not touch each other, smallest first; whether any was."""
    pieces = connected_components(labels)
    borders = contacts(pieces.piece, pieces.count).matrix(pieces.count)
    n_neighbours = np.diff(borders.indptr)
    wrong = _reasons(pieces, n_neighbours, names, cell_m2, rules)
    first_cell = _first_cells(pieces)
    touched: set[int] = set()
    new_label = pieces.label.copy()
    for region in sorted(wrong, key=lambda r: (pieces.size[r], r)):
        start, stop = borders.indptr[region], borders.indptr[region + 1]
        around = borders.indices[start:stop]
        # A neighbour that changes in this pass may merge with this one: decide in the next pass.
        if not len(around) or region in touched or touched.intersection(around.tolist()):
            continue
        lengths = borders.data[start:stop]
        best = int(around[np.lexsort((around, -lengths))[0]])
        new_label[region] = pieces.label[best]
        touched.add(region)
        row, column = divmod(int(first_cell[region]), labels.shape[1])
        log.append(
            Correction(
                (row, column),
                float(pieces.size[region] * cell_m2),
                names[pieces.label[region]],
                names[pieces.label[best]],
                wrong[region],
            )
        )
    if not touched:
        return False
    inside = pieces.piece >= 0
    labels[inside] = new_label[pieces.piece[inside]]
    return True


def _reasons(
    pieces: Components,
    n_neighbours: NDArray[np.int64],
    names: Sequence[str],
    cell_m2: float,
    rules: CorrectionRules,
) -> dict[int, str]:
    """The wrong regions that touch another, and why they are wrong."""
    is_doorway = np.array([name == rules.doorway_label for name in names], np.bool_)[pieces.label]
    area = pieces.size * cell_m2
    limit = np.where(is_doorway, rules.min_doorway_area_m2, rules.min_area_m2)
    too_small = area < limit
    idle = is_doorway & (n_neighbours < 2) & rules.doorways_join_two
    return {
        int(region): "too small" if too_small[region] else "joins nothing"
        for region in np.flatnonzero((too_small | idle) & (n_neighbours > 0))
    }


def _first_cells(pieces: Components) -> NDArray[np.int64]:
    flat = pieces.piece.ravel()
    inside = np.flatnonzero(flat >= 0)[::-1]
    first = np.zeros(pieces.count, np.int64)
    first[flat[inside]] = inside
    return first
