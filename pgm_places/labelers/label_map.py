"""Labelling a map with a stored model, whatever the resolutions of the two are."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pgm_places.errors import MapError
from pgm_places.graph.bands import bands_of_rows
from pgm_places.graph.layout import GridLayout
from pgm_places.inference.labeling import Labeling
from pgm_places.kernels.pages import return_freed
from pgm_places.kernels.threads import threads
from pgm_places.labelers.known_cells import KnownCells
from pgm_places.labelers.method import infer
from pgm_places.labelers.place_labeler import PlaceLabeler
from pgm_places.labelers.whole_map import (
    whole_doorways,
    whole_layout,
    whole_unentered,
    window_to_label,
)
from pgm_places.maps.coarsening import Coarsening, coarsen, refine, refined_shape
from pgm_places.maps.known_window import KnownWindow
from pgm_places.maps.occupancy_grid import OccupancyGrid
from pgm_places.progress import Progress, reported, staged, warn
from pgm_places.spaces.doorways import Doorways
from pgm_places.spaces.entered_options import EnteredOptions
from pgm_places.spaces.unentered import Unentered, find_unentered
from pgm_places.unary.kept_table import KeptTable

SAME_RESOLUTION = 0.02
"""Resolutions that differ by less than this share are taken as equal."""

# As many as of the largest map whose labelling is measured: 500 x 500 m with cells of 5 cm. A map
# that has as many itself is no slip of its maker; one of half a metre that is refined may be.
MAX_REFINED_CELLS = 100_000_000


def at_model_resolution(
    labeler: PlaceLabeler, grid: OccupancyGrid, *, max_cells: int | None = None
) -> tuple[OccupancyGrid, list[str]]:
    """The map with the model's cells, and what there is to say about it.

    Parameters
    ----------
    labeler : PlaceLabeler
    grid : OccupancyGrid
    max_cells : int, optional
        No map is refined to more cells than this; ``MAX_REFINED_CELLS`` by default.

    Raises
    ------
    MapError
        The map has no free cell, or none that is left at the model's resolution, or would have to
        be refined to too many cells.
    """
    if not grid.free.any():
        raise MapError(
            "the map has no free cell to label; look at its thresholds ('pgm-places doctor MAP')"
        )
    wanted = labeler.resolution_m_
    if abs(grid.resolution_m / wanted - 1) < SAME_RESOLUTION:
        return grid, []
    note = f"the map has cells of {grid.resolution_m:g} m, the model was trained at {wanted:g} m: "
    if wanted > grid.resolution_m:
        used = coarsen(grid, wanted)
        how = f"coarsened by {used.resolution_m / grid.resolution_m:g}"
        back = "labels are painted back"
    else:
        height, width = refined_shape(grid, wanted)
        if height * width > (most := max_cells or MAX_REFINED_CELLS):
            raise MapError(
                f"{note}its {grid.cells.size:,} cells would be split into {height * width:,}, more "
                f"than {most:,}; crop the map, use a model of a coarser resolution, or raise "
                "max_cells (label --max-cells) and expect it to take long"
            )
        used = refine(grid, wanted)
        how = f"split by {grid.resolution_m / used.resolution_m:g}"
        back = "each cell takes the most frequent label of its parts"
    n_free = int(np.count_nonzero(used.free))
    if n_free == 0:
        raise MapError(
            f"no free cell is left where the map's cells of {grid.resolution_m:g} m are joined to "
            f"the model's of {used.resolution_m:g} m; look at its thresholds ('pgm-places doctor "
            "MAP'), or use a model of a finer resolution"
        )
    note += (
        f"{how}, from {grid.cells.size:,} cells to {used.cells.size:,}, {n_free:,} of them free "
        f"to be labelled; {back}"
    )
    return used, [note]


ENTERED = EnteredOptions()


@dataclass(frozen=True, eq=False)
class LabelledPlaces:
    """A labelled map, on its own raster.

    Parameters
    ----------
    grid : OccupancyGrid
        The map as it came.
    labels : (H, W) int16
        Label index per free cell in the grid's order, -1 elsewhere and where nobody entered.
    layout : GridLayout
        The cells behind ``labeling``: of ``grid``, or of its coarsened form, ``layout.source``;
        without those that were never entered.
    labeling : Labeling
        What the method returned; of a map that was refined, brought back to its cells.
    label_names : tuple of str
    method : str
    warnings : tuple of str
    doorways : Doorways or None
        The accepted gates of the map, where the model knows spaces, for
        :func:`~pgm_places.topology.from_labels.topological_map`.
    unentered : Unentered or None
        Free space that was left without labels because it was never entered, if there is any.
    """

    grid: OccupancyGrid
    labels: NDArray[np.int16]
    layout: GridLayout
    labeling: Labeling
    label_names: tuple[str, ...]
    method: str
    warnings: tuple[str, ...] = ()
    doorways: Doorways | None = None
    unentered: Unentered | None = None

    def on_whole(self, grid: OccupancyGrid, window: KnownWindow) -> "LabelledPlaces":
        """The labels of a window of a map, which holds all that is known of it, on the map."""
        return replace(
            self,
            grid=grid,
            labels=window.paste(self.labels, -1),
            layout=whole_layout(self.layout, window, grid),
            doorways=whole_doorways(self.doorways, self.grid, window, grid),
            unentered=whole_unentered(self.unentered, window),
        )

    def on_map(self, values: ArrayLike, fill: Any) -> NDArray[Any]:
        """Values of the nodes (N, ...) on the map's raster (H, W, ...), ``fill`` elsewhere."""
        raster = _painted(self.grid, self.layout, values, fill)
        if self.layout.source is not self.grid and self.unentered is not None:
            raster[self.unentered.cells] = fill
        return raster

    def shares(self) -> dict[str, float]:
        """Square metres per label."""
        cell_m2 = self.grid.resolution_m**2
        counts = np.zeros(len(self.label_names), np.int64)
        for rows in bands_of_rows(self.grid.shape):
            band = self.labels[rows]
            counts += np.bincount(band[band >= 0], minlength=len(counts))
        return dict(zip(self.label_names, (counts * cell_m2).tolist(), strict=True))

    def summary(self) -> str:
        """One line: the area of each label and how the method ended."""
        areas = ", ".join(f"{name} {area:.1f} m²" for name, area in self.shares().items())
        status = self.labeling.status
        return f"{self.method}: {areas} ({status}: {status.meaning})"


