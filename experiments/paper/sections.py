"""The sections of the paper by number."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from importlib import import_module
from pathlib import Path

from experiments.paper.section import Outcome
from experiments.paper.setting import CONFIGS, Setting
from pgm_places.errors import ConfigError, nearest_name


@dataclass(frozen=True)
class PaperSection:
    """An experiment: what the paper says, what it needs, and where its function is.

    Parameters
    ----------
    title, paper : str
        Its name, and what the paper says; nothing for experiments that are not the paper's.
    function : str
        ``"module:function"``; imported when it is run.
    folders : tuple of str
        Folders of the real data without which generated buildings stand in.
    configs : Path
        The folder of its configurations.
    of_stockholm : bool
        Whether the folders are those of COLD-Stockholm, for which nothing stands in.
    """

    title: str
    paper: str
    function: str
    folders: tuple[str, ...]
    configs: Path = CONFIGS
    of_stockholm: bool = False

    @property
    def run(self) -> Callable[[Setting], Outcome]:
        """The function that runs it."""
        module, _, name = self.function.partition(":")
        run: Callable[[Setting], Outcome] = getattr(import_module(module), name)
        return run


SECTIONS: Mapping[str, PaperSection] = {
    "7.1": PaperSection(
        "Single poses",
        "Building 79, left half to right half, simulated scans, three places: 97.3 % with the "
        "optimal list, room - doorway.",
        "experiments.paper.poses:run",
        ("freiburg079",),
    ),
    "7.2": PaperSection(
        "Trajectories with a hidden Markov model",
        "Building 79, right half to left half, real laser and vision, six categories: 75.4 % for "
        "single observations, 91.2 % with the hidden Markov model.",
        "experiments.paper.categories:run",
        ("freiburg079",),
    ),
    "7.3": PaperSection(
        "Topological map",
        "The right half of building 79, labelled, relaxed and corrected: a picture, in which one "
        "doorway between two rooms was not detected.",
        "experiments.paper.topology:run",
        ("freiburg079",),
    ),
    "7.4": PaperSection(
        "Unknown environments",
        "Building 52 to the Intel Research Lab, and buildings 79 and 52 to the topological map of "
        "SDR site B: pictures, no figures.",
        "experiments.paper.transfer:run",
        (
            "freiburg079",
            "freiburg052",
            "intel",
            *(f"cold_saarbrucken_seq{number}" for number in range(1, 5)),
        ),
    ),
    "7.5": PaperSection(
        "Associative Markov network against relaxation",
        "Building 79 at 20 cm: 92.1 % with relaxation, 98.8 % with an AMN; finer cells did not fit "
        "into memory.",
        "experiments.paper.resolutions:run",
        ("freiburg079",),
    ),
    "7.5-fine": PaperSection(
        "The same down to 2 cm",
        "nothing finer than 20 cm, for lack of memory.",
        "experiments.paper.resolutions:fine",
        ("cold_freiburg_seq2",),
    ),
    "7.6": PaperSection(
        "Restricted field of view",
        "A front laser, rear beams from a local map, the 6th floor to the 7th of a building at "
        "KTH: 84.4 %.",
        "experiments.paper.front_laser:run",
        tuple(f"cold_saarbrucken_seq{number}" for number in range(1, 5)),
    ),
    "7.6-kth": PaperSection(
        "Restricted field of view, the paper's floors",
        "The 6th floor to the 7th of a building at KTH: 84.4 %.",
        "experiments.paper.front_laser:kth",
        ("cold_stockholm_floor6", "cold_stockholm_floor7"),
        of_stockholm=True,
    ),
}


def chosen_sections(names: tuple[str, ...], *, stockholm: bool = False) -> tuple[str, ...]:
    """The ids that names stand for, in the order of the paper; all where none is named.

    7.6 has a part that needs COLD-Stockholm; ``stockholm`` says whether that is there.

    Raises
    ------
    ConfigError
        A name that is no section.
    """
    for name in names:
        if name not in SECTIONS:
            raise ConfigError(f"no section {name!r}. {nearest_name(name, list(SECTIONS))}")
    wanted = {*(names or SECTIONS)}
    if stockholm and "7.6" in wanted:
        wanted.add("7.6-kth")
    if not stockholm and not names:
        wanted.discard("7.6-kth")
    return tuple(key for key in SECTIONS if key in wanted)
