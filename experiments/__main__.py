"""Run the experiments on real buildings and write docs/results.md: python -m experiments.

The paper's sections are those of ``pgm-places reproduce``; ablations, buildings left out, and the
configurations here are further experiments: ``python -m experiments buildings``.
What each found last is kept in ``experiments/sections``, so that a single one can be rerun.
"""

import argparse
import os
import sys
from pathlib import Path

from experiments.own_sections import ABLATIONS, BUILDINGS
from experiments.paper.figures import BORDER_M, away_from_borders, percent
from experiments.paper.markdown import markdown_section, markdown_table, overview_table
from experiments.paper.run import RECORD, finished_section, reproduce
from experiments.paper.section import Section
from experiments.paper.sections import SECTIONS as OF_THE_PAPER
from pgm_places.cli.progress import LineProgress
from pgm_places.experiment.comparison import Comparison
from pgm_places.experiment.config import load_config
from pgm_places.experiment.experiment import Experiment
from pgm_places.experiment.runs import compare

FOLDER = Path(__file__).resolve().parent
DOCS = FOLDER.parent / "docs"
SECTIONS = FOLDER / "sections"  # what each experiment wrote last
REPRODUCED = (
    FOLDER / "reproduced"
)  # sections with their pictures, and what they keep: not committed
ALL_SECTIONS = {**OF_THE_PAPER, "buildings": BUILDINGS, **ABLATIONS}
MAPS = {
    "building79_spaces": "The paper's split, with the list on laser features alone, with the one "
    "that also sees its neighbourhood, and with the one that also sees segments, gates and places, "
    "by itself and in front of three methods. Segments are those of the whole map, labels those of "
    "its left half.",
    "default_models/without_79": "The default model's training procedure, leaving out all maps of "
    "building 79. The paper's section 7.4 has no figures.",
    "default_models/without_52": "The same with building 52 left out.",
    "default_models/without_saarbruecken": "The same with a building in another town left out; "
    "its labels are polygons, and its wide lobby is labelled corridor.",
    "default_models/generated_to_real": "Trained on generated buildings alone.",
}


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
            percent(away_from_borders(comparison, method)),
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


def section(name: str) -> str:
    """Run one experiment; its section of the page."""
    config = load_config(FOLDER / f"{name}.toml")
    comparison = compare(Experiment(config, FOLDER))
    stages = ", ".join(f"{key} {value:.1f} s" for key, value in comparison.stage_seconds.items())
    n_cells = sum(evaluation.n for evaluation in comparison.methods[0].evaluations)
    return (
        f"## {comparison.title}\n\n{MAPS[name]}\n"
        f"{n_cells:,} test cells have ground truth.\n\n"
        "```console\n"
        f"$ PGM_PLACES_DATA=DATA pgm-places compare experiments/{name}.toml --out report\n"
        "```\n\n"
        f"{table(comparison)}\n{by_map(comparison)}\nStages, wall-clock seconds: {stages}.\n"
    )


def run_section(key: str, out: Path) -> None:
    """Rerun a section; its record without pictures replaces the kept one."""
    [section] = reproduce([key], out, sections=ALL_SECTIONS, again=True, progress=LineProgress())
    if not section.real:
        sys.exit(f"section {key} did not find all of its real maps; the kept one stays")
    record = (out / key / RECORD).read_text(encoding="utf-8")
    (SECTIONS / key).mkdir(exist_ok=True)
    (SECTIONS / key / RECORD).write_text(record, encoding="utf-8")
    print(markdown_section(section, with_pictures=False), flush=True)


def kept_sections() -> list[Section]:
    """The sections that were run at some time, in their order."""
    found = [finished_section(SECTIONS, key) for key in ALL_SECTIONS]
    return [section for section in found if section is not None]


def page() -> str:
    """The whole of docs/results.md from what is kept."""
    paper = kept_sections()
    files = [
        FOLDER / "unseen_kinds.md",
        FOLDER / "teaching.md",
        FOLDER / "studio_actions.md",
        FOLDER / "ablations.md",
        *(_section_file(name) for name in MAPS),
        FOLDER / "room_kinds.md",
        FOLDER / "trajectories.md",
        FOLDER / "tracking_model.md",
        FOLDER / "discussion.md",
    ]
    parts = [
        (FOLDER / "introduction.md").read_text(encoding="utf-8"),
        markdown_table(overview_table(paper)),
        *(markdown_section(section, with_pictures=False) for section in paper),
        *(path.read_text(encoding="utf-8") for path in files if path.exists()),
    ]
    return "\n".join(parts)


def main() -> None:
    """Run all, or those that are named, and compose the page."""
    known = [*ALL_SECTIONS, *MAPS, "ablations"]
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("names", nargs="*", help=f"some of {', '.join(known)}; all by default")
    parser.add_argument("--compose", action="store_true", help="run nothing, only write the page")
    parser.add_argument(
        "--out",
        type=Path,
        default=REPRODUCED,
        help="folder of sections with their pictures, and of what they resume from (kept/)",
    )
    arguments = parser.parse_args()
    if not os.environ.get("PGM_PLACES_DATA") and not arguments.compose:
        sys.exit("set PGM_PLACES_DATA to the folder that holds the real maps")
    unknown = [name for name in arguments.names if name not in known]
    if unknown:
        sys.exit(f"no experiment {unknown[0]}; there are {', '.join(known)}")
    SECTIONS.mkdir(exist_ok=True)
    wanted = dict.fromkeys(arguments.names or [*ALL_SECTIONS, *MAPS])
    if "ablations" in wanted:
        wanted = {**{name: None for name in wanted if name != "ablations"}, **ABLATIONS}
    for name in () if arguments.compose else wanted:
        print(f"== {name}", flush=True)
        if name in ALL_SECTIONS:
            run_section(name, arguments.out)
        else:
            text = section(name)
            _section_file(name).write_text(text, encoding="utf-8")
            print(text, flush=True)
    (DOCS / "results.md").write_text(page(), encoding="utf-8")
    print(f"wrote {DOCS / 'results.md'}")


def _section_file(name: str) -> Path:
    return SECTIONS / f"{Path(name).name}.md"


if __name__ == "__main__":
    main()
