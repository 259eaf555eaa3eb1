"""Run the experiments on real buildings and write docs/results.md: python -m experiments."""

import argparse
import os
import sys
from pathlib import Path

from pgm_places.comparison import Comparison
from pgm_places.config import load_config
from pgm_places.evaluation import border_tolerant_mask
from pgm_places.experiment import Experiment, compare

FOLDER = Path(__file__).resolve().parent
DOCS = FOLDER.parent / "docs"
SECTIONS = FOLDER / "sections"  # what each experiment wrote last
MAPS = {
    "building79_5cm": "The paper's section 7.1, and 7.5 at the map's own resolution. "
    "The paper reports 97.3 % for its decision list.",
    "building79_20cm": "The paper's section 7.5. "
    "The paper reports 92.1 % with relaxation and 98.8 % with an AMN.",
    "building52_to_79": "A building never seen in training. The paper shows pictures only.",
    "default_models/without_79": "The default model's way of learning, with everything of building "
    "79 left out. The paper's section 7.4 has no figures.",
    "default_models/without_52": "The same with building 52 left out.",
    "default_models/without_saarbruecken": "The same with another town's building left out; its "
    "labels are polygons, and its wide lobby is called a corridor.",
    "default_models/generated_to_real": "Learned on generated buildings alone.",
}
BORDER_M = 0.3


def percent(value: float | None) -> str:
    """A share as percent with one decimal, a dash for none."""
    return "-" if value is None else f"{100 * value:.1f}"


def table(comparison: Comparison) -> str:
    """One row per method, away-from-border accuracy included."""
    lines = [
        "| method | unary | accuracy | balanced | macro F1 | doorway recall | doorway precision "
        f"| doorway F1 | accuracy over {BORDER_M:g} m from a border | learn s | infer s |",
        "|---|---|---|---|---|---|---|---|---|---|---|",
    ]
    for method in comparison.methods:
        found = method.evaluation
        cells = [
            f"`{method.id}`",
            str(method.options.get("unary", "-")),
            percent(found.accuracy),
            percent(found.balanced_accuracy),
            percent(found.macro_f1),
            percent(found.recall["doorway"]),
            percent(found.precision["doorway"]),
            percent(found.f1["doorway"]),
            percent(away_from_borders(comparison, method.labelings)),
            f"{method.seconds['learn']:.1f}",
            f"{method.seconds['infer']:.2f}",
        ]
        lines.append("| " + " | ".join(cells) + " |")
    return "\n".join(lines)


def by_map(comparison: Comparison) -> str:
    """Accuracy, balanced accuracy and doorways per map, where there are several."""
    if len(comparison.maps) < 2:
        return ""
    lines = [
        "| map | " + " | ".join(f"`{method.id}`" for method in comparison.methods) + " |",
        "|---|" + "---|" * len(comparison.methods),
    ]
    for index, item in enumerate(comparison.maps):
        cells = []
        for method in comparison.methods:
            found = method.evaluations[index]
            cells.append(
                f"{percent(found.accuracy)} / {percent(found.balanced_accuracy)}, doorway F1 "
                f"{percent(found.f1['doorway'])}"
            )
        lines.append(f"| {item.name} | " + " | ".join(cells) + " |")
    return "\nAccuracy / balanced accuracy of each map:\n\n" + "\n".join(lines) + "\n"


def away_from_borders(comparison: Comparison, labelings: tuple) -> float:  # type: ignore[type-arg]
    """The accuracy on cells that are not close to a border between two true labels."""
    right = total = 0
    for item, labeling in zip(comparison.maps, labelings, strict=True):
        inside = border_tolerant_mask(item.truth, item.grid.resolution_m, tolerance_m=BORDER_M)
        truth = item.layout.from_raster(item.truth)
        chosen = item.layout.from_raster(inside) & (truth >= 0)
        right += int((labeling.labels[chosen] == truth[chosen]).sum())
        total += int(chosen.sum())
    return right / max(total, 1)


def section(name: str) -> str:
    """Run one experiment; its section of the page."""
    config = load_config(FOLDER / f"{name}.toml")
    comparison = compare(Experiment(config, FOLDER))
    stages = ", ".join(f"{key} {value:.1f} s" for key, value in comparison.stage_seconds.items())
    n_cells = sum(evaluation.n for evaluation in comparison.methods[0].evaluations)
    return (
        f"## {comparison.title}\n\n{MAPS[name]}\n"
        f"{n_cells:,} test cells have a true label.\n\n"
        "```console\n"
        f"$ PGM_PLACES_DATA=DATA pgm-places compare experiments/{name}.toml --out report\n"
        "```\n\n"
        f"{table(comparison)}\n{by_map(comparison)}\nStages, seconds of wall clock: {stages}.\n"
    )


def main() -> None:
    """Run all, or those that are named."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("names", nargs="*", help=f"some of {', '.join(MAPS)}; all by default")
    arguments = parser.parse_args()
    if not os.environ.get("PGM_PLACES_DATA"):
        sys.exit("set PGM_PLACES_DATA to the folder that holds the real maps")
    SECTIONS.mkdir(exist_ok=True)
    for name in arguments.names or MAPS:
        print(f"== {name}", flush=True)
        text = section(name)
        _section_file(name).write_text(text, encoding="utf-8")
        print(text, flush=True)
    files = [
        FOLDER / "introduction.md",
        *(_section_file(name) for name in MAPS),
        FOLDER / "trajectories.md",
        FOLDER / "discussion.md",
    ]
    parts = [path.read_text(encoding="utf-8") for path in files if path.exists()]
    (DOCS / "results.md").write_text("\n".join(parts), encoding="utf-8")
    print(f"wrote {DOCS / 'results.md'}")


def _section_file(name: str) -> Path:
    return SECTIONS / f"{Path(name).name}.md"


if __name__ == "__main__":
    main()
