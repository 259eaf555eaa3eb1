"""Label a map with a stored model, whatever the two resolutions are."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pgm_places.errors import MapError
from pgm_places.graph.layout import GridLayout
from pgm_places.inference.labeling import Labeling
from pgm_places.labelers.place_labeler import PlaceLabeler
from pgm_places.maps.coarsening import coarsen, coarsening_factor
from pgm_places.maps.occupancy_grid import OccupancyGrid
from pgm_places.progress import Progress, Silent

__all__ = ["LabelledPlaces", "label_map"]

SAME_RESOLUTION = 0.02
"""Resolutions that differ by less than this share are taken as equal."""


@dataclass(frozen=True, eq=False)
class LabelledPlaces:
    """A labelled map, on its own raster.

    Parameters
    ----------
    grid : OccupancyGrid
        The map as it came.
    labels : (H, W) int16
        Label index per free cell in the grid's order, -1 elsewhere.
    layout : GridLayout
        The cells behind ``labeling``: of ``grid``, or of its coarsened form.
    labeling : Labeling
        What the method returned.
    label_names : tuple of str
    method : str
    warnings : tuple of str
    """

    grid: OccupancyGrid
    labels: NDArray[np.int16]
    labelled_grid: OccupancyGrid
    layout: GridLayout
    labeling: Labeling
    label_names: tuple[str, ...]
    method: str
    warnings: tuple[str, ...] = ()

    def shares(self) -> dict[str, float]:
        """Square metres per label."""
        cell_m2 = self.grid.resolution_m**2
        counts = np.bincount(self.labels[self.labels >= 0], minlength=len(self.label_names))
        return {
            name: float(count * cell_m2)
            for name, count in zip(self.label_names, counts, strict=True)
        }

    def summary(self) -> str:
        """One line: the area of each label and how the method ended."""
        areas = ", ".join(f"{name} {area:.1f} m²" for name, area in self.shares().items())
        return f"{self.method}: {areas} ({self.labeling.status})"


def label_map(
    labeler: PlaceLabeler,
    grid: OccupancyGrid,
    *,
    method: str | None = None,
    n_threads: int | None = None,
    progress: Progress | None = None,
) -> LabelledPlaces:
    """The map labelled by a fitted labeler, on the map's own raster.

    Structured weights belong to one resolution. A map that is finer than the model by a whole
    factor is coarsened, labelled, and painted back; any other difference is labelled as it is,
    with a warning.

    Raises
    ------
    MapError
        The map has no free cell.
    """
    progress = progress or Silent()
    if not grid.free.any():
        raise MapError(
            "the map has no free cell to label; look at its thresholds ('pgm-places doctor MAP')"
        )
    used, warnings = _at_model_resolution(labeler, grid)
    name = method or labeler.default_method
    layout, labeling = _labelled(labeler, used, name, n_threads, progress)
    raster = layout.to_raster(labeling.labels.astype(np.int16), fill=-1)
    if used is not grid:
        raster = _painted_back(raster, used, grid)
    return LabelledPlaces(
        grid, raster, used, layout, labeling, tuple(labeler.label_names), name, tuple(warnings)
    )


def _labelled(
    labeler: PlaceLabeler,
    grid: OccupancyGrid,
    name: str,
    n_threads: int | None,
    progress: Progress,
) -> tuple[GridLayout, Labeling]:
    """What a method makes of a map; the scores it is made from are let go of."""
    problem = labeler.problem(grid, method=name, n_threads=n_threads, progress=progress)
    with progress.stage(f"labelling with {name}"):
        labeling = labeler.method(name).backend.infer(problem)
    layout = problem.graph.layout
    assert isinstance(layout, GridLayout)  # problem() made it from a grid
    return layout, labeling


def _at_model_resolution(
    labeler: PlaceLabeler, grid: OccupancyGrid
) -> tuple[OccupancyGrid, Sequence[str]]:
    wanted = labeler.resolution_m
    if wanted is None or abs(grid.resolution_m / wanted - 1) < SAME_RESOLUTION:
        return grid, []
    if wanted > grid.resolution_m:
        note = (
            f"the map has cells of {grid.resolution_m:g} m, the model learned at {wanted:g} m: "
            f"coarsened by {float(coarsening_factor(grid, wanted)):g} and painted back"
        )
        return coarsen(grid, wanted), [note]
    note = (
        f"the map has cells of {grid.resolution_m:g} m, the model learned at {wanted:g} m; "
        "expect worse labels, or train a model at this resolution"
    )
    return grid, [note]


def _painted_back(
    raster: NDArray[np.int16], coarse: OccupancyGrid, grid: OccupancyGrid
) -> NDArray[np.int16]:
    """Coarse labels on the fine raster; free cells without one take the nearest label."""
    from scipy.ndimage import distance_transform_edt

    # A fine cell takes the label of the coarse cell that holds its centre.
    ratio = grid.resolution_m / coarse.resolution_m
    rows, columns = (
        np.minimum(((np.arange(size) + 0.5) * ratio).astype(np.int64), limit - 1)
        for size, limit in zip(grid.shape, coarse.shape, strict=True)
    )
    fine = raster[np.ix_(rows, columns)]
    open_cells = grid.free & (fine < 0)
    if open_cells.any() and (fine >= 0).any():
        nearest = distance_transform_edt(fine < 0, return_distances=False, return_indices=True)
        fine = np.where(open_cells, fine[tuple(nearest)], fine)
    painted: NDArray[np.int16] = np.where(grid.free, fine, -1).astype(np.int16)
    return painted
