"""Reliability: how often cells, places and doors of one confidence are right."""

from dataclasses import dataclass, field
from itertools import pairwise

import numpy as np
from numpy.typing import ArrayLike, NDArray

from experiments.known_maps import DOORWAY, KnownMap
from experiments.robot_maps.sources import Found
from pgm_places.maps.components import connected_components
from pgm_places.spaces.doorways import match_gates

EDGES = (0.0, 0.5, 0.6, 0.7, 0.8, 0.9, 0.95, 1.0)
_LEAST_PLACE_M2, _LEAST_JUDGED = 1.0, 0.5


@dataclass
class Bins:
    """Confidences and what of them was right, added up by intervals between ``EDGES``.

    Attributes
    ----------
    number, confidence, right : (B,) float64
        Sums over what fell into each.
    """

    number: NDArray[np.float64] = field(default_factory=lambda: np.zeros(len(EDGES) - 1))
    confidence: NDArray[np.float64] = field(default_factory=lambda: np.zeros(len(EDGES) - 1))
    right: NDArray[np.float64] = field(default_factory=lambda: np.zeros(len(EDGES) - 1))

    def add(self, confidence: ArrayLike, right: ArrayLike) -> None:
        """Add values (n,); what is right may be a share."""
        values = np.asarray(confidence, np.float64)
        which = np.searchsorted(EDGES[1:-1], values, side="right")
        n = len(self.number)
        self.number += np.bincount(which, minlength=n)
        self.confidence += np.bincount(which, values, n)
        self.right += np.bincount(which, np.asarray(right, np.float64), n)

    @property
    def error(self) -> float:
        """The expected calibration error (Guo et al. 2017): mean distance of both, by number."""
        return float(np.abs(self.confidence - self.right).sum() / max(self.number.sum(), 1.0))


class Reliability:
    """The bins of cells, of places (the mean of their cells), and of accepted gates.

    A place is a connected piece of one label other than doorway, of at least 1 m2, at least half of
    which is judged; what is right of it is the share of its judged cells. Cells that are halls in
    truth are left out of ``no_halls``.
    """

    def __init__(self) -> None:
        self.cells, self.no_halls, self.places, self.doors = Bins(), Bins(), Bins(), Bins()

    def add(self, known: KnownMap, found: Found) -> None:
        """Add a map whose labelling has beliefs."""
        item, doorways, beliefs = known.item, found.doorways, found.labeling.beliefs
        assert beliefs is not None  # a map that is compared by confidence
        on_cells = found.labels >= 0
        label, truth = found.labels[on_cells], item.labels[on_cells]
        confidence = np.take_along_axis(beliefs, label[:, np.newaxis], axis=1)[:, 0]
        right, judged = label == truth, truth >= 0
        self.cells.add(confidence[judged], right[judged])
        no_hall = judged if known.halls is None else judged & ~known.halls[on_cells]
        self.no_halls.add(confidence[no_hall], right[no_hall])
        pieces = connected_components(np.where(found.labels == DOORWAY, -1, found.labels))
        piece = pieces.piece[on_cells]
        inside, n = piece >= 0, pieces.count
        total = np.bincount(piece[inside], confidence[inside], n)
        n_judged = np.bincount(piece[inside & judged], minlength=n)
        n_right = np.bincount(piece[inside & judged & right], minlength=n)
        counts = (pieces.size * item.grid.resolution_m**2 >= _LEAST_PLACE_M2) & (
            n_judged >= _LEAST_JUDGED * pieces.size
        )
        self.places.add((total / pieces.size)[counts], (n_right / np.maximum(n_judged, 1))[counts])
        if doorways is not None and len(doorways):
            match = match_gates(doorways.gates, item.grid, item.labels, DOORWAY)
            some = match.known | match.is_doorway
            self.doors.add(doorways.probability[some], match.is_doorway[some])

    def table(self) -> str:
        """Markdown: by confidence, the mean confidence and what was right in percent."""
        parts = {
            "cells": self.cells,
            "without halls": self.no_halls,
            "places": self.places,
            "doors": self.doors,
        }
        lines = [f"| confidence | {' | '.join(parts)} |", "|---" * (len(parts) + 1) + "|"]
        for k, (low, high) in enumerate(pairwise(EDGES)):
            entries = [_entry(bins, k) for bins in parts.values()]
            lines.append(f"| {low:g} to {high:g} | {' | '.join(entries)} |")
        errors = " | ".join(f"**{100 * bins.error:.1f}**" for bins in parts.values())
        return "\n".join([*lines, f"| error | {errors} |"])


def _entry(bins: Bins, k: int) -> str:
    n = bins.number[k]
    if not n:
        return "-"
    return f"{100 * bins.confidence[k] / n:.1f}: {100 * bins.right[k] / n:.1f} ({int(n)})"
