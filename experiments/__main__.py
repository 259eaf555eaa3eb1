"""Run the paper's sections on real buildings and print the tables of docs/results.md.

For a report with pictures, run ``python -m experiments.paper``; its sections are the same.
``--write-docs`` stores the results in ``experiments/sections`` and renews the tables in docs/.
"""

import argparse
import os
import sys
from collections.abc import Iterator
from pathlib import Path

from experiments.page_tables import with_write_docs, write_table
from experiments.paper.markdown import markdown_section
from experiments.paper.run import RECORD, finished_section, reproduce
from experiments.paper.section import Section
from experiments.paper.sections import SECTIONS as SECTIONS_OF_THE_PAPER
from experiments.paper.sections import chosen_sections
from experiments.section_tables import OVERVIEW_TABLE, SUMMARY, paper_table, section_tables
from pgm_places.cli.terminal import LineProgress

FOLDER = Path(__file__).resolve().parent
SECTIONS = FOLDER / "sections"  # what each experiment found last
REPRODUCED = FOLDER / "reproduced"  # sections with pictures, and what they keep: not committed
OF_THE_PAPER = {key: SECTIONS_OF_THE_PAPER[key] for key in chosen_sections(())}
TABLES = (OVERVIEW_TABLE, SUMMARY, *OF_THE_PAPER)


def run_section(key: str, out: Path, *, write: bool) -> None:
    """Rerun a section; ``write`` replaces the recorded one, without pictures."""
    [section] = reproduce([key], out, sections=OF_THE_PAPER, again=True, progress=LineProgress())
    if not section.real:
        sys.exit(f"section {key} did not find all of its real maps; its record is unchanged")
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
    """The tables of the recorded sections, by the names in their marks."""
    sections = kept_sections()
    yield OVERVIEW_TABLE, paper_table(sections)
    yield SUMMARY, paper_table(sections)
    for key, section in sections.items():
        yield key, section_tables(section)


def parser() -> argparse.ArgumentParser:
    """What the command takes."""
    known = [*OF_THE_PAPER, OVERVIEW_TABLE]
    result = argparse.ArgumentParser(prog="python -m experiments", description=__doc__)
    with_write_docs(result)
    result.add_argument(
        "names",
        nargs="*",
        choices=[*known, []],
        metavar="name",
        help=f"some of {', '.join(known)}; all by default",
    )
    result.add_argument(
        "--compose", action="store_true", help="run nothing, write the tables of recorded sections"
    )
    result.add_argument(
        "--out",
        type=Path,
        default=REPRODUCED,
        help="folder for the sections with their pictures, and for cached results (kept/)",
    )
    return result


def main() -> None:
    """Run the named sections, or all, and write their tables."""
    arguments = parser().parse_args()
    if not os.environ.get("PGM_PLACES_DATA") and not arguments.compose:
        sys.exit("set PGM_PLACES_DATA to the folder that holds the real maps")
    groups = {OVERVIEW_TABLE: tuple(OF_THE_PAPER)}
    names = arguments.names or [*OF_THE_PAPER]
    wanted = dict.fromkeys(each for name in names for each in groups.get(name, (name,)))
    for name in () if arguments.compose else wanted:
        print(f"== {name}", flush=True)
        run_section(name, arguments.out, write=arguments.write_docs)
    if arguments.write_docs or arguments.compose:
        for name, text in kept_tables():
            print(f"{name} in {write_table(name, text)}")


if __name__ == "__main__":
    main()
