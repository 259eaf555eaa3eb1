"""Small files for the tests of the readers."""

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike
from PIL import Image

from pgm_places.features.object_counts import ObjectCounts

DESCRIPTION = {
    "resolution": "0.05",
    "origin": "[0.0, 0.0, 0.0]",
    "negate": "0",
    "occupied_thresh": "0.65",
    "free_thresh": "0.196",
}


def write_map(
    folder: Path, pixels: ArrayLike | Image.Image, *, image: str = "map.png", **keys: Any
) -> Path:
    """map.yaml with the given keys (None leaves one out) beside an image (row 0 is the top)."""
    picture = pixels if isinstance(pixels, Image.Image) else Image.fromarray(np.asarray(pixels))
    picture.save(folder / image)
    lines = {"image": image, **DESCRIPTION, **keys}
    path = folder / "map.yaml"
    path.write_text("".join(f"{k}: {v}\n" for k, v in lines.items() if v is not None))
    return path


def write_counts(path: Path, counts: ObjectCounts) -> Path:
    """The path, once the counts are written as CSV with all their digits."""
    quoted = ['"' + name.replace('"', '""') + '"' for name in counts.object_names]
    lines = [",".join(["t_s", *quoted])]
    for time, row in zip(counts.times_s.tolist(), counts.counts.tolist(), strict=True):
        lines.append(",".join([repr(time), *map(str, row)]))
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")
    return path
