"""LabelledPlaces: a labelled map at its original resolution."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pgm_places import plotting
from pgm_places._arguments import public
from pgm_places._checks import freeze
from pgm_places.errors import InputError, MapError
from pgm_places.graph.bands import bands_of_rows
from pgm_places.graph.layout import GridLayout
from pgm_places.inference.labeling import Labeling, normalized_entropy
from pgm_places.labelers.known_cells import KnownCells
from pgm_places.labelers.place_labeler import PlaceLabeler
from pgm_places.maps.coarsening import Coarsening, coarsen, coarsening_factor, refine, refined_shape
from pgm_places.maps.occupancy_grid import UNKNOWN, OccupancyGrid
from pgm_places.maps.windows import KnownWindow
from pgm_places.plotting import Plotted, axes_or_new
from pgm_places.spaces.doorways import Doorways
from pgm_places.spaces.entered_options import EnteredOptions
from pgm_places.spaces.unentered import Unentered, find_unentered

if TYPE_CHECKING:
    from matplotlib.axes import Axes


SAME_RESOLUTION = 0.02
"""Resolutions that differ by less than this share count as equal."""

# The cells of the largest map in the benchmarks: 500 x 500 m with cells of 5 cm. A refined map
# with more cells probably has a wrong resolution.
MAX_REFINED_CELLS = 100_000_000


LARGEST_CELLS_M = 1.0


def at_model_resolution(
    labeler: PlaceLabeler, grid: OccupancyGrid, *, max_cells: int | None = None
) -> tuple[OccupancyGrid, list[str]]:
    """The map at the model's resolution, refined to ``max_cells`` at most, and notes on resampling.

    MapError if no cell is free, or cells are too large to show walls or to be refined.
    """
    if not grid.free.any():
        raise MapError(
            "the map has no free cell to label; look at its thresholds ('pgm-places doctor MAP')"
        )
    wanted = labeler.resolution_m_
    if grid.resolution_m > LARGEST_CELLS_M:
        raise MapError(
            f"the map has cells of {grid.resolution_m:g} m, which show neither walls nor doorways; "
            "correct its resolution (metres per cell)"
        )
    if abs(grid.resolution_m / wanted - 1) < SAME_RESOLUTION:
        return grid, []
    if wanted > grid.resolution_m:
        used = coarsen(grid, wanted)
        back = "labels are written at the original resolution"
    else:
        height, width = refined_shape(grid, wanted)
        if height * width > (most := max_cells or MAX_REFINED_CELLS):
            raise MapError(
                f"the map has cells of {grid.resolution_m:g} m, the model needs {wanted:g} m: its "
                f"{grid.cells.size:,} cells would be split into {height * width:,}, more than "
                f"{most:,}; crop the map, use a model of a coarser resolution, or raise max_cells "
                "(label --max-cells), which will take long"
            )
        used = refine(grid, wanted)
        back = "each cell gets the most frequent label of its parts"
    n_free = int(np.count_nonzero(used.free))
    if n_free == 0:
        raise MapError(
            f"no free cell is left after resampling the map from {grid.resolution_m:g} m to "
            f"{used.resolution_m:g} m cells for the model; look at its thresholds ('pgm-places "
            "doctor MAP'), or use a model of a finer resolution"
        )
    note = (
        f"resampled from {grid.resolution_m:g} m to {used.resolution_m:g} m cells for the model "
        f"({n_free:,} free cells); {back}"
    )
    return used, [note]


@dataclass(frozen=True, eq=False)
class LabelledCells:
    """The labels (H, W) of a map's cells, with all other inputs of its topological map.

    ``beliefs`` (N, K) and ``hall`` (N,) are of the cells of ``layout``, possibly coarser.
    """

    grid: OccupancyGrid
    labels: NDArray[np.int16]
    label_names: Sequence[str]
    beliefs: NDArray[np.floating[Any]] | None = None
    layout: GridLayout | None = None
    doorways: Doorways | None = None
    hall: NDArray[np.floating[Any]] | None = None


@public
@dataclass(frozen=True, eq=False)
class LabelledPlaces(Plotted):
    """A labelled map, at its original resolution.

    Parameters
    ----------
    grid : OccupancyGrid
        The original map.
    labels : (H, W) int16
        Label index per free cell in the grid's order, -1 elsewhere and in unreachable space.
    layout : GridLayout
        The cells of ``labeling``, of ``grid`` or its coarsened version ``layout.source``, without
        unreachable ones.
    labeling : Labeling
        The result of the method; for a refined map, converted to the original cells.
    label_names : tuple of str
    method : str
    warnings : tuple of str
    doorways : Doorways or None
        The accepted gates of the map, if the model uses space features, for
        :func:`~pgm_places.topology.from_labels.topological_map`.
    unentered : Unentered or None
        Unreachable space, which has no labels, if there is any.
    hall : (N,) float32 or None
        The probability that each node is in a hall, which is part of the probability of
        ``corridor``; for models that distinguish halls and show them as corridors.
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
    hall: NDArray[np.float32] | None = None

    @property
    def cells(self) -> LabelledCells:
        """The labels with all other inputs of the topological map."""
        beliefs = self.labeling.beliefs
        return LabelledCells(
            self.grid,
            self.labels,
            self.label_names,
            beliefs,
            self.layout,
            self.doorways,
            self.hall,
        )

    def on_whole(self, grid: OccupancyGrid, window: KnownWindow) -> "LabelledPlaces":
        """Extend the labels of a window, which contains all known cells, to the map."""
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

    def plot(
        self,
        ax: "Axes | None" = None,
        *,
        show: Literal["labels", "probability", "uncertainty"] = "labels",
    ) -> "Axes":
        """Draw the map with its labels, their probability, or how uncertain they are.

        ``probability`` is of the assigned label; ``uncertainty`` is the entropy of the beliefs as a
        share of ``log K``. Without axes, new ones are made. InputError if the method has no beliefs
        to show.
        """
        beliefs = self.labeling.beliefs
        if show != "labels" and beliefs is None:
            raise InputError(f"{self.method} has no beliefs, so its {show} is unknown")
        ax = self.grid.plot(axes_or_new(ax))
        if show == "labels" or beliefs is None:
            plotting.draw_labels(ax, self.labels, self.label_names, self.grid.frame)
            return ax
        if show == "probability":
            values = np.take_along_axis(beliefs, self.labeling.labels[:, None], axis=1)[:, 0]
        else:
            values = normalized_entropy(beliefs)
        gradient = "entropy" if show == "uncertainty" else show
        on_map = self.on_map(values.astype(np.float32), np.nan)
        plotting.draw_values(ax, on_map, self.grid.frame, gradient=gradient, title=show)
        return ax

    def shares(self) -> dict[str, float]:
        """Square metres per label."""
        cell_m2 = self.grid.resolution_m**2
        counts = np.zeros(len(self.label_names), np.int64)
        for rows in bands_of_rows(self.grid.shape):
            band = self.labels[rows]
            counts += np.bincount(band[band >= 0], minlength=len(counts))
        return dict(zip(self.label_names, (counts * cell_m2).tolist(), strict=True))

    def summary(self) -> str:
        """One line: the area of each label, and the status if the method did not end as usual."""
        areas = ", ".join(f"{name} {area:.1f} m²" for name, area in self.shares().items())
        return f"{self.method}: {areas}{self.labeling.status.note}"


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
    entered: EnteredOptions,
    hall: NDArray[np.float32] | None = None,
) -> LabelledPlaces:
    """A map with labels at its original resolution, from the labels of ``used``'s cells.

    Observed labels override all others. Unreachable space has labels only if ``entered`` or
    observed.
    """
    if used.resolution_m < grid.resolution_m:
        cells, layout = layout, GridLayout.of_map(grid)
        if hall is not None:
            hall = _means(hall, _nodes_of_parts(used, cells, layout), layout)
        labeling = _brought_back(labeling, used, cells, layout)
    labels = _painted(grid, layout, labeling.labels.astype(np.int16), -1)
    if known is not None:
        np.copyto(labels, known.on_map, where=known.on_map >= 0)
    places = LabelledPlaces(
        grid, labels, layout, labeling, label_names, method, tuple(warnings), doorways, hall=hall
    )
    if entered.unentered:
        return places
    except_at = None if known is None else known.on_map >= 0
    unentered = find_unentered(grid, entered.disc_radius_m, except_at=except_at)
    return _without(places, unentered) if unentered else places


