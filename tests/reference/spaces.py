"""Segments of open space, slow and obvious."""

import numpy as np
from scipy import ndimage

from pgm_places.spaces.cell_features import CellFeatures

AROUND = [(dr, dc) for dr in (-1, 0, 1) for dc in (-1, 0, 1) if (dr, dc) != (0, 0)]
UNIT = 9 * 1024


def open_cells(free: np.ndarray, resolution_m: float) -> np.ndarray:
    """Obstacles under 0.35 m2 and 1.3 m filled (corners count), pieces under 1 m2 dropped."""
    pieces, count = ndimage.label(~free, np.ones((3, 3)))
    found = free.copy()
    for k in range(1, count + 1):
        rows, columns = np.nonzero(pieces == k)
        sides = np.ptp(rows) + 1, np.ptp(columns) + 1
        if len(rows) * resolution_m**2 < 0.35 and np.hypot(*sides) * resolution_m < 1.3:
            found |= pieces == k
    pieces, count = ndimage.label(found)
    for k in range(1, count + 1):
        if (pieces == k).sum() * resolution_m**2 < 1.0:
            found &= pieces != k
    return found


def smoothed_distance(is_open: np.ndarray) -> np.ndarray:
    """Nine times 1024 times the mean distance over 3 x 3 cells, each rounded."""
    distance = ndimage.distance_transform_edt(np.pad(is_open, 1))
    whole = np.floor(distance * 1024 + 0.5).astype(np.int64)
    return ndimage.convolve(whole, np.ones((3, 3), np.int64), mode="constant")[1:-1, 1:-1] * is_open


def neighbours(relief: np.ndarray, r: int, c: int) -> list[tuple[int, int]]:
    """The open cells around a cell."""
    height, width = relief.shape
    cells = [(r + dr, c + dc) for dr, dc in AROUND]
    return [(s, d) for s, d in cells if 0 <= s < height and 0 <= d < width and relief[s, d] > 0]


def is_corner(a: tuple[int, int], b: tuple[int, int]) -> bool:
    return a[0] != b[0] and a[1] != b[1]


def plateau(relief: np.ndarray, start: tuple[int, int]) -> list[tuple[int, int]]:
    """The connected cells of a cell's height."""
    found = [start]
    for cell in found:
        found += [
            n for n in neighbours(relief, *cell) if relief[n] == relief[cell] and n not in found
        ]
    return found


def ways_up(relief: np.ndarray) -> dict[tuple[int, int], list[tuple[int, int]]]:
    """The neighbours that each cell goes on to; none for summits."""
    ways: dict[tuple[int, int], list[tuple[int, int]]] = {}
    open_cells = [(r, c) for r, c in np.argwhere(relief > 0).tolist()]
    for cell in open_cells:
        slope = {
            n: int(relief[n] - relief[cell]) * (128 if is_corner(cell, n) else 181)
            for n in neighbours(relief, *cell)
        }
        best = [n for n in slope if slope[n] > 0 and slope[n] == max(slope.values())]
        ways[cell] = [n for n in best if not is_corner(cell, n)] or best
    reached = [cell for cell in open_cells if ways[cell]]
    while True:
        wave = {}
        for cell in open_cells:
            if ways[cell]:
                continue
            back = [n for n in neighbours(relief, *cell) if relief[n] == relief[cell]]
            back = [n for n in back if n in reached]
            wave[cell] = [n for n in back if not is_corner(cell, n)] or back
        wave = {cell: back for cell, back in wave.items() if back}
        if not wave:
            return ways
        ways |= wave
        reached = list(wave)


