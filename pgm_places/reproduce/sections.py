"""The sections of the paper that have experiments, by number."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from importlib import import_module

from pgm_places._checks import nearest_name
from pgm_places.errors import ConfigError
from pgm_places.reproduce.section import Outcome
from pgm_places.reproduce.setting import Setting

__all__ = ["SECTIONS", "PaperSection", "chosen_sections"]


@dataclass(frozen=True)
class PaperSection:
    """An experiment: what the paper says, what it needs, and where its function is.

    Parameters
    ----------
    title, paper : str
    module : str
        Of ``pgm_places.reproduce``, with a function ``run(setting)``; imported when it is run.
    folders : tuple of str
        Folders of the real data without which generated buildings stand in.
    """

    title: str
    paper: str
    module: str
    folders: tuple[str, ...]

    @property
    def run(self) -> Callable[[Setting], Outcome]:
        """The function that runs it."""
        found: Callable[[Setting], Outcome] = import_module(
            f"pgm_places.reproduce.{self.module}"
        ).run
        return found


SECTIONS: Mapping[str, PaperSection] = {
    "7.1": PaperSection(
        "Poses by themselves",
        "Building 79, left half to right half, simulated scans, three places: 97.3 % with the "
        "optimal list, room - doorway.",
        "poses",
        ("freiburg079",),
    ),
    "7.3": PaperSection(
        "Topological map",
        "The right half of building 79, labelled, relaxed and corrected: a picture, in which one "
        "doorway between two rooms was not detected.",
        "topology",
        ("freiburg079",),
    ),
    "7.5": PaperSection(
        "Associative Markov network against relaxation",
        "Building 79 at 20 cm: 92.1 % with relaxation, 98.8 % with an AMN; finer cells did not fit "
        "into memory.",
        "resolutions",
        ("freiburg079",),
    ),
}


def chosen_sections(names: tuple[str, ...]) -> tuple[str, ...]:
    """The ids that names stand for, in the order of the paper; all where none is named.

    Raises
    ------
    ConfigError
        A name that is no section.
    """
    for name in names:
        if name not in SECTIONS:
            raise ConfigError(f"no section {name!r}. {nearest_name(name, list(SECTIONS))}")
    return tuple(key for key in SECTIONS if not names or key in names)
