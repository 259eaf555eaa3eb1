"""The names file of a label image: grey values and colours of labels."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from pgm_places._checks import plain_names
from pgm_places.errors import LabelError, nearest_name, quoted
from pgm_places.io.input_file import user_path
from pgm_places.io.maps.raster_image import RasterImage, Strip
from pgm_places.io.strict_yaml import YamlFile, read_yaml
from pgm_places.palette import hex_of


@dataclass(frozen=True)
class LabelValues:
    """Grey value of each label in the order of the label names, and the ignored values."""

    path: Path
    names: tuple[str, ...]
    values: tuple[int, ...]
    ignored: frozenset[int]

    @property
    def known(self) -> frozenset[int]:
        """Every value that may occur."""
        return self.ignored | frozenset(self.values)

    def table(self) -> NDArray[np.int16]:
        """(256,) label of each grey value; -1 for none."""
        table = np.full(256, -1, np.int16)
        table[list(self.values)] = np.arange(len(self.values))
        return table

    def listed(self) -> str:
        """Names and values, for messages."""
        named = ", ".join(
            f"{name} = {value}" for name, value in zip(self.names, self.values, strict=True)
        )
        return f"{named}; ignored: {', '.join(map(str, sorted(self.ignored))) or 'none'}"


def default_values(label_names: Sequence[str]) -> dict[str, int]:
    """Grey values from 1 to 255 for the labels, spread evenly; 0 stays free for "no label".

    Examples
    --------
    >>> default_values(["room", "corridor", "doorway"])
    {'room': 85, 'corridor': 170, 'doorway': 255}
    """
    names = list(label_names)
    if not 1 <= len(names) <= 255 or len(set(names)) != len(names):
        raise LabelError(f"label_names must be 1 to 255 distinct names, got {names[:10]}")
    step = 255 // len(names)
    return {name: (k + 1) * step for k, name in enumerate(names)}


def read_label_values(
    image_path: Path, label_names: Sequence[str], names_path: Path | str | None = None
) -> LabelValues:
    """The grey values of ``label_names``, which the names file must list exactly."""
    file = read_yaml(_names_file(image_path, names_path), LabelError, "label names")
    unknown_keys = sorted(set(file.values) - {"values", "ignore"})
    if unknown_keys:
        nearest = nearest_name(unknown_keys[0], ["values", "ignore"])
        raise file.fail(f"key {quoted(unknown_keys[0])} is unknown. {nearest}")
    values = _values(file)
    ignored = _ignored(file)
    _check_values(file, values, ignored)
    wanted = [str(name) for name in label_names]
    for name in values:
        if name not in wanted:
            raise file.fail(
                f"label {quoted(name)} is not among the configured labels. "
                f"{nearest_name(name, wanted)}. Correct the name, add it to the configured labels, "
                "map it to one of them with 'classes', or move its value under 'ignore'"
            )
    for name in wanted:
        if name not in values:
            raise file.fail(
                f"the configured label {name!r} has no grey value here. "
                f"{nearest_name(name, list(values))}. Add it under 'values'"
            )
    return LabelValues(
        file.path, tuple(wanted), tuple(values[name] for name in wanted), frozenset(ignored)
    )


def listed_names(image_path: Path | str, names_path: Path | str | None = None) -> tuple[str, ...]:
    """The labels that the names file of a label image lists, in the order of their values."""
    path = user_path(image_path, LabelError)
    file = read_yaml(_names_file(path, names_path), LabelError, "label names")
    values = _values(file)
    return tuple(sorted(values, key=values.__getitem__))


def _names_file(image_path: Path, names_path: Path | str | None) -> Path:
    if names_path is not None:
        return user_path(names_path, LabelError)
    if not image_path.exists():
        raise LabelError(f"{image_path}: no such file; expected a label image")
    own, shared = image_path.with_suffix(".yaml"), image_path.with_name("labels.yaml")
    if own.exists() or own == shared:
        return own
    if shared.exists():
        return shared
    raise LabelError(
        f"{image_path}: its grey values have no names: neither {own.name} nor {shared.name} "
        "exists in its folder. Write one, e.g. 'values: {room: 77, corridor: 115}' and 'ignore: 0'"
    )


def _values(file: YamlFile) -> dict[str, int]:
    listed = file.value("values")
    if not isinstance(listed, dict) or not listed:
        raise file.fail("key 'values' must map label names to grey values, e.g. {room: 77}")
    plain_names(f"{file.path}: label names", listed)
    return {
        name: file.as_integer(value, f"the grey value of {name!r}", low=0, high=255)
        for name, value in listed.items()
    }


def _ignored(file: YamlFile) -> list[int]:
    if "ignore" not in file:
        return []
    listed = file.value("ignore")
    items = listed if isinstance(listed, list) else [listed]
    return [file.as_integer(value, "key 'ignore'", low=0, high=255) for value in items]


def _check_values(file: YamlFile, values: dict[str, int], ignored: list[int]) -> None:
    owner: dict[int, str] = dict.fromkeys(ignored, "'ignore'")
    for name, value in values.items():
        if value in owner:
            raise file.fail(f"grey value {value} stands for {name!r} and for {owner[value]}")
        owner[value] = repr(name)


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
    """(256, 3) palette of a label image: the lowest value has the first colour, none is black."""
    palette = np.zeros((256, 3), np.uint8)
    for k, value in enumerate(sorted(values)):
        palette[value] = _colour(k)
    return palette


def colours_are_wanted(image: RasterImage, values: LabelValues) -> bool:
    """Whether an indexed image is read by its colours rather than by its indices.

    It is if all colours are greys, or if an editor has renumbered the palette of a label image.
    LabelError if both readings are possible, with different labels.
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
    """(h, w) the value of each pixel's colour, a grey's own value; refuses other opaque colours."""
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
    numbers = [table.get(colour, -1) for colour in colours.tolist()]
    if -1 in numbers:
        at = first[[k for k, value in enumerate(numbers) if value < 0]].min()
        row, column = np.argwhere(coloured)[at].tolist()
        raise LabelError(
            f"{image.path}: the colour {hex_of(channels[row, column])} at row {strip.row + row} "
            f"from the top, column {column} is not one of the label image's: {_listed(values)}; "
            "draw with these colours, without anti-aliasing, or save it as greyscale or as an "
            "indexed "
            "image"
        )
    stored[coloured] = np.array(numbers, np.uint8)[which]
    return stored


def _coded(values: LabelValues) -> list[int]:
    """The values that have a colour: labels' values, also if they are under 'ignore'."""
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
    quoted = [f"{name} {hex_of(palette[value])}" for value, name in named[:_MOST_LISTED]]
    more = [f"{len(named) - _MOST_LISTED} more"] if len(named) > _MOST_LISTED else []
    return ", ".join([*quoted, *more, "black for none"])


def _coloured(colours: NDArray[np.uint8]) -> NDArray[np.bool_]:
    return np.asarray((colours != colours[..., :1]).any(axis=-1))


def _key(rgb: Sequence[int] | NDArray[np.uint8]) -> int:
    red, green, blue = (int(part) for part in rgb)
    return red << 16 | green << 8 | blue


def _colour(k: int) -> tuple[int, int, int]:
    """The k-th colour; after the first seven, darker versions of them, never grey."""
    red, green, blue = LABEL_COLOURS[k % len(LABEL_COLOURS)]
    shade = 1 / (1 + 0.5 * (k // len(LABEL_COLOURS)))
    return round(red * shade), round(green * shade), round(blue * shade)