def _painted(grid: OccupancyGrid, layout: GridLayout, values: ArrayLike, fill: Any) -> NDArray[Any]:
    """Values of the nodes (N, ...) on the raster (H, W, ...) of the original map."""
    raster = layout.to_raster(values, fill=fill)
    if layout.source is grid:  # all nodes are cells of the original map
        return raster
    return Coarsening.behind(layout, grid).paint(raster, fill)


def _without(places: LabelledPlaces, unentered: Unentered) -> LabelledPlaces:
    """A labelled map without the labels of unreachable space."""
    grid, layout = places.grid, places.layout
    entered = grid.free & ~unentered.cells
    if layout.source is not grid:
        assert isinstance(layout.source, OccupancyGrid)  # made from the map
        entered = Coarsening(grid, layout.source).holding(entered)
    keep = layout.from_raster(entered)
    return replace(
        places,
        labels=np.where(unentered.cells, np.int16(-1), places.labels),
        layout=layout.part(keep),
        labeling=places.labeling.part(np.flatnonzero(keep)),
        hall=None if places.hall is None else places.hall[keep],
        unentered=unentered,
    )


def _brought_back(
    labeling: Labeling, refined: OccupancyGrid, cells: GridLayout, layout: GridLayout
) -> Labeling:
    """A refined map's labelling on the original cells: most frequent label, mean probability.

    ``cells`` is the refined layout, ``layout`` the original one. Ties go to the first label.
    """
    node = _nodes_of_parts(refined, cells, layout)
    n_labels = int(labeling.labels.max()) + 1
    votes = [np.bincount(node, labeling.labels == k, layout.n_nodes) for k in range(n_labels)]
    beliefs = labeling.beliefs
    if beliefs is not None:
        beliefs = np.stack([_means(column, node, layout) for column in beliefs.T], axis=1)
    return replace(labeling, labels=np.stack(votes, axis=1).argmax(axis=1), beliefs=beliefs)


