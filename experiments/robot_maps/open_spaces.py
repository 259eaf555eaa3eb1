"""Open spaces decided once: ``python -m experiments.robot_maps.open_spaces``.

Labels every map of DATA/robots without the shipped networks that learned its building, then gives
each open space the one of corridor and room that more of its cells have, and prints the accuracy
before and after by kind, maps of the networks' training and later ones apart. An open space is a
connected part of the free space that discs of a width cover; obstacles under 0.35 m2 do not count.
"""

import argparse
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import distance_transform_edt

from experiments.buildings.maps import NAMES
from experiments.floor_network.held_out import shipped_without
from experiments.paper.setting import data_folder
from experiments.robot_maps.catalogue import robot_maps, trained_maps
from experiments.robot_maps.sources import Source
from pgm_places.cli.terminal import LineProgress
from pgm_places.maps.components import connected_components
from pgm_places.maps.occupancy_grid import OccupancyGrid

WIDTHS_M = (2.0, 2.5, 3.0, 4.0)
LEAST_OBSTACLE_M2 = 0.35
CORRIDOR, ROOM = NAMES.index("corridor"), NAMES.index("room")


def open_spaces(grid: OccupancyGrid, width_m: float) -> NDArray[np.int64]:
    """(H, W) the open space of each free cell, -1 where no disc of the width fits."""
    obstacles = connected_components(np.where(grid.free, -1, 0))
    small = np.append(obstacles.size * grid.resolution_m**2 < LEAST_OBSTACLE_M2, False)
    inside = grid.free | small[obstacles.piece]
    away_m = distance_transform_edt(np.pad(inside, 1))[1:-1, 1:-1] * grid.resolution_m
    covered = distance_transform_edt(away_m < width_m / 2) * grid.resolution_m <= width_m / 2
    return np.asarray(
        connected_components(np.where(covered & grid.free, 0, -1)).piece, dtype=np.int64
    )


def decided_once(labels: NDArray[np.int64], space: NDArray[np.int64]) -> NDArray[np.int64]:
    """The labels with every open space all corridor or all room; doorways stay."""
    votes = (space >= 0) & ((labels == CORRIDOR) | (labels == ROOM))
    corridors = np.bincount(space[votes & (labels == CORRIDOR)], minlength=space.max() + 1)
    every = np.bincount(space[votes], minlength=space.max() + 1)
    decided = labels.copy()
    decided[votes] = np.where((2 * corridors > every)[space[votes]], CORRIDOR, ROOM)
    return decided


def main(argv: list[str] | None = None) -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(
        prog="python -m experiments.robot_maps.open_spaces",
        description=(__doc__ or "").partition("\n")[0],
    )
    parser.parse_args(argv)
    data = data_folder() or Path("../shared/data")
    of_map, trained = shipped_without(data), trained_maps()
    rows: dict[tuple[str, str], list[tuple[float, list[float]]]] = {}
    maps = list(robot_maps(data))
    with LineProgress().stage("maps") as stage:
        for number, (known, weight) in enumerate(maps, start=1):
            item = known.item
            found = Source(of_map(item.name)).label(item.grid).labels
            both = (item.labels >= 0) & (found >= 0)
            every = [found]
            every += [decided_once(found, open_spaces(item.grid, width)) for width in WIDTHS_M]
            right = [float((labels == item.labels)[both].mean()) for labels in every]
            part = "trained on" if item.name in trained else "later"
            for kind in (known.group, "**all**"):
                rows.setdefault((part, kind), []).append((weight, right))
            stage.update(number / len(maps), item.name)
    print(f"| maps | kind | number | as is | {' | '.join(f'{w:g} m' for w in WIDTHS_M)} |")
    print("|---" * (4 + len(WIDTHS_M)) + "|")
    for (part, kind), some in sorted(rows.items()):
        means = np.average([right for _, right in some], axis=0, weights=[w for w, _ in some])
        print(f"| {part} | {kind} | {len(some)} | {' | '.join(f'{100 * x:.1f}' for x in means)} |")


if __name__ == "__main__":
    main()
