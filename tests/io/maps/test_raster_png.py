"""Rasters as PNG files: every value kept, and files as small as with a search for repetitions."""

import io

import numpy as np
import pytest
from PIL import Image

from pgm_places.io.maps.raster_image import raster_png
from pgm_places.simulation import generate_building


def building_of(kind: str) -> Image.Image:
    labels = generate_building().labels
    if kind == "P":
        stored = np.where(labels < 0, 255, labels).astype(np.uint8)
        picture = Image.frombytes("P", stored.shape[::-1], stored.tobytes())
        picture.putpalette(list(range(256)) * 3)
        return picture
    return Image.fromarray((labels + 1).astype(np.uint8 if kind == "L" else np.uint16) * 60)


@pytest.mark.parametrize("kind", ["P", "L", "I;16"])
def test_every_value_is_kept_and_the_file_is_small(kind: str) -> None:
    picture = building_of(kind)
    content = raster_png(picture)
    found = Image.open(io.BytesIO(content))
    assert found.mode == picture.mode == kind
    np.testing.assert_array_equal(np.asarray(found), np.asarray(picture))
    searched = io.BytesIO()
    picture.save(searched, "PNG")
    assert len(content) < 1.1 * len(searched.getvalue())
