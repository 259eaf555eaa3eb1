"""How much of robots' maps was never entered, and what is lost of what people labelled.

``PGM_PLACES_DATA=DATA python -m experiments.entered`` goes through the labelled maps of
``DATA/robots``, ``DATA/floors`` and single buildings, and prints a line for each.
"""

import os
import time
from collections.abc import Iterator
from pathlib import Path

import numpy as np
from PIL import Image

from experiments.paper.front_laser import PLACES, load_cold_folder, place_classes
from pgm_places.io.maps.map_server import load_map
from pgm_places.spaces.unentered import find_unentered

ALIKE = (
    ("hospital_aws", "hospital_pal"),
    ("corridor_uma", "lab_uma"),
    ("lab_stmobo", "hallway_stmobo"),
    ("floor_uom", "hallway_uom", "lab_hv"),
    ("house_aws", "bookstore_aws", "warehouse_aws"),
)
"""Maps of one building, or of one maker's worlds."""

OTHERS = ("freiburg079", "freiburg052", "freiburg079_drawn")


def halves(names: list[str]) -> tuple[list[str], list[str]]:
    """The maps by which the thresholds were chosen, and the others: every second building."""
    buildings: dict[tuple[str, ...], None] = {}
    for name in names:
        buildings[next((group for group in ALIKE if name in group), (name,))] = None
    sides = [[name for group in list(buildings)[k::2] for name in group] for k in (0, 1)]
    return sides[0], sides[1]


def measured(folder: Path) -> tuple[float, float, float, float]:
    """Of a map: m2 found and in all that nobody labelled, m2 lost and in all that is labelled."""
    if (folder / "regions.geojson").exists():
        drawn = load_cold_folder(folder, place_classes(), PLACES)[0]
        grid, judged = drawn.grid, drawn.labels >= 0
    else:
        grid = load_map(folder / "map.yaml").grid
        judged = np.asarray(Image.open(folder / "labels.png"))[::-1] > 0
    start = time.process_time()
    cells = find_unentered(grid).cells
    seconds = time.process_time() - start
    masks = (cells & ~judged, grid.free & ~judged, cells & judged, grid.free & judged)
    found, unjudged, lost, labelled = (int(mask.sum()) * grid.resolution_m**2 for mask in masks)
    print(
        f"{folder.name}: found {found:.1f} of {unjudged:.1f} m2 without a label, lost {lost:.2f} "
        f"of {labelled:.1f} m2 with one; {1e6 * seconds / grid.cells.size:.2f} s a million cells",
        flush=True,
    )
    return found, unjudged, lost, labelled


def summaries(data: Path) -> Iterator[str]:
    """A line per set of maps."""
    names = sorted(path.name for path in (data / "robots").iterdir() if path.is_dir())
    sides = zip(("chosen on", "others"), halves(names), strict=True)
    sets = {f"robots, {side}": [data / "robots" / name for name in some] for side, some in sides}
    sets["floors"] = sorted(path for path in (data / "floors").iterdir() if path.is_dir())
    sets["buildings 79 and 52"] = [data / name for name in OTHERS]
    sets["COLD"] = sorted(data.glob("cold_*"))
    for title, folders in sets.items():
        found, unjudged, lost, labelled = np.array([measured(item) for item in folders]).T
        share = lost / np.maximum(labelled, 1e-9)
        yield (
            f"{title}: {100 * found.sum() / max(unjudged.sum(), 1e-9):.1f} % of the free space "
            f"without labels found; labelled space lost: {100 * share.mean():.3f} % in the mean, "
            f"{100 * share.max():.2f} % at most"
        )


if __name__ == "__main__":
    print("\n".join(summaries(Path(os.environ["PGM_PLACES_DATA"]))))
