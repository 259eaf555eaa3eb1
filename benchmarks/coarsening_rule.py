"""What a coarse map keeps: open doorways, tight walls, labelled cells; a table over the share.

    python -m benchmarks.coarsening_rule ../shared/data/freiburg079 --factor 4

The folder holds map.yaml, labels.png and labels.yaml with a label "doorway". A *leak* is a pair of
neighbouring free coarse cells whose fine cells are not connected within a margin of one coarse
cell: a beam or a region passes where a wall stood.
"""

import argparse
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from pgm_places.io.maps.label_image import load_labels
from pgm_places.io.maps.map_server import load_map
from pgm_places.maps.coarsening import coarsen
from tests.reference.coarse_blocks import passable_doors

NAMES = ["corridor", "room", "doorway"]
DOOR_REACH_M = 0.4


def count_leaks(fine: NDArray[np.bool_], coarse: NDArray[np.bool_], factor: int) -> tuple[int, int]:
    """Leaking and all pairs of neighbouring free coarse cells."""
    height, width = coarse.shape
    padded = np.zeros(((height + 2) * factor, (width + 2) * factor), np.bool_)
    padded[factor : factor + fine.shape[0], factor : factor + fine.shape[1]] = fine
    leaks = pairs = 0
    for down, right in ((1, 0), (0, 1)):
        both = coarse[: height - down, : width - right] & coarse[down:, right:]
        pairs += int(both.sum())
        for r, c in np.argwhere(both):
            rows = slice(r * factor, (r + down + 3) * factor)
            columns = slice(c * factor, (c + right + 3) * factor)
            pieces = ndimage.label(padded[rows, columns], np.ones((3, 3)))[0]
            one = pieces[factor : 2 * factor, factor : 2 * factor]
            other = pieces[
                (1 + down) * factor : (2 + down) * factor,
                (1 + right) * factor : (2 + right) * factor,
            ]
            leaks += main_piece(one) != main_piece(other)
    return leaks, pairs


def main_piece(block: NDArray[np.integer]) -> int:
    """The connected piece that most of a block's free cells belong to."""
    return int(np.bincount(block[block > 0]).argmax())


def main() -> None:
    """Print the table for one folder."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("folder", type=Path)
    parser.add_argument("--factor", type=int, default=4)
    options = parser.parse_args()
    factor = options.factor
    grid = load_map(options.folder / "map.yaml").grid
    labels = load_labels(options.folder / "labels.png", NAMES, grid=grid)
    reach = round(DOOR_REACH_M / grid.resolution_m)
    print(f"{options.folder.name}, {factor * grid.resolution_m:g} m")
    print("occupied share   doors open   leaks / pairs    kept: corridor  room  doorway")
    # just above 1 / factor a straight wall one cell thick no longer counts
    for share, name in (
        (1 / factor**2, "any cell"),
        (0.5 / factor, "0.5 / f"),
        (1 / factor, "1 / f"),
        (1 / factor + 1 / factor**2, "1 / f + a cell"),
        (2 / factor, "2 / f"),
    ):
        coarse = coarsen(grid, factor * grid.resolution_m, occupied_share=share)
        free = np.kron(coarse.free, np.ones((factor, factor), np.bool_))
        free = free[: grid.shape[0], : grid.shape[1]]
        doors = passable_doors(grid.free, free, labels, NAMES.index("doorway"), reach)
        leaks, pairs = count_leaks(grid.free, coarse.free, factor)
        kept = "  ".join(f"{free[labels == k].mean():6.3f}" for k in range(len(NAMES)))
        print(
            f"{name:15s}  {sum(doors):4d} / {len(doors):<4d}  {leaks:5d} / {pairs:<8d}  {kept:>30s}"
        )


if __name__ == "__main__":
    main()
