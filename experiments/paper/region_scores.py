"""How well regions and their connections match the ground truth."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pgm_places._checks import label_raster
from pgm_places.errors import InputError
from pgm_places.maps.occupancy_grid import OccupancyGrid
from pgm_places.topology.topological_map import TopologicalMap

MOST = 0.5
"""A region is found by one that covers more than this share of it, or is covered by more."""

SOME_DOORWAY = 0.1
"""Share of a true doorway that a found one must cover: the ends of doorways are arbitrary."""


@dataclass(frozen=True)
class ClassScore:
    """Regions of one class.

    Parameters
    ----------
    n_true, n_found : int
        Regions of the ground truth, and of the map that is scored.
    hit : int
        True regions matched one to one: a found region of the class covers most of the true one,
        most of its labelled cells are inside it, and it covers most of no other true region. A
        doorway is hit if a found doorway covers at least a tenth of it.
    missed : int
        True regions that no found region of the class covers for the most part (for doorways, to a
        tenth).
    merged : int
        True regions that share a found region with another true region (under-segmentation).
    split : int
        True regions with a second found region inside (over-segmentation).
    invented : int
        Found regions mostly outside the true regions of their class.
    """

    n_true: int
    n_found: int
    hit: int
    missed: int
    merged: int
    split: int
    invented: int

    @property
    def recall(self) -> float:
        """Share of the true regions that were hit; NaN if there are none."""
        return self.hit / self.n_true if self.n_true else float("nan")

    @property
    def precision(self) -> float:
        """Share of the found regions that were not invented; NaN if there are none."""
        return 1 - self.invented / self.n_found if self.n_found else float("nan")


@dataclass(frozen=True)
class RegionScores:
    """Scores of a topological map.

    Parameters
    ----------
    classes : dict of str to ClassScore
    purity : float
        Share of the labelled cells that belong to the true region that makes up the largest part of
        their found region.
    connections_true, connections_found : int
        Pairs of places joined by a doorway or a common border; doorways are not places here.
    connections_hit, connections_missed, connections_invented : int
        Each found place stands for the true place that it is mostly inside.
    """

    classes: dict[str, ClassScore]
    purity: float
    connections_true: int
    connections_found: int
    connections_hit: int
    connections_missed: int
    connections_invented: int


def score_regions(
    topology: TopologicalMap, truth: TopologicalMap, *, window: ArrayLike | None = None
) -> RegionScores:
    """The scores of a topological map against that of the ground truth, on the same raster.

    Cells without a true region do not count.

    Parameters
    ----------
    topology, truth : TopologicalMap
        Both on the same grid; ``fill_labels`` closes the gaps in hand-made labels.
    window : (H, W) bool, optional
        The part of the map to score: true regions mostly inside it, and found regions that overlap
        these or are mostly inside it.

    Raises
    ------
    InputError
        Rasters of different shapes.
    """
    if topology.grid.shape != truth.grid.shape:
        raise InputError(
            f"both maps must have the same shape, got {topology.grid.shape} and {truth.grid.shape}"
        )
    true_ids = _inside(truth, window)
    found_ids = _inside(topology, window)
    table = _Overlaps(topology, truth)
    true_names = {r.id: r.label for r in truth.regions if r.id in true_ids}
    found_names = {r.id: r.label for r in topology.regions if r.id in found_ids}
    classes = {
        label: _class_score(
            table,
            [k for k, name in true_names.items() if name == label],
            [k for k, name in found_names.items() if name == label],
            is_doorway=label == truth.doorway_label,
        )
        for label in truth.label_names
    }
    home = {k: table.home(k) for k in found_ids}
    wanted = {
        frozenset((a, b)) for a, b in truth.place_graph.edges() if a in true_ids and b in true_ids
    }
    got = set()
    for a, b in topology.place_graph.edges():
        pair = frozenset((home.get(a, 0), home.get(b, 0)))
        if len(pair) == 2 and 0 not in pair and all(k in true_names for k in pair):
            got.add(pair)
    got = {p for p in got if all(true_names[k] != truth.doorway_label for k in p)}
    return RegionScores(
        classes,
        table.purity(found_ids),
        len(wanted),
        len(got),
        len(wanted & got),
        len(wanted - got),
        len(got - wanted),
    )


class _Overlaps:
    """Common cells of found (rows) and true (columns) regions, by id; 0 means none."""

    def __init__(self, found: TopologicalMap, truth: TopologicalMap) -> None:
        n_found = max((r.id for r in found.regions), default=0) + 1
        n_true = max((r.id for r in truth.regions), default=0) + 1
        keys = found.region.astype(np.int64) * n_true + truth.region
        counts = np.bincount(keys.ravel(), minlength=n_found * n_true)
        self.cells = counts.reshape(n_found, n_true)
        self.labelled = self.cells[:, 1:].sum(axis=1)  # of each found region
        self.true_size = self.cells.sum(axis=0)
        self.size = self.cells.sum(axis=1)

    def home(self, found: int) -> int:
        """The true region that a found one is mostly inside, 0 if it is unlabelled."""
        row = self.cells[found, 1:]
        return int(row.argmax()) + 1 if row.size and row.max() > 0 else 0

    def purity(self, found: set[int]) -> float:
        """Share of the labelled cells in their region's home."""
        chosen = sorted(found)
        total = self.labelled[chosen].sum()
        if not total or self.cells.shape[1] < 2:
            return float("nan")
        return float(self.cells[chosen, 1:].max(axis=1).sum() / total)


