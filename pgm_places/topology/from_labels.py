"""A topological map from the labels of a map's cells."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pgm_places._arguments import public
from pgm_places._checks import finite_array, freeze, label_raster
from pgm_places.errors import InputError
from pgm_places.graph.bands import bands_of_rows
from pgm_places.graph.layout import GridLayout
from pgm_places.kernels.lazy_memory import drop_pages
from pgm_places.maps._blocks import factor_between
from pgm_places.maps.coarsening import Coarsening
from pgm_places.maps.components import Components, connected_components, squared_clearance
from pgm_places.maps.occupancy_grid import OccupancyGrid
from pgm_places.maps.windows import KnownWindow
from pgm_places.options import AtLeastZero
from pgm_places.spaces.doorways import Doorways
from pgm_places.spaces.gates import Gate
from pgm_places.topology.corrections import Correction, correct_regions
from pgm_places.topology.cuts import Line, cut_pieces
from pgm_places.topology.gate_pieces import GatePieces, pieces_between
from pgm_places.topology.place_ids import PlaceIds, name_places, number_on
from pgm_places.topology.regions import connections_of, deepest_cells, describe_regions
from pgm_places.topology.rules import CorrectionRules
from pgm_places.topology.topological_map import TopologicalMap


def mean_probabilities(
    pieces: Components,
    beliefs: ArrayLike,
    layout: GridLayout | None,
    n_labels: int,
    grid: OccupancyGrid,
) -> NDArray[np.float64]:
    """(P, K) mean probability of each label in each piece, NaN for pieces without probabilities.

    ``beliefs`` (N, K): probabilities of the labels at the nodes of ``layout``. ``layout``: the
    cells of ``beliefs``: those of the map or of a coarser version of it. ``n_labels``: K. ``grid``:
    the map of the pieces.

    InputError: there are beliefs but no layout. MapError: the layout belongs to another map.
    """
    if layout is None:
        raise InputError("beliefs need the layout of their nodes; pass layout as well")
    array = finite_array("beliefs", beliefs, (layout.n_nodes, n_labels), dtype=np.float32)
    coarsening = Coarsening.behind(layout, grid)
    counts, sums = np.zeros(pieces.count, np.int64), np.zeros((pieces.count, n_labels))
    for rows in bands_of_rows(grid.shape):
        piece = pieces.piece[rows]
        if coarsening.factor == 1:
            node = layout.nodes_in(rows)
        else:
            node = coarsening.paint(layout.node_of_cell, -1, rows=rows)
        known = (piece >= 0) & (node >= 0)
        numbers, nodes = piece[known], node[known]
        counts += np.bincount(numbers, minlength=pieces.count)
        for k in range(n_labels):
            sums[:, k] += np.bincount(numbers, array[nodes, k], pieces.count)
        drop_pages(array)
    return np.where(counts[:, None] > 0, sums / np.maximum(counts, 1)[:, None], np.nan)


@public
def topological_map(
    grid: OccupancyGrid,
    labels: ArrayLike,
    label_names: Sequence[str],
    *,
    rules: CorrectionRules | None = None,
    correct: bool = True,
    beliefs: ArrayLike | None = None,
    layout: GridLayout | None = None,
    hall: ArrayLike | None = None,
    known: PlaceIds | None = None,
    own_names: Mapping[int, str] | None = None,
    tolerance: AtLeastZero = 1.5,
    min_width_m: AtLeastZero = 0.0,
    doorways: Doorways | None = None,
    cuts: Sequence[Line] = (),
) -> TopologicalMap:
    """The regions of a labelled map, corrected as in the paper, and their connections.

    Regions are the 8-connected components of free cells with equal labels (paper section 6.2); two
    regions are connected if their cells share a side or a corner.

    Parameters
    ----------
    grid : OccupancyGrid
        The map.
    labels : (H, W) int
        Label per cell, -1 for none; labels of cells that are not free are ignored.
    label_names : sequence of str
    rules : CorrectionRules, optional
        Which regions are errors; the paper's thresholds by default.
    correct : bool
        Whether errors are corrected, and isolated regions dropped.
    beliefs : (N, K) float, optional
        Probabilities of the labels at the nodes of ``layout``, from which confidences are taken.
    layout : GridLayout, optional
        The cells of ``beliefs``: those of ``grid`` or of a coarser version of it.
    hall : (N,) float, optional
        The probability that each node of ``layout`` lies in a hall, where halls are shown as
        corridors: a share of the belief in ``corridor``.
    known : PlaceIds, optional
        Earlier places, such as another map's ``known_places``, which keep their ids and names; its
        cells are moved to the raster of ``grid``.
    own_names : mapping of int to str, optional
        The user's names, by id.
    tolerance : float
        Largest distance of an outline from the corners of its cells, in cells.
    min_width_m : float
        Narrower passages, such as one-cell holes in a wall, are no connections.
    doorways : Doorways, optional
        The gates of the map that are doorways, such as those of
        :func:`~pgm_places.labelling.label.label_map`. If there are any, they are the only
        doorways, and every place ends at them, for any labels there: see
        :func:`~pgm_places.topology.gate_pieces.pieces_between`.
    cuts : sequence of ((float, float), (float, float)), optional
        Lines in the map frame that divide places: their two sides touch, without a doorway. A line
        that divides no place is ignored.

    Raises
    ------
    LabelError
        Labels do not fit the map or the names, or two places have one name.

    Examples
    --------
    >>> grid = OccupancyGrid([[0, 0, 0, 0, 0, 0]], resolution_m=1.0)
    >>> places = topological_map(grid, [[0, 0, 1, 2, 2, 2]], ["room", "doorway", "corridor"])
    >>> [region.name for region in places.path("room 1", "corridor 2")]
    ['room 1', 'doorway 3', 'corridor 2']
    >>> places.region_at(2.5, 0.5).name
    'doorway 3'
    """
    names = tuple(str(name) for name in label_names)
    raster = label_raster("labels", labels, grid.shape, n_labels=len(names))
    rules = rules or CorrectionRules()
    window = KnownWindow.of(grid, multiple=_cells_of_blocks(grid, layout))
    if window is not None:
        part = window.crop(grid)
        if doorways is not None:
            doorways = replace(doorways, grid=part, place=window.cut(doorways.place_on(grid)))
        cropped = topological_map(
            part,
            window.cut(raster),
            names,
            rules=rules,
            correct=correct,
            beliefs=beliefs,
            layout=None if layout is None else _part_of_layout(layout, window, part),
            hall=hall,
            known=known,
            own_names=own_names,
            tolerance=tolerance,
            min_width_m=min_width_m,
            doorways=doorways,
            cuts=cuts,
        )
        return _on_whole(cropped, grid, window)
    removed = () if doorways is None else tuple(gate.line_m for gate in doorways.removed)
    if doorways is not None and len(doorways) and rules.doorway_label in names:
        divided = pieces_between(raster, grid, names, doorways, rules, correct=correct)
    else:
        doorways = None
        divided = _labelled_pieces(raster, names, grid, rules, correct)
    pieces = cut_pieces(divided.pieces, grid, cuts) if cuts else divided.pieces
    probabilities, halls = None, None
    if beliefs is not None:
        probabilities = mean_probabilities(pieces, beliefs, layout, len(names), grid)
    if hall is not None:
        halls = mean_probabilities(pieces, np.asarray(hall)[:, np.newaxis], layout, 1, grid)[:, 0]
    if known is None:
        none = [0] * pieces.count
        ids, next_id = number_on(none, 1, pieces, grid, names, rules.doorway_label)
    else:
        ids, next_id = known.identify(pieces, grid, names, rules.doorway_label)
    classes = [names[label] for label in pieces.label]
    called = name_places(ids, classes, known=known.names if known else None, own=own_names)
    # This order limits the number of rasters in memory, for huge maps.
    deepest = deepest_cells(pieces.piece, pieces.count)
    clearance = squared_clearance(~grid.free)
    regions = describe_regions(
        pieces,
        grid,
        names,
        clearance,
        ids=ids,
        names=called,
        probabilities=probabilities,
        halls=halls,
        gates=_gates_of(divided, doorways, pieces.count),
        anchors_m=known.anchors_m if known else None,
        deepest=deepest,
        tolerance=tolerance,
    )
    connections = connections_of(pieces, grid, ids, clearance, min_width_m)
    region = pieces.on_cells(np.array(ids, np.int32), 0, out=pieces.piece)
    return TopologicalMap(
        grid,
        freeze(region),
        tuple(sorted(regions, key=lambda region: region.id)),
        connections,
        names,
        rules.doorway_label,
        divided.corrections,
        next_id,
        removed,
    )


def _cells_of_blocks(grid: OccupancyGrid, layout: GridLayout | None) -> int:
    """Number of cells after which borders of the map and of the layout's map coincide."""
    if layout is None or not isinstance(layout.source, OccupancyGrid):
        return 1
    return factor_between(grid.resolution_m, layout.source.resolution_m).numerator


