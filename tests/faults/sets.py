"""Small sets of files, each file telling which run wrote it, and whether a folder holds one set."""

import hashlib
import json
from pathlib import Path

from pgm_places.io.atomic import tidy, write_text
from pgm_places.io.output_set import RECORD_FILE, output_set

SETS = {"old": ("a.txt", "b.txt", "only_old.txt", "bag/one"), "new": ("a.txt", "b.txt", "bag/one")}


def write_set(folder: Path, name: str, *, shared: bool = False) -> None:
    """Write one of the two sets into a folder."""
    with output_set(folder, "test", names=SETS[name], shared=shared) as files:
        for path in SETS[name]:
            write_text(files.stage / path, name)


def content(folder: Path) -> dict[str, str]:
    """What every file of a folder holds, but for stages and records."""
    return {
        path.relative_to(folder).as_posix(): path.read_text()
        for path in sorted(folder.rglob("*"))
        if path.is_file() and not path.relative_to(folder).parts[0].startswith(".")
    }


def whole(folder: Path, *users: str) -> str:
    """The name of the one set that a folder holds, besides files of the user."""
    tidy(folder)
    found = content(folder)
    for name in users:
        assert found.pop(name) == "mine"
    [name] = set(found.values())
    assert set(found) == set(SETS[name])
    check_record(folder)
    return name


def check_record(folder: Path) -> None:
    """The record of a folder lists exactly the files as they are."""
    files = json.loads((folder / RECORD_FILE).read_text())["files"]
    assert files
    for name, entry in files.items():
        assert hashlib.sha256((folder / name).read_bytes()).hexdigest() == entry["sha256"], name
