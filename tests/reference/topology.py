"""Regions and their corrections, slow and obvious."""

import numpy as np


def flood_fill(raster: np.ndarray, connectivity: int) -> np.ndarray:
    """Pieces of equal labels, numbered by their first cell."""
    piece = np.full(raster.shape, -1)
    count = 0
    for start in np.argwhere(raster >= 0):
        if piece[tuple(start)] >= 0:
            continue
        open_cells = [tuple(start)]
        piece[tuple(start)] = count
        while open_cells:
            r, c = open_cells.pop()
            for s, d in neighbours(raster.shape, r, c, connectivity):
                if piece[s, d] < 0 and raster[s, d] == raster[r, c]:
                    piece[s, d] = count
                    open_cells.append((s, d))
        count += 1
    return piece


def neighbours(
    shape: tuple[int, ...], r: int, c: int, connectivity: int = 8
) -> list[tuple[int, int]]:
    """The cells around a cell."""
    found = []
    for dr in (-1, 0, 1):
        for dc in (-1, 0, 1):
            corner = abs(dr) + abs(dc) == 2
            inside = 0 <= r + dr < shape[0] and 0 <= c + dc < shape[1]
            if (dr, dc) != (0, 0) and inside and not (corner and connectivity == 4):
                found.append((r + dr, c + dc))
    return found


def borders(piece: np.ndarray) -> dict[int, dict[int, int]]:
    """Border of every region with every other, in thousandths of a side; a corner counts 1."""
    found: dict[int, dict[int, int]] = {int(p): {} for p in np.unique(piece[piece >= 0])}
    for r, c in np.argwhere(piece >= 0):
        for s, d in neighbours(piece.shape, r, c):
            a, b = int(piece[r, c]), int(piece[s, d])
            if b >= 0 and a != b:
                found[a][b] = found[a].get(b, 0) + (1000 if r == s or c == d else 1)
    return found


def corrected(
    raster: np.ndarray, doorway: int, min_cells: int, min_doorway_cells: int
) -> np.ndarray:
    """One correction at a time, with all regions formed anew after each."""
    raster = raster.copy()
    while True:
        piece = flood_fill(raster, 8)
        around = borders(piece)
        wrong = []
        for region in around:
            cells = int((piece == region).sum())
            label = raster[piece == region][0]
            least = min_doorway_cells if label == doorway else min_cells
            idle = label == doorway and len(around[region]) < 2
            if around[region] and (cells < least or idle):
                wrong.append((cells, region))
        if not wrong:
            return raster
        _, region = min(wrong)
        best = max(around[region], key=lambda other: (around[region][other], -other))
        raster[piece == region] = raster[piece == best][0]
