"""Experiments beyond the paper's, run and recorded like its sections."""

from collections.abc import Mapping
from pathlib import Path

from experiments.paper.sections import PaperSection

_CONFIGS = Path(__file__).resolve().parent / "ablations" / "configs"
_ABLATIONS = (
    ("features", "Ablation: features", "settings:features", ()),
    ("beams", "Ablation: beams", "settings:beams", ()),
    ("resolution", "Ablation: resolution", "settings:resolution", ()),
    ("noise", "Ablation: noisy beams", "settings:noise", ()),
    ("choices", "Choices on held-out cells", "choices:run", ()),
    ("training-size", "Ablation: training size", "settings:training_size", ()),
    ("furniture", "Ablation: furniture", "other_maps:furniture", ("freiburg079_drawn",)),
    ("partial-maps", "Ablation: partial maps", "other_maps:partial_maps", ("freiburg079_partial",)),
)
"""Name, title, function, and folders of the real data besides building 79."""

ABLATIONS: Mapping[str, PaperSection] = {
    key: PaperSection(
        title, "", f"experiments.ablations.{function}", ("freiburg079", *folders), _CONFIGS
    )
    for key, title, function, folders in _ABLATIONS
}

BUILDINGS = PaperSection(
    "Buildings left out",
    "",
    "experiments.buildings.section:run",
    (
        "floors",
        "freiburg079",
        "freiburg079_drawn",
        "freiburg052",
        *(f"cold_freiburg_seq{number}" for number in range(1, 4)),
        *(f"cold_saarbrucken_seq{number}" for number in range(1, 5)),
    ),
)
