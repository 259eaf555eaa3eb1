"""Run the experiments on real buildings: python -m experiments prints the tables of results.md.

The paper's sections are those of ``python -m experiments.paper``.
``--write-docs`` keeps what each section found in ``experiments/sections`` and renews docs/.
"""

import argparse
import os
import sys
from collections.abc import Iterator
from pathlib import Path

from experiments.page_tables import show_table, text_of, with_write_docs, write_table
from experiments.paper.figures import BORDER_M, away_from_borders, percent
from experiments.paper.markdown import markdown_section
from experiments.paper.run import RECORD, finished_section, reproduce
from experiments.paper.section import Section, Table
from experiments.paper.sections import SECTIONS as SECTIONS_OF_THE_PAPER
from experiments.paper.sections import chosen_sections
from experiments.section_tables import OVERVIEW_TABLE, SUMMARY, paper_table, section_tables
from pgm_places.cli.terminal import LineProgress
from pgm_places.evaluation.evaluation import Evaluation
from pgm_places.experiment.comparison import Comparison
from pgm_places.experiment.config import load_config
from pgm_places.experiment.experiment import Experiment
from pgm_places.experiment.runs import compare

FOLDER = Path(__file__).resolve().parent
SECTIONS = FOLDER / "sections"  # what each experiment found last
REPRODUCED = FOLDER / "reproduced"  # sections with pictures, and what they keep: not committed
OF_THE_PAPER = {key: SECTIONS_OF_THE_PAPER[key] for key in chosen_sections(())}
MAPS = {
    "seen": "building79_spaces.toml",
    "without_79": "default_models/without_79.toml",
    "without_52": "default_models/without_52.toml",
    "without_saarbruecken": "default_models/without_saarbruecken.toml",
    "generated_to_real": "default_models/generated_to_real.toml",
}
"""Configurations whose comparison is a table."""

TABLES = (OVERVIEW_TABLE, SUMMARY, *OF_THE_PAPER, *MAPS)


def comparison_table(comparison: Comparison) -> Table:
    """A row per map and a column per method; a row per method where there is one map."""
    if len(comparison.maps) == 1:
        return _by_method(comparison)
    rows = [("all", *(_figures(method.evaluation) for method in comparison.methods))]
    rows += [
        (item.name, *(_figures(method.evaluations[k]) for method in comparison.methods))
        for k, item in enumerate(comparison.maps)
    ]
    return Table("", ("map", *(method.id for method in comparison.methods)), tuple(rows))


def _by_method(comparison: Comparison) -> Table:
    columns = ("accuracy", "balanced", "doorway recall", "doorway precision", "doorway F1")
    rows = [
        (
            method.id,
            percent(method.evaluation.accuracy),
            percent(method.evaluation.balanced_accuracy),
            percent(method.evaluation.recall["doorway"]),
            percent(method.evaluation.precision["doorway"]),
            percent(method.evaluation.f1["doorway"]),
            percent(away_from_borders(comparison, method)),
        )
        for method in comparison.methods
    ]
    return Table("", ("method", *columns, f"over {BORDER_M:g} m from a border"), tuple(rows))


def _figures(found: Evaluation) -> str:
    figures = (found.accuracy, found.balanced_accuracy, found.f1["doorway"])
    return " / ".join(map(percent, figures))


def run_section(key: str, out: Path, *, write: bool) -> None:
    """Rerun a section; if asked to, its record without pictures replaces the kept one."""
    [section] = reproduce([key], out, sections=OF_THE_PAPER, again=True, progress=LineProgress())
    if not section.real:
        sys.exit(f"section {key} did not find all of its real maps; the kept one stays")
    if write:
        record = (out / key / RECORD).read_text(encoding="utf-8")
        (SECTIONS / key).mkdir(exist_ok=True)
        (SECTIONS / key / RECORD).write_text(record, encoding="utf-8")
    print(markdown_section(section, with_pictures=False), flush=True)


def kept_sections() -> dict[str, Section]:
    """The sections that were run at some time, in their order."""
    found = {key: finished_section(SECTIONS, key) for key in OF_THE_PAPER}
    return {key: section for key, section in found.items() if section is not None}


def kept_tables() -> Iterator[tuple[str, str]]:
    """The tables of what is kept, by the names in their marks."""
    sections = kept_sections()
    yield OVERVIEW_TABLE, paper_table(sections)
    yield SUMMARY, paper_table(sections)
    for key, section in sections.items():
        yield key, section_tables(section)


def parser() -> argparse.ArgumentParser:
    """What the command takes."""
    known = [*OF_THE_PAPER, *MAPS, OVERVIEW_TABLE]
    found = argparse.ArgumentParser(prog="python -m experiments", description=__doc__)
    with_write_docs(found)
    found.add_argument(
        "names",
        nargs="*",
        choices=[*known, []],
        metavar="name",
        help=f"some of {', '.join(known)}; all by default",
    )
    found.add_argument(
        "--compose", action="store_true", help="run nothing, write the tables of what is kept"
    )
    found.add_argument(
        "--out",
        type=Path,
        default=REPRODUCED,
        help="folder of sections with their pictures, and of what they resume from (kept/)",
    )
    return found


def main() -> None:
    """Run all, or those that are named, and write their tables."""
    given = parser().parse_args()
    if not os.environ.get("PGM_PLACES_DATA") and not given.compose:
        sys.exit("set PGM_PLACES_DATA to the folder that holds the real maps")
    groups = {OVERVIEW_TABLE: tuple(OF_THE_PAPER)}
    names = given.names or [*OF_THE_PAPER, *MAPS]
    wanted = dict.fromkeys(each for name in names for each in groups.get(name, (name,)))
    for name in () if given.compose else wanted:
        print(f"== {name}", flush=True)
        if name in OF_THE_PAPER:
            run_section(name, given.out, write=given.write_docs)
        else:
            comparison = compare(Experiment(load_config(FOLDER / MAPS[name]), FOLDER))
            show_table(name, text_of([comparison_table(comparison)]), write=given.write_docs)
    if given.write_docs or given.compose:
        for name, text in kept_tables():
            print(f"{name} in {write_table(name, text)}")


if __name__ == "__main__":
    main()
