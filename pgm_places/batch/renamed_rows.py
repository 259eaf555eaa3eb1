"""New names of places in what a batch says of their map: its manifest, and its row of the index."""

import json
from pathlib import Path

from pgm_places.batch.batch_folder import batch_of
from pgm_places.batch.batch_index import BatchIndex
from pgm_places.batch.map_task import labelled_row, manifest_record
from pgm_places.io.atomic import write_text
from pgm_places.io.places.result_folder import MANIFEST_FILE


def write_check_first(folder: Path, stage: Path, old: str, new: str) -> bool:
    """Write a map's manifest with a place's new name, where it is the place to check first."""
    record = manifest_record(folder)
    if record is None or record.get("figures", {}).get("check_first") != old:
        return False
    record["figures"]["check_first"] = new
    path = stage / MANIFEST_FILE
    path.parent.mkdir(exist_ok=True)
    write_text(path, json.dumps(record, indent=1, allow_nan=False) + "\n")
    return True


def write_row_again(folder: Path) -> None:
    """Write a map's row and the page of the batch that it belongs to, if it belongs to one.

    Raises
    ------
    OutputError
        The lists cannot be written.
    """
    out = batch_of(folder)
    if out is None:
        return
    row = labelled_row(folder, folder.resolve().relative_to(out).as_posix())
    if row is not None:
        lists = BatchIndex(out)
        lists.begin()
        lists.add(row)
        lists.end(lists.settle)
