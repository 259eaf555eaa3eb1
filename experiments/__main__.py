"""Run the experiments on real buildings and write docs/results.md: python -m experiments."""

import argparse
import os
import sys
from pathlib import Path

from pgm_places.comparison import Comparison
from pgm_places.config import load_config
from pgm_places.evaluation import border_tolerant_mask, evaluate
from pgm_places.experiment import Experiment, compare

FOLDER = Path(__file__).resolve().parent
DOCS = FOLDER.parent / "docs"
MAPS = {
    "building79_5cm": "The paper's section 7.1, and 7.5 at the map's own resolution. "
    "The paper reports 97.3 % for its decision list.",
    "building79_20cm": "The paper's section 7.5. "
    "The paper reports 92.1 % with relaxation and 98.8 % with an AMN.",
    "building52_to_79": "A building never seen in training. The paper shows pictures only.",
}
BORDER_M = 0.3


def percent(value: float | None) -> str:
    """A share as percent with one decimal, a dash for none."""
    return "-" if value is None else f"{100 * value:.1f}"


def table(comparison: Comparison) -> str:
    """One row per method, away-from-border accuracy included."""
    lines = [
        "| method | unary | accuracy | balanced | macro F1 | doorway recall | doorway precision "
        f"| accuracy over {BORDER_M:g} m from a border | learn s | infer s |",
        "|---|---|---|---|---|---|---|---|---|---|",
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
            percent(away_from_borders(comparison, method.labelings)),
            f"{method.seconds['learn']:.1f}",
            f"{method.seconds['infer']:.2f}",
        ]
        lines.append("| " + " | ".join(cells) + " |")
    return "\n".join(lines)


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
    check = evaluate(
        comparison.maps[0].layout.from_raster(comparison.maps[0].truth),
        comparison.methods[0].labelings[0].labels,
        comparison.label_names,
    )
    return (
        f"## {comparison.title}\n\n{MAPS[name]}\n"
        f"{check.n:,} test cells have a true label.\n\n"
        "```console\n"
        f"$ PGM_PLACES_DATA=DATA pgm-places compare experiments/{name}.toml --out report\n"
        "```\n\n"
        f"{table(comparison)}\n\nStages, seconds of wall clock: {stages}.\n"
    )


def main() -> None:
    """Run all, or those that are named."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("names", nargs="*", help=f"some of {', '.join(MAPS)}; all by default")
    arguments = parser.parse_args()
    if not os.environ.get("PGM_PLACES_DATA"):
        sys.exit("set PGM_PLACES_DATA to the folder that holds the real maps")
    parts = [(FOLDER / "introduction.md").read_text(encoding="utf-8")]
    for name in arguments.names or MAPS:
        print(f"== {name}", flush=True)
        parts.append(section(name))
        print(parts[-1], flush=True)
    # Written by experiments.trajectories, which takes its own time.
    parts.append((FOLDER / "trajectories.md").read_text(encoding="utf-8"))
    parts.append((FOLDER / "discussion.md").read_text(encoding="utf-8"))
    (DOCS / "results.md").write_text("\n".join(parts), encoding="utf-8")
    print(f"wrote {DOCS / 'results.md'}")


if __name__ == "__main__":
    main()