def _part_of_layout(layout: GridLayout, window: KnownWindow, part: OccupancyGrid) -> GridLayout:
    """The layout on the raster of a window that contains its nodes."""
    source = layout.source
    if layout.shape == window.shape or not isinstance(source, OccupancyGrid):
        return GridLayout.of_mask(window.cut(layout.mask()), part)
    coarse = window.coarser(source.resolution_m / part.resolution_m)
    cells, mask = coarse.cut(source.cells), coarse.cut(layout.mask())
    held = OccupancyGrid(cells, source.resolution_m, part.origin_xy_m, part.yaw_rad)
    return GridLayout.of_mask(mask, held)


def _on_whole(cropped: TopologicalMap, grid: OccupancyGrid, window: KnownWindow) -> TopologicalMap:
    """The topological map of a window, on the full map."""
    first = window.rows.start, window.columns.start
    corrections = tuple(
        replace(each, cell_rc=(each.cell_rc[0] + first[0], each.cell_rc[1] + first[1]))
        for each in cropped.corrections
    )
    region = freeze(window.paste(cropped.region, 0))
    return replace(cropped, grid=grid, region=region, corrections=corrections)


def _labelled_pieces(
    labels: NDArray[np.int16],
    names: tuple[str, ...],
    grid: OccupancyGrid,
    rules: CorrectionRules,
    correct: bool,
) -> GatePieces:
    """The pieces of equal labels, none of them a gate."""
    raster = np.where(grid.free, labels, np.int16(-1))
    corrections: list[Correction] = []
    if correct:
        raster, corrections = correct_regions(
            raster, names, grid.resolution_m, rules, free=grid.free
        )
    pieces = connected_components(raster)
    return GatePieces(pieces, np.full(pieces.count, -1), tuple(corrections))


def _gates_of(
    divided: GatePieces, doorways: Doorways | None, count: int
) -> list[tuple[Gate, float] | None] | None:
    """The gate of each of ``count`` pieces, with its probability; None for pieces of places."""
    if doorways is None:
        return None
    numbers = divided.gate.tolist() + [-1] * (count - len(divided.gate))  # the last are cut off
    return [None if g < 0 else (doorways.gates[g], float(doorways.probability[g])) for g in numbers]
