"""Runs the benchmark of rooms on a folder of its maps: ``python -m experiments.rooms FOLDER``."""

import argparse
import json
import sys
from pathlib import Path

from experiments.paper.markdown import markdown_table
from experiments.rooms.results import room_results, room_tables
from pgm_places.errors import PgmPlacesError
from pgm_places.trained import stored_labeler


def main(argv: list[str] | None = None) -> None:
    """A line for each map, then the tables with what others have published."""
    parser = argparse.ArgumentParser(prog="python -m experiments.rooms", description=__doc__)
    parser.add_argument("folder", type=Path, help="maps in the layout of ipa_room_segmentation")
    parser.add_argument("--out", type=Path, default=Path("rooms"), help="folder of the tables")
    parser.add_argument("--threads", type=int)
    arguments = parser.parse_args(argv)
    stored, results = stored_labeler("default"), []
    for item in room_results(
        arguments.folder, stored.item, stored.rules, n_threads=arguments.threads
    ):
        results.append(item)
        rooms = item.rooms
        print(
            f"{item.name}, {item.kind}: recall {100 * rooms.recall:.1f}, precision "
            f"{100 * rooms.precision:.1f}, F1 {100 * rooms.f1:.1f}; {rooms.n_found} rooms found of "
            f"{rooms.n_true}",
            flush=True,
        )
    tables = room_tables(results)
    text = "\n".join(f"{item.caption}:\n\n{markdown_table(item)}" for item in tables)
    arguments.out.mkdir(parents=True, exist_ok=True)
    (arguments.out / "rooms.md").write_text(f"# Rooms\n\n{text}", encoding="utf-8")
    record = json.dumps([item.to_dict() for item in results], indent=1)
    (arguments.out / "rooms.json").write_text(record + "\n", encoding="utf-8")
    print(f"\n{text}")


if __name__ == "__main__":
    try:
        main()
    except PgmPlacesError as error:
        sys.exit(str(error))
