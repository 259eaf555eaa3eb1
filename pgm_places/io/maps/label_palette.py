"""The colours in which label images are written, and by which coloured ones are read back."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from pgm_places.errors import LabelError
from pgm_places.io.maps.label_values import LabelValues
from pgm_places.io.maps.raster_image import RasterImage, Strip
from pgm_places.palette import hex_of

__all__ = ["LABEL_COLOURS", "colours_are_wanted", "palette_of", "values_of_colours"]

# Okabe and Ito's colours, distinguishable with every kind of colour vision; black is left out, it
# stands for "no label".
LABEL_COLOURS = (
    (0, 114, 178),
    (230, 159, 0),
    (0, 158, 115),
    (204, 121, 167),
    (86, 180, 233),
    (213, 94, 0),
    (240, 228, 66),
)

_MOST_LISTED = 8


def palette_of(values: Sequence[int]) -> NDArray[np.uint8]:
    """(256, 3) the palette of an indexed label image: the lowest value has the first colour.

    Values of no label are black.
    """
    palette = np.zeros((256, 3), np.uint8)
    for k, value in enumerate(sorted(values)):
        palette[value] = _colour(k)
    return palette


def colours_are_wanted(image: RasterImage, values: LabelValues) -> bool:
    """Whether an indexed image is read by its colours rather than by its indices.

    It is if all colours are greys, or if an editor has renumbered the palette of a label image.
    Otherwise the indices count, whatever the colours are.

    Raises
    ------
    LabelError
        Both readings are possible, and they give different labels.
    """
    used = np.zeros(256, np.bool_)
    for strip in image.strips(indices=True):
        used[np.unique(strip.channels)] = True
    palette = image.palette_rgb()
    indices = np.flatnonzero(used[: len(palette)])
    if not _coloured(palette[indices]).any():
        return True
    table = _values_by_colour(values)
    by_colour = [table.get(_key(palette[index])) for index in indices.tolist()]
    if not values.known.issuperset(indices.tolist()):
        return any(value in _coded(values) for value in by_colour)
    if None not in by_colour and by_colour != indices.tolist():
        pairs = zip(indices.tolist(), by_colour, strict=True)
        index, value = next((index, value) for index, value in pairs if index != value)
        raise LabelError(
            f"{image.path}: its indices and its colours stand for different labels: index "
            f"{index} has "
            f"the colour {hex_of(palette[index])}, which stands for {value} ({_listed(values)}); "
            "save it as RGB or as greyscale"
        )
    return False


def values_of_colours(strip: Strip, values: LabelValues, image: RasterImage) -> NDArray[np.uint8]:
    """(h, w) the value that each pixel's colour stands for: a grey for itself.

    Raises
    ------
    LabelError
        A pixel that is not transparent has another colour.
    """
    channels = strip.channels
    stored = channels[:, :, 0].copy()
    if channels.shape[2] == 1:
        return stored
    coloured = _coloured(channels)
    if strip.alpha is not None:
        coloured &= strip.alpha > 0
    if not coloured.any():
        return stored
    table = _values_by_colour(values)
    keys = channels[coloured].astype(np.int32) @ np.array([1 << 16, 1 << 8, 1], np.int32)
    colours, first, which = np.unique(keys, return_index=True, return_inverse=True)
    found = [table.get(colour, -1) for colour in colours.tolist()]
    if -1 in found:
        at = first[[k for k, value in enumerate(found) if value < 0]].min()
        row, column = np.argwhere(coloured)[at].tolist()
        raise LabelError(
            f"{image.path}: the colour {hex_of(channels[row, column])} at row {strip.row + row} "
            f"from the top, column {column} is not one of the label image's: {_listed(values)}; "
            "draw with these colours, without anti-aliasing, or save it as greyscale or as an "
            "indexed "
            "image"
        )
    stored[coloured] = np.array(found, np.uint8)[which]
    return stored


def _coded(values: LabelValues) -> list[int]:
    """The values that have a colour: those of labels that were put under 'ignore' keep theirs."""
    nothing = values.ignored & {0}
    return sorted(values.known - nothing)


def _values_by_colour(values: LabelValues) -> dict[int, int]:
    """The value of each colour of the palette by its key; a colour of two labels is left out."""
    coded = _coded(values)
    palette = palette_of(coded)
    keys = [_key(palette[value]) for value in coded]
    greys = {_key((grey, grey, grey)): grey for grey in values.ignored}
    pairs = zip(keys, coded, strict=True)
    return greys | {key: value for key, value in pairs if keys.count(key) == 1}


def _listed(values: LabelValues) -> str:
    """The colours and their labels, for messages."""
    palette = palette_of(_coded(values))
    named = sorted(zip(values.values, values.names, strict=True))
    shown = [f"{name} {hex_of(palette[value])}" for value, name in named[:_MOST_LISTED]]
    more = [f"{len(named) - _MOST_LISTED} more"] if len(named) > _MOST_LISTED else []
    return ", ".join([*shown, *more, "black for none"])


def _coloured(colours: NDArray[np.uint8]) -> NDArray[np.bool_]:
    return np.asarray((colours != colours[..., :1]).any(axis=-1))


def _key(rgb: Sequence[int] | NDArray[np.uint8]) -> int:
    red, green, blue = (int(part) for part in rgb)
    return red << 16 | green << 8 | blue


def _colour(k: int) -> tuple[int, int, int]:
    """The k-th colour; after the first seven, the same ones darkened step by step, never grey."""
    red, green, blue = LABEL_COLOURS[k % len(LABEL_COLOURS)]
    shade = 1 / (1 + 0.5 * (k // len(LABEL_COLOURS)))
    return round(red * shade), round(green * shade), round(blue * shade)