def label_map(
    labeler: PlaceLabeler,
    grid: OccupancyGrid,
    *,
    method: str | None = None,
    known: ArrayLike | None = None,
    entered: EnteredOptions = ENTERED,
    features_of: Callable[[OccupancyGrid], KeptTable] | None = None,
    max_cells: int | None = None,
    n_threads: int | None = None,
    progress: Progress | None = None,
) -> LabelledPlaces:
    """The map labelled by a fitted labeler, on the map's own raster.

    Structured weights belong to one resolution. A map that is finer than the model is coarsened,
    labelled, and its labels are painted back; one that is coarser is refined, labelled, and each
    cell takes the most frequent label of its parts. A warning says so before the work begins.

    Parameters
    ----------
    labeler : PlaceLabeler
    grid : OccupancyGrid
    method : str, optional
        The labeler's default method if not given.
    known : (H, W) int, optional
        Index into ``labeler.label_names_`` of cells whose label is known, -1 elsewhere: every
        method keeps these labels and labels the other cells by them. Gates take part: one that is
        known to be a doorway, or not to be one, parts places accordingly.
    entered : EnteredOptions
        Free space that was never entered gets no label, unless the options ask for it or the label
        is known; all other cells have the same labels either way.
    features_of : callable, optional
        Gives the laser features of a map's free cells, where something is known of them from
        before: called with the map at the model's resolution.
    max_cells : int, optional
        No map is refined to more cells than this; 100 million by default.
    n_threads, progress
        Threads, and where stages are announced.

    Raises
    ------
    MapError
        The map has no free cell, or none that is left at the model's resolution, or would have to
        be refined to too many cells.
    LabelError
        Known labels that do not fit the map or the labels.
    """
    window = window_to_label(grid, labeler.resolution_m_)
    if window is not None:
        part = label_map(
            labeler,
            window.crop(grid),
            method=method,
            known=None if known is None else window.cut(np.asarray(known)),
            entered=entered,
            features_of=features_of,
            max_cells=max_cells,
            n_threads=n_threads,
            progress=progress,
        )
        return part.on_whole(grid, window)
    with threads(n_threads), reported(progress):
        used, warnings = at_model_resolution(labeler, grid, max_cells=max_cells)
        for message in warnings:
            warn(message)
        pinned = None
        if known is not None:
            pinned = KnownCells.of(known, grid, used, labeler.label_names_, labeler.learned_names)
        name = method or labeler.default_method
        layout, labeling, doorways = _labelled(labeler, used, name, pinned, features_of)
    places = on_own_raster(
        grid,
        used,
        layout,
        labeling,
        label_names=labeler.label_names_,
        method=name,
        warnings=warnings,
        doorways=doorways,
        known=pinned,
    )
    if entered.unentered:
        return places
    unentered = find_unentered(
        grid, entered.disc_radius_m, except_at=None if pinned is None else pinned.on_map >= 0
    )
    return _without(places, unentered) if unentered else places


