"""The experiments by name: the paper's sections, and ablations."""

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
        Its name, and what the paper says; nothing for ablations, which are not the paper's.
    function : str
        ``"module:function"`` in ``pgm_places.reproduce``; imported when it is run.
    folders : tuple of str
        Folders of the real data without which generated buildings stand in.
    """

    title: str
    paper: str
    function: str
    folders: tuple[str, ...]

    @property
    def run(self) -> Callable[[Setting], Outcome]:
        """The function that runs it."""
        module, _, name = self.function.partition(":")
        found: Callable[[Setting], Outcome] = getattr(
            import_module(f"pgm_places.reproduce.{module}"), name
        )
        return found


ALL_ABLATIONS = "ablations"
_ABLATIONS: tuple[tuple[str, str, str, tuple[str, ...]], ...] = (
    ("features", "Ablation: features", "ablations:features", ()),
    ("beams", "Ablation: beams", "ablations:beams", ()),
    ("resolution", "Ablation: resolution", "ablations:resolution", ()),
    ("noise", "Ablation: noisy beams", "ablations:noise", ()),
    ("choices", "Choices on held-out cells", "choices:run", ()),
    ("training-size", "Ablation: training size", "ablations:training_size", ()),
    ("furniture", "Ablation: furniture", "other_maps:furniture", ("freiburg079_drawn",)),
    ("partial-maps", "Ablation: partial maps", "other_maps:partial_maps", ("freiburg079_partial",)),
)
"""Name, title, function, and folders of the real data besides building 79."""

SECTIONS: Mapping[str, PaperSection] = {
    "7.1": PaperSection(
        "Single poses",
        "Building 79, left half to right half, simulated scans, three places: 97.3 % with the "
        "optimal list, room - doorway.",
        "poses:run",
        ("freiburg079",),
    ),
    "7.2": PaperSection(
        "Trajectories with a hidden Markov model",
        "Building 79, right half to left half, real laser and vision, six categories: 75.4 % for "
        "single observations, 91.2 % with the hidden Markov model.",
        "categories:run",
        ("freiburg079",),
    ),
    "7.3": PaperSection(
        "Topological map",
        "The right half of building 79, labelled, relaxed and corrected: a picture, in which one "
        "doorway between two rooms was not detected.",
        "topology:run",
        ("freiburg079",),
    ),
    "7.4": PaperSection(
        "Unknown environments",
        "Building 52 to the Intel Research Lab, and buildings 79 and 52 to the topological map of "
        "SDR site B: pictures, no figures.",
        "transfer:run",
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
        "resolutions:run",
        ("freiburg079",),
    ),
    "7.5-fine": PaperSection(
        "The same down to 2 cm",
        "nothing finer than 20 cm, for lack of memory.",
        "resolutions:fine",
        ("cold_freiburg_seq2",),
    ),
    "7.6": PaperSection(
        "Restricted field of view",
        "A front laser, rear beams from a local map, the 6th floor to the 7th of a building at "
        "KTH: 84.4 %.",
        "front_laser:run",
        tuple(f"cold_saarbrucken_seq{number}" for number in range(1, 5)),
    ),
    "buildings": PaperSection(
        "Buildings left out",
        "",
        "buildings:run",
        (
            "floors",
            "freiburg079",
            "freiburg079_drawn",
            "freiburg052",
            *(f"cold_freiburg_seq{number}" for number in range(1, 4)),
            *(f"cold_saarbrucken_seq{number}" for number in range(1, 5)),
        ),
    ),
    **{
        key: PaperSection(title, "", function, ("freiburg079", *folders))
        for key, title, function, folders in _ABLATIONS
    },
}


def chosen_sections(names: tuple[str, ...]) -> tuple[str, ...]:
    """The ids that names stand for, in the order of the paper; its sections where none is named.

    ``"ablations"`` stands for all of these.

    Raises
    ------
    ConfigError
        A name that is no section.
    """
    ablations = {key for key, *_ in _ABLATIONS}
    of_paper = {key for key, section in SECTIONS.items() if section.paper}
    wanted = set(names) - {ALL_ABLATIONS} if names else of_paper
    for name in sorted(wanted):
        if name not in SECTIONS:
            known = [*SECTIONS, ALL_ABLATIONS]
            raise ConfigError(f"no section {name!r}. {nearest_name(name, known)}")
    if ALL_ABLATIONS in names:
        wanted |= ablations
    return tuple(key for key in SECTIONS if key in wanted)
