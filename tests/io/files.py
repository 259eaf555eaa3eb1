"""Small map files for the tests of the readers."""

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike
from PIL import Image

__all__ = ["write_map"]

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