def on_own_raster(
    grid: OccupancyGrid,
    used: OccupancyGrid,
    layout: GridLayout,
    labeling: Labeling,
    *,
    label_names: tuple[str, ...],
    method: str,
    warnings: Sequence[str] = (),
    doorways: Doorways | None = None,
    known: KnownCells | None = None,
) -> LabelledPlaces:
    """A map with labels on its own raster, from those of the cells ``layout`` of ``used``.

    ``used`` is the map at the model's resolution; known labels are painted over those found.
    """
    if used.resolution_m < grid.resolution_m:
        cells, layout = layout, GridLayout.of_map(grid)
        labeling = _brought_back(labeling, used, cells, layout)
    labels = _painted(grid, layout, labeling.labels.astype(np.int16), -1)
    if known is not None:
        np.copyto(labels, known.on_map, where=known.on_map >= 0)
    return LabelledPlaces(
        grid, labels, layout, labeling, label_names, method, tuple(warnings), doorways
    )


def _painted(grid: OccupancyGrid, layout: GridLayout, values: ArrayLike, fill: Any) -> NDArray[Any]:
    """Values of the nodes (N, ...) on the raster (H, W, ...) of the map itself."""
    raster = layout.to_raster(values, fill=fill)
    if layout.source is grid:  # nothing to paint: all nodes are free cells
        return raster
    return Coarsening.behind(layout, grid).paint(raster, fill)


def _without(places: LabelledPlaces, unentered: Unentered) -> LabelledPlaces:
    """A labelled map without the labels of what was never entered."""
    grid, layout = places.grid, places.layout
    entered = grid.free & ~unentered.cells
    if layout.source is not grid:
        assert isinstance(layout.source, OccupancyGrid)  # label_map made it from the map
        entered = Coarsening(grid, layout.source).holding(entered)
    keep = layout.from_raster(entered)
    return replace(
        places,
        labels=np.where(unentered.cells, np.int16(-1), places.labels),
        layout=layout.part(keep),
        labeling=places.labeling.part(np.flatnonzero(keep)),
        unentered=unentered,
    )


def _labelled(
    labeler: PlaceLabeler,
    grid: OccupancyGrid,
    name: str,
    known: KnownCells | None,
    features_of: Callable[[OccupancyGrid], KeptTable] | None,
) -> tuple[GridLayout, Labeling, Doorways | None]:
    """What a method makes of a map, and its doorways; the scores behind both are freed."""
    raster = None if known is None else known.on_cells
    method = labeler.method(name)
    graph, scores = labeler.scores(
        grid,
        methods=[name],
        lean=True,
        known=raster,
        own=None if features_of is None else features_of(grid),
    )
    layout = graph.grid_layout
    model, doorways = labeler.unary_model_.space, scores.doorways
    if doorways is None and model is not None and model.gates is not None:
        doorways = (scores.spaces or model.spaces(grid, known=raster)).doorways
    problem = labeler.problem_of(
        graph, scores, method, known=None if known is None else known.of_nodes(layout)
    )
    hall = scores.hall
    del scores
    return_freed()  # what scoring took: a huge map needs it for its labels
    with staged(f"labelling with {name}"):
        labeling = labeler.with_halls(infer(method.backend, problem), hall)
    if known is not None:
        labeling = known.kept(labeling, layout)
    return layout, labeling, doorways


def _brought_back(
    labeling: Labeling, refined: OccupancyGrid, cells: GridLayout, layout: GridLayout
) -> Labeling:
    """A refined map's labelling at the nodes of the map: most frequent label, mean probability.

    ``cells`` are those of the refined map, ``layout`` those of the map. Of labels that are equally
    frequent the first is taken. Score and bound stay those of the refined map.
    """
    assert isinstance(layout.source, OccupancyGrid)  # label_map made it from the map
    holders = Coarsening(refined, layout.source).holders(cells.cells_rc)
    node, n_nodes = layout.nodes_at(holders), layout.n_nodes

    def total(values: NDArray[Any] | None) -> NDArray[np.float64]:
        return np.asarray(np.bincount(node, values, n_nodes), np.float64)

    n_labels = int(labeling.labels.max()) + 1
    votes = np.stack([total(labeling.labels == k) for k in range(n_labels)], axis=1)
    beliefs = labeling.beliefs
    if beliefs is not None:
        means = [total(beliefs[:, k]) / total(None) for k in range(beliefs.shape[1])]
        beliefs = np.stack(means, axis=1).astype(beliefs.dtype)
    return replace(labeling, labels=votes.argmax(axis=1), beliefs=beliefs)
