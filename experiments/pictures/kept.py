"""Pictures of the documentation as palette PNG files in docs/images."""

from pathlib import Path

import numpy as np
from PIL import Image
from scipy.spatial.distance import cdist

IMAGES = Path(__file__).resolve().parents[2] / "docs" / "images"

_FREQUENT, _RARE = 150, 100


def keep(name: str, image: Image.Image) -> None:
    """Write docs/images/NAME.png with a palette."""
    path = IMAGES / f"{name}.png"
    _reduced(image).save(path, optimize=True)
    print(f"wrote {path} ({image.width} x {image.height}, {path.stat().st_size / 1000:.0f} kB)")


def _reduced(image: Image.Image) -> Image.Image:
    """The picture in 250 colours: the most frequent ones as they are, the others in groups."""
    if image.mode == "RGBA":
        return image.quantize(_FREQUENT + _RARE, method=Image.Quantize.FASTOCTREE)
    pixels = np.asarray(image.convert("RGB"))
    colours, index, counts = np.unique(
        pixels.reshape(-1, 3), axis=0, return_inverse=True, return_counts=True
    )
    order = np.argsort(-counts)
    palette, others = colours[order[:_FREQUENT]], colours[order[_FREQUENT:]]
    if len(others):
        rare = Image.fromarray(others[None]).quantize(_RARE, Image.Quantize.MEDIANCUT)
        palette = np.concatenate([palette, np.reshape(rare.getpalette(), (-1, 3))[:_RARE]])
    nearest = cdist(colours, palette).argmin(axis=1)
    made = Image.fromarray(nearest[index].reshape(pixels.shape[:2]).astype(np.uint8), "P")
    made.putpalette(palette.astype(np.uint8).tobytes())
    return made
