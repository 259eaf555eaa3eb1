"""``pgm-places reproduce``: the paper's experiments, section by section."""

from pathlib import Path

from pgm_places.cli.progress import make_progress
from pgm_places.cli.tables import text_table
from pgm_places.cli.terminal import say
from pgm_places.cli.warm_up import WarmUp

__all__ = ["run_reproduce"]


def run_reproduce(
    names: tuple[str, ...],
    out: Path,
    *,
    again: bool,
    force: bool,
    n_threads: int | None,
    quiet: bool,
) -> None:
    """Run the sections, say what each found as soon as it is known, and the whole table last."""
    from pgm_places.io.output_set import claim
    from pgm_places.reproduce.overview import STAND_IN_WARNING, overview_table
    from pgm_places.reproduce.run import data_for, reproduce
    from pgm_places.reproduce.sections import SECTIONS, chosen_sections

    progress = make_progress(quiet=quiet)
    ids = chosen_sections(names)
    claim(out, force=force)
    if any(data_for(key) is None for key in ids):
        progress.warn(f"{STAND_IN_WARNING} Set PGM_PLACES_DATA to the folder of the real data.")
    found = []
    with WarmUp(["features", "boosting", "relaxation", "amn"], n_threads=n_threads):
        sections = reproduce(
            ids, out, again=again, force=force, progress=progress, n_threads=n_threads
        )
        for section in sections:
            found.append(section)
            if not quiet:
                say(f"{section.id} {SECTIONS[section.id].title}: {section.seconds:.0f} s")
    table = overview_table(found)
    say(f"\n{text_table([table.heading, *table.rows])}\n({table.caption})")
    for name in ("reproduce.md", "reproduce.html"):
        say(f"wrote {out / name}")