def _class_score(
    table: _Overlaps, true: list[int], found: list[int], *, is_doorway: bool
) -> ClassScore:
    cells = table.cells[np.ix_(found, true)]
    holds = cells / np.maximum(table.true_size[true], 1)[None, :]  # share of the true region
    lies = cells / np.maximum(table.labelled[found], 1)[:, None]  # share of the found region
    covered = holds > (SOME_DOORWAY if is_doorway else MOST)
    together = covered.sum(axis=1) > 1
    merged = (covered & together[:, None]).any(axis=0)
    own = covered & ~together[:, None] & (is_doorway | (lies > MOST))
    outside = cells.sum(axis=1) <= (0 if is_doorway else MOST * table.size[found])
    return ClassScore(
        n_true=len(true),
        n_found=len(found),
        hit=int(own.any(axis=0).sum()),
        missed=int((~covered.any(axis=0)).sum()),
        merged=int(merged.sum()),
        split=int(((lies > MOST).sum(axis=0) > 1).sum()),
        invented=int(outside.sum()),
    )


def _inside(topology: TopologicalMap, window: ArrayLike | None) -> set[int]:
    """Ids of the regions mostly inside a window."""
    if window is None:
        return {region.id for region in topology.regions}
    mask = np.asarray(window, np.bool_)
    if mask.shape != topology.grid.shape:
        raise InputError(f"window must have shape {topology.grid.shape}, got {mask.shape}")
    highest = max((region.id for region in topology.regions), default=0)
    size = np.bincount(topology.region.ravel(), minlength=highest + 1)
    inside = np.bincount(topology.region[mask], minlength=highest + 1)
    return {r.id for r in topology.regions if 2 * inside[r.id] > size[r.id]}


def fill_labels(
    grid: OccupancyGrid, labels: ArrayLike, label_names: Sequence[str], *, reach_m: float = 0.3
) -> NDArray[np.int16]:
    """Labels with the gaps between hand-labelled regions closed.

    A free cell without a label takes the label of the nearest labelled cell, if that is at most
    ``reach_m`` away.
    """
    from scipy.ndimage import distance_transform_edt

    raster = label_raster("labels", labels, grid.shape, n_labels=len(label_names))
    open_cells = grid.free & (raster < 0)
    if not open_cells.any() or not (raster >= 0).any():
        return raster
    distance, nearest = distance_transform_edt(raster < 0, return_indices=True)
    near = open_cells & (distance * grid.resolution_m <= reach_m)
    filled = raster.copy()
    filled[near] = raster[tuple(nearest)][near]
    return filled
