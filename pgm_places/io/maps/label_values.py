"""The names file of a label image, which assigns grey values to labels."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from pgm_places._checks import nearest_name, plain_names
from pgm_places.errors import LabelError, shown
from pgm_places.io.input_file import user_path
from pgm_places.io.strict_yaml import YamlFile, read_yaml

__all__ = ["LabelValues", "default_values", "listed_names", "read_label_values"]


@dataclass(frozen=True)
class LabelValues:
    """Grey value of each label in the order of the configuration, and the ignored values."""

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
    """The grey values of ``label_names`` from the names file of a label image.

    Raises
    ------
    LabelError
        Where the file is missing or damaged, a value is used twice, or the names in the file and
        ``label_names`` differ.
    """
    file = read_yaml(_names_file(image_path, names_path), LabelError, "label names")
    unknown_keys = sorted(set(file.values) - {"values", "ignore"})
    if unknown_keys:
        nearest = nearest_name(unknown_keys[0], ["values", "ignore"])
        raise file.fail(f"key {shown(unknown_keys[0])} is unknown. {nearest}")
    values = _values(file)
    ignored = _ignored(file)
    _check_values(file, values, ignored)
    wanted = [str(name) for name in label_names]
    for name in values:
        if name not in wanted:
            raise file.fail(
                f"label {shown(name)} is not among the configured labels. "
                f"{nearest_name(name, wanted)}. Correct the name, or move its value under 'ignore'"
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
    """The labels that the names file of a label image lists, in the order of their values.

    Raises
    ------
    LabelError
        The file is missing or damaged.
    """
    path = user_path(image_path, LabelError)
    file = read_yaml(_names_file(path, names_path), LabelError, "label names")
    values = _values(file)
    return tuple(sorted(values, key=values.__getitem__))


def _names_file(image_path: Path, names_path: Path | str | None) -> Path:
    if names_path is not None:
        return user_path(names_path, LabelError)
    own, shared = image_path.with_suffix(".yaml"), image_path.with_name("labels.yaml")
    if own.exists() or own == shared:
        return own
    if shared.exists():
        return shared
    raise LabelError(
        f"{image_path}: its grey values have no names: neither {own.name} nor {shared.name} "
        "exists beside it. Write one, e.g. 'values: {room: 77, corridor: 115}' and 'ignore: 0'"
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
    return [file.as_integer(item, "key 'ignore'", low=0, high=255) for item in items]


def _check_values(file: YamlFile, values: dict[str, int], ignored: list[int]) -> None:
    owner: dict[int, str] = dict.fromkeys(ignored, "'ignore'")
    for name, value in values.items():
        if value in owner:
            raise file.fail(f"grey value {value} stands for {name!r} and for {owner[value]}")
        owner[value] = repr(name)