def _nodes_of_parts(
    refined: OccupancyGrid, cells: GridLayout, layout: GridLayout
) -> NDArray[np.integer]:
    """(n,) the original map's node of each refined cell."""
    assert isinstance(layout.source, OccupancyGrid)  # made from the map
    return layout.nodes_at(Coarsening(refined, layout.source).holders(cells.cells_rc))


def _means(
    values: NDArray[np.floating[Any]], node: NDArray[np.integer], layout: GridLayout
) -> NDArray[np.floating[Any]]:
    """(N,) the mean of values (n,) at each node."""
    sums, counts = np.bincount(node, values, layout.n_nodes), np.bincount(node)
    return np.asarray(sums / counts, values.dtype)


def window_to_label(grid: OccupancyGrid, resolution_m: float) -> KnownWindow | None:
    """The known window of a map, in blocks of the complete map's coarsening; None for the map."""
    is_finer = grid.resolution_m < resolution_m
    multiple = coarsening_factor(grid, resolution_m).numerator if is_finer else 1
    return KnownWindow.of(grid, multiple=multiple)


def whole_layout(layout: GridLayout, window: KnownWindow, grid: OccupancyGrid) -> GridLayout:
    """The nodes of a window's layout on the raster of the complete map or its coarsened version."""
    source = layout.source
    if layout.shape == window.part_shape:
        return GridLayout.of_mask(freeze(window.paste(layout.mask(), False)), grid)
    assert isinstance(source, OccupancyGrid)
    coarse = window.coarser(source.resolution_m / grid.resolution_m)
    cells = coarse.paste(source.cells, UNKNOWN)
    complete = OccupancyGrid(cells, source.resolution_m, grid.origin_xy_m, grid.yaw_rad)
    return GridLayout.of_mask(freeze(coarse.paste(layout.mask(), False)), complete)


def whole_doorways(
    doorways: Doorways | None, part: OccupancyGrid, window: KnownWindow, grid: OccupancyGrid
) -> Doorways | None:
    """Doorways of a window, with the places between them on the raster of the complete map."""
    if doorways is None:
        return None
    place = window.paste(doorways.place_on(part), -1)
    return replace(doorways, grid=grid, place=place)


def whole_unentered(unentered: Unentered | None, window: KnownWindow) -> Unentered | None:
    """Unreachable space of a window on the raster of the complete map."""
    if unentered is None:
        return None
    return replace(unentered, cells=np.asarray(window.paste(unentered.cells, False)))