def basins(relief: np.ndarray) -> np.ndarray:
    """Basin of each cell, -1 where not open, -2 on lines that nothing settles."""
    ways = ways_up(relief)
    found = np.full(relief.shape, -1)
    rank: list[tuple[int, ...]] = []
    for cell in sorted(ways):
        if not ways[cell] and found[cell] == -1:
            cells = plateau(relief, cell)
            for other in cells:
                found[other] = len(rank)
            rank.append((int(relief[cell]), len(cells)))
    memory: dict[tuple[int, int], int] = {}

    def basin_of(cell: tuple[int, int]) -> int:
        if not ways[cell]:
            return int(found[cell])
        if cell not in memory:
            ends = {basin_of(n) for n in ways[cell]} - {-2}
            best = [b for b in ends if rank[b] == max(rank[e] for e in ends)]
            memory[cell] = best[0] if len(best) == 1 else -2
        return memory[cell]

    for cell in sorted(ways):
        found[cell] = basin_of(cell)
    full = [
        (*rank[b], int((found == b).sum()), int(relief[found == b].sum())) for b in range(len(rank))
    ]
    settled = found.copy()
    lines, count = ndimage.label(found == -2, np.ones((3, 3)))
    for k in range(1, count + 1):
        around = ndimage.binary_dilation(lines == k, np.ones((3, 3), np.bool_)) & (found >= 0)
        beside = {int(b) for b in found[around]}
        best = [b for b in beside if full[b] == max(full[e] for e in beside)]
        if len(best) == 1:
            settled[lines == k] = best[0]
    return settled


def passes(basin: np.ndarray, relief: np.ndarray) -> dict[tuple[int, int], int]:
    """Height of the pass between every two basins that touch, directly or over a line."""
    found: dict[tuple[int, int], int] = {}

    def note(a: int, b: int, height: int) -> None:
        if a >= 0 and b >= 0 and a != b:
            pair = (min(a, b), max(a, b))
            found[pair] = max(found.get(pair, 0), height)

    for r, c in np.argwhere(relief > 0).tolist():
        around = neighbours(relief, r, c)
        for n in around:
            note(int(basin[r, c]), int(basin[n]), int(min(relief[r, c], relief[n])))
            for m in around:
                if basin[r, c] == -2:
                    height = int(min(relief[r, c], relief[n], relief[m]))
                    note(int(basin[n]), int(basin[m]), height)
    return found


def merged(
    n_basins: int,
    width_of: dict[tuple[int, int], float],
    radius: list[float],
    area: list[int],
    ratio: float,
    least_radius: float,
) -> set[frozenset[int]]:
    """The segments that basins merge to, as sets of basins; passes of one width at a time."""
    segments = {frozenset([b]) for b in range(n_basins)}

    def home(basin: int) -> frozenset[int]:
        return next(segment for segment in segments if basin in segment)

    def radius_of(segment: frozenset[int]) -> float:
        return max(radius[b] for b in segment)

    for width in sorted(set(width_of.values()), reverse=True):
        pairs = [pair for pair, w in width_of.items() if w == width]
        small = max(width / ratio, least_radius)
        for a, b in pairs:
            one, two = home(a), home(b)
            if one != two and radius_of(one) < small and radius_of(two) < small:
                segments -= {one, two}
                segments.add(one | two)
        wishes: dict[frozenset[int], set[frozenset[int]]] = {}
        for a, b in pairs:
            for one, two in ((home(a), home(b)), (home(b), home(a))):
                if radius_of(one) < small <= radius_of(two):
                    wishes.setdefault(one, set()).add(two)
        groups: dict[frozenset[int], set[frozenset[int]]] = {}
        for one, large in wishes.items():
            rank = {s: (radius_of(s), sum(area[b] for b in s)) for s in large}
            best = [s for s in large if rank[s] == max(rank.values())]
            if len(best) == 1:
                groups.setdefault(best[0], set()).add(one)
        for best_one, joining in groups.items():
            segments -= {best_one, *joining}
            segments.add(best_one.union(*joining))
    return segments


def border_pieces(
    segment: np.ndarray, relief: np.ndarray
) -> list[tuple[tuple[int, int], int, int, list[float], list[float]]]:
    """Of each opening: its segments, sides of cells, height of the saddle, saddle and centre."""
    height, width = segment.shape
    places: dict[tuple[int, int], dict[tuple[int, int], list[tuple[bool, int]]]] = {}
    for r, c in np.argwhere(segment >= 0).tolist():
        for dr, dc in ((0, 1), (1, 0), (1, 1), (1, -1)):
            s, d = r + dr, c + dc
            if not (s < height and 0 <= d < width) or segment[s, d] < 0:
                continue
            a, b = sorted((int(segment[r, c]), int(segment[s, d])))
            if a == b:
                continue
            at_place = places.setdefault((a, b), {}).setdefault((r + s, c + d), [])
            at_place.append((dr * dc == 0, int(min(relief[r, c], relief[s, d]))))
    found = []
    for pair, known in places.items():
        left = set(known)
        while left:
            piece = [left.pop()]
            for r, c in piece:
                near = {p for p in left if max(abs(p[0] - r), abs(p[1] - c)) <= 2}
                left -= near
                piece += sorted(near)
            sites = [(*p, *site) for p in piece for site in known[p]]
            top = max(height for *_, height in sites)
            saddle = np.mean([site[:2] for site in sites if site[3] == top], axis=0) / 2
            centre = np.mean([site[:2] for site in sites], axis=0) / 2
            sides = sum(is_side for _, _, is_side, _ in sites)
            found.append((pair, sides, top, saddle.tolist(), centre.tolist()))
    return sorted(found)


