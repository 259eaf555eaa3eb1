"""The files that commands write, known beforehand, and which of them may be left out."""

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Self

from pgm_places.errors import InputError, nearest_name
from pgm_places.io.places.number_image import probability_file

_NONE = "none"


@dataclass(frozen=True)
class Outputs:
    """The files that may be left out.

    Parameters
    ----------
    pictures : bool
        ``overview.png``, ``topology.png`` and, in a batch, ``thumbnail.png``: for people.
    probabilities : bool
        ``probability_<label>.png``.
    """

    pictures: bool = True
    probabilities: bool = True

    @classmethod
    def named(cls, text: str) -> Self:
        """Those that a list with commas names; ``none`` names none.

        Raises
        ------
        InputError
            There is no such kind of file.

        Examples
        --------
        >>> Outputs.named("pictures"), Outputs.named("none").probabilities
        (Outputs(pictures=True, probabilities=False), False)
        """
        names = [name.strip() for name in text.split(",")]
        known = [*cls.__dataclass_fields__, _NONE]
        for name in names:
            if name not in known or (name == _NONE and len(names) > 1):
                raise InputError(
                    f"--outputs takes pictures, probabilities, both with a comma between, or none; "
                    f"got {text!r}. {nearest_name(name, known)}"
                )
        return cls(**{name: name in names for name in cls.__dataclass_fields__})


COMPARISON = ("results.json", "report.html")

DEMO = ("map.yaml", "map.png", "labels.png", "labels.yaml", "demo.toml", *COMPARISON)

PLACES = ("topology.json", "regions.png", "regions.geojson", "topology.png")

TRACK = ("beliefs.csv", "path.png", "beliefs.png", "report.html")

LIVE = ("places.jsonl", "check.csv", *PLACES)

_PICTURES = ("overview.png", "topology.png")

SETTINGS = ("places.json", "gate_places.png")


def label_names(labels: Iterable[str], outputs: Outputs | None = None) -> tuple[str, ...]:
    """The files of a labelled map with these labels, its places included."""
    outputs = outputs or Outputs()
    probabilities = map(probability_file, labels) if outputs.probabilities else ()
    files = ("labels.png", "labels.yaml", "overview.png", "summary.json", "check.csv")
    names = (*files, *probabilities, *PLACES, *SETTINGS)
    return names if outputs.pictures else tuple(name for name in names if name not in _PICTURES)
