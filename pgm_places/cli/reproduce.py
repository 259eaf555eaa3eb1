"""``pgm-places reproduce``: the paper's experiments, section by section."""

import json
from pathlib import Path
from typing import Annotated

from pgm_places.cli.arguments import Force, Out, Quiet, Threads
from pgm_places.cli.declarations import Argument, Option
from pgm_places.cli.progress import make_progress
from pgm_places.cli.tables import text_table
from pgm_places.cli.terminal import say, say_written
from pgm_places.cli.warm_up import WarmUp
from pgm_places.errors import InputError

__all__ = ["reproduce"]

ROOM_FILES = ("rooms.md", "rooms.json")


def reproduce(
    names: Annotated[
        list[str] | None,
        Argument(
            metavar="SECTION...",
            help="Sections such as 7.1 7.5; all by default. Or 'rooms' and a folder of Bormann et "
            "al.'s maps of rooms.",
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
    if names and names[0] == "rooms":
        _rooms(names[1:], out, force=force, n_threads=n_threads, quiet=quiet)
        return
    from pgm_places.io.output_set import claim
    from pgm_places.reproduce.overview import STAND_IN_WARNING, overview_table
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


def _rooms(
    folders: list[str], out: Path, *, force: bool, n_threads: int | None, quiet: bool
) -> None:
    """The benchmark of rooms: a line for each map, then the table with others beside."""
    if len(folders) != 1:
        raise InputError(
            "'rooms' wants one folder of maps: pgm-places reproduce rooms FOLDER; got "
            f"{' '.join(folders) or 'none'}"
        )
    from pgm_places.io.atomic import write_text
    from pgm_places.io.output_set import output_set
    from pgm_places.reproduce.markdown import markdown_table
    from pgm_places.reproduce.rooms import room_results, room_tables
    from pgm_places.trained import stored_labeler

    stored, results = stored_labeler("default"), []
    with output_set(out, "rooms", names=ROOM_FILES, force=force) as files:
        for item in room_results(Path(folders[0]), stored.item, stored.rules, n_threads=n_threads):
            results.append(item)
            if not quiet:
                rooms = item.rooms
                say(
                    f"{item.name}, {item.kind}: recall {100 * rooms.recall:.1f}, precision "
                    f"{100 * rooms.precision:.1f}, F1 {100 * rooms.f1:.1f}; {rooms.n_found} rooms "
                    f"found of {rooms.n_true}"
                )
        tables = room_tables(results)
        text = "\n".join(f"{item.caption}:\n\n{markdown_table(item)}" for item in tables)
        write_text(files.stage / ROOM_FILES[0], f"# Rooms\n\n{text}")
        record = json.dumps([item.to_dict() for item in results], indent=1)
        write_text(files.stage / ROOM_FILES[1], record + "\n")
    table = tables[0]
    say(f"\n{text_table([table.heading, *table.rows])}\n({table.caption})")
    say_written(files)