def shape(
    segment: np.ndarray, number: int, cells: np.ndarray, resolution_m: float
) -> dict[str, float]:
    """Shape of one segment of a raster; ``cells`` are the map's: 0 free, -1 unknown."""
    inside = np.argwhere(segment == number).astype(float)
    spread = np.linalg.eigvalsh(np.cov(inside.T, bias=True) + np.eye(2) / 12)
    best = (np.inf, 0.0, 0.0)
    for degrees in range(0, 90, 6):
        angle = np.deg2rad(degrees)
        along = inside @ [np.sin(angle), np.cos(angle)]
        across = inside @ [np.cos(angle), -np.sin(angle)]
        one, other = np.ptp(along) + 1, np.ptp(across) + 1
        best = min(best, (round(one * other, 6), min(one, other), max(one, other)))
    sides = unknown = 0
    for r, c in np.argwhere(segment == number).tolist():
        for s, d in ((r - 1, c), (r + 1, c), (r, c - 1), (r, c + 1)):
            off = not (0 <= s < segment.shape[0] and 0 <= d < segment.shape[1])
            sides += off or segment[s, d] != number
            unknown += not off and segment[s, d] == -1 and cells[s, d] == -1
    return {
        "area": len(inside) * resolution_m**2,
        "roundness": float(np.sqrt(max(spread[0], 0) / spread[1])),
        "short": best[1] * resolution_m,
        "long": best[2] * resolution_m,
        "outline": sides * resolution_m,
        "unknown": unknown * resolution_m,
        "furniture": float((cells[segment == number] != 0).mean()),
    }


def nearest_opening(
    ends_rc: list[tuple[np.ndarray, np.ndarray, float]], cell: np.ndarray
) -> tuple[float, float]:
    """Distance in cells to the nearest of some lines, and its half width: the wider of equal ones.

    Each line is its middle, half of it as a vector, and the half width.
    """
    best = (np.inf, -0.0)
    for middle, half, width in ends_rc:
        y, x = cell - middle
        length = half[0] * half[0] + half[1] * half[1]
        if length > 0:
            share = min(1.0, max(-1.0, (y * half[0] + x * half[1]) / length))
            y, x = y - share * half[0], x - share * half[1]
        best = min(best, (np.sqrt(y * y + x * x), -width))
    return best[0], -best[1]


def cell_features(features: CellFeatures, cells_rc: np.ndarray) -> np.ndarray:
    """Every column of some cells, one cell after the other."""
    watershed = features.divisions[0].watershed
    resolution_m = watershed.grid.resolution_m
    found = np.zeros((len(cells_rc), len(features.names)))
    for row, cell in zip(found, cells_rc, strict=True):
        height = watershed.relief[cell[0] + 1, cell[1] + 1]
        row[0] = max(height / UNIT - 0.5, 0.0) * resolution_m
        first = 1
        for division, table in zip(features.divisions, features.tables, strict=True):
            openings, size = division.openings, table.shape[1]
            half = openings.direction_rc * ((openings.length_m / resolution_m - 1) / 2)[:, None]
            segment = int(division.raster()[tuple(cell)])
            row[first + size + 1] = 10.0
            if segment >= 0:
                own = np.flatnonzero((openings.segments == segment).any(axis=1))
                lines = [(openings.centre_rc[o], half[o], openings.half_width_m[o]) for o in own]
                distance, width = nearest_opening(lines, cell)
                row[first : first + size] = table[segment]
                row[first + size] = row[0] / division.radius_m[segment]
                row[first + size + 1] = min(distance * resolution_m, 10.0)
                row[first + size + 2] = width
            first += size + 3
    return found.astype(np.float32)
