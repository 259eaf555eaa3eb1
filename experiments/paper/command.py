"""Sections of the paper, and the table of their figures."""

from collections.abc import Sequence
from pathlib import Path

from experiments.paper.markdown import STAND_IN_WARNING, overview_table
from experiments.paper.run import data_for
from experiments.paper.run import reproduce as run_sections
from experiments.paper.sections import SECTIONS, chosen_sections
from pgm_places.cli.terminal import make_progress, say, text_table
from pgm_places.io.output_set import claim


def reproduce(
    names: Sequence[str],
    out: Path,
    stockholm: Path | None = None,
    *,
    again: bool,
    force: bool,
    n_threads: int | None,
    quiet: bool,
) -> None:
    """Run the named sections, or all, and compare their figures with the paper's."""
    progress = make_progress(quiet=quiet)
    ids = chosen_sections(tuple(names), stockholm=stockholm is not None)
    stand_in = None in {data_for(SECTIONS[key], stockholm) for key in ids}
    claim(out, force=force)
    if stand_in:
        progress.warn(f"{STAND_IN_WARNING} Set PGM_PLACES_DATA to the folder of the real data.")
    finished = []
    sections = run_sections(
        ids,
        out,
        again=again,
        force=force,
        progress=progress,
        n_threads=n_threads,
        stockholm=stockholm,
    )
    for section in sections:
        finished.append(section)
        if not quiet:
            say(f"{section.id} {SECTIONS[section.id].title}: {section.seconds:.0f} s")
    table = overview_table(finished)
    say(f"\n{text_table([table.heading, *table.rows])}\n({table.caption})")
    for name in ("reproduce.md", "reproduce.html"):
        say(f"wrote {out / name}")
