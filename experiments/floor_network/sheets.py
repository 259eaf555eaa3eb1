"""Pictures of maps that robots made: the truth next to the labels."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from experiments.known_maps import NAMES, KnownMap
from pgm_places.maps.occupancy_grid import OccupancyGrid
from pgm_places.palette import GROUND_SWATCHES, label_swatches
from pgm_places.pictures.canvas import label_canvas, view_of
from pgm_places.pictures.figure_grid import Panel, figure_grid

_PIXELS = 30_000
_PAIRS_ACROSS = 3


@dataclass(frozen=True, eq=False)
class LabelledPair:
    """A map with its truth, the labels (H, W) that were found, and the share that is right."""

    known: KnownMap
    labels: NDArray[np.int64]
    accuracy: float

    def panels(self) -> list[Panel]:
        """The truth, and what was found; maps that are taller than wide are turned."""
        item, quarters = self.known.item, 0
        known = np.argwhere(~item.grid.unknown)
        if np.ptp(known[:, 0]) > np.ptp(known[:, 1]):
            quarters = 1
        cells, truth, labels = (
            np.ascontiguousarray(np.rot90(values, quarters))
            for values in (item.grid.cells, item.labels, self.labels)
        )
        grid = OccupancyGrid(cells, item.grid.resolution_m)
        view = view_of(grid, most_pixels=_PIXELS)
        found = f"found: {100 * self.accuracy:.1f} % right"
        return [
            Panel(label_canvas(grid, truth, NAMES, view), item.name.replace("_", " ")),
            Panel(label_canvas(grid, labels, NAMES, view), found),
        ]


def write_sheets(folder: Path, pairs: Sequence[LabelledPair]) -> None:
    """``robots_KIND.png`` for each kind of building, the worst map last."""
    for kind in sorted({pair.known.kind for pair in pairs}):
        mine = [pair for pair in pairs if pair.known.kind == kind]
        name = f"robots_{kind.replace(',', '').replace(' ', '_')}.png"
        write_sheet(folder / name, mine)


def write_sheet(path: Path, pairs: Sequence[LabelledPair]) -> None:
    """A picture of pairs, the worst map last."""
    ordered = sorted(pairs, key=lambda pair: -pair.accuracy)
    data = figure_grid(
        [panel for pair in ordered for panel in pair.panels()],
        columns=2 * _PAIRS_ACROSS,
        legend=(*label_swatches(NAMES), *GROUND_SWATCHES),
        scale_bar=False,
        long_side=2400,
    ).png()
    path.write_bytes(data)
