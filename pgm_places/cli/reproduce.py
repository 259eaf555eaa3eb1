"""``pgm-places reproduce``: the paper's experiments, section by section."""

from pathlib import Path
from typing import Annotated

from pgm_places.cli.arguments import Force, Out, Quiet, Threads
from pgm_places.cli.declarations import Argument, Option
from pgm_places.cli.progress import make_progress
from pgm_places.cli.tables import text_table
from pgm_places.cli.terminal import say
from pgm_places.cli.warm_up import WarmUp

__all__ = ["reproduce"]


def reproduce(
    names: Annotated[
        list[str] | None,
        Argument(
            metavar="SECTION...",
            help="Sections such as 7.1 7.5; all by default.",
        ),
    ] = None,
    out: Out = Path("reproduced"),
    again: Annotated[
        bool, Option("--again", help="Rerun sections that have already been run.")
    ] = False,
    force: Force = False,
    n_threads: Threads = None,
    quiet: Quiet = False,
) -> None:
    """Reproduce the experiments of the paper. Writes a page comparing its figures with ours."""
    from pgm_places.io.output_set import claim
    from pgm_places.reproduce.markdown import STAND_IN_WARNING, overview_table
    from pgm_places.reproduce.run import data_for
    from pgm_places.reproduce.run import reproduce as run_sections
    from pgm_places.reproduce.sections import SECTIONS, chosen_sections

    progress = make_progress(quiet=quiet)
    ids = chosen_sections(tuple(names or ()))
    claim(out, force=force)
    if any(data_for(SECTIONS[key]) is None for key in ids):
        progress.warn(f"{STAND_IN_WARNING} Set PGM_PLACES_DATA to the folder of the real data.")
    finished = []
    with WarmUp(["features", "boosting", "relaxation", "amn"], n_threads=n_threads):
        sections = run_sections(
            ids, out, again=again, force=force, progress=progress, n_threads=n_threads
        )
        for section in sections:
            finished.append(section)
            if not quiet:
                say(f"{section.id} {SECTIONS[section.id].title}: {section.seconds:.0f} s")
    table = overview_table(finished)
    say(f"\n{text_table([table.heading, *table.rows])}\n({table.caption})")
    for name in ("reproduce.md", "reproduce.html"):
        say(f"wrote {out / name}")
