"""Correction of a map's description whose free_thresh reads unknown cells as free."""

import re
from pathlib import Path

from pgm_places.errors import MapError, OutputError
from pgm_places.io.atomic import write_bytes
from pgm_places.io.input_file import user_path
from pgm_places.io.maps.map_pixels import FREE_THRESH
from pgm_places.io.strict_yaml import MAX_BYTES, read_yaml
from pgm_places.io.text_file import read_bytes

__all__ = ["KEPT_SUFFIX", "correct_free_thresh"]

KEPT_SUFFIX = ".orig"
"""What the name of the file as it was ends with; no search for maps finds it."""

_LINE = re.compile(rb"^(?P<key>free_thresh[ \t]*:[ \t]+)(?P<value>[^\s]+)", re.MULTILINE)


def correct_free_thresh(path: Path | str) -> Path:
    """Set ``free_thresh: 0.196`` in a map's YAML file; the path of the file as it was.

    Nothing else of the file changes, comments included. The file as it was stays beside it, under
    its name with ``.orig`` appended.

    Raises
    ------
    MapError
        The file is no map's description, or does not have the key on a line of its own.
    OutputError
        There is an earlier ``.orig``, or a file cannot be written.
    """
    yaml_path, what = user_path(path, MapError), "the map description (YAML)"
    stated = read_yaml(yaml_path, MapError, "map description").text("free_thresh")
    old = read_bytes(yaml_path, MapError, what, max_bytes=MAX_BYTES)
    found = [line["value"] for line in _LINE.finditer(old)]
    if found != [stated.encode()]:
        raise MapError(
            f"{yaml_path}: the key free_thresh is not on a line of its own; set free_thresh: "
            f"{FREE_THRESH} by hand"
        )
    kept = yaml_path.with_name(yaml_path.name + KEPT_SUFFIX)
    if kept.exists() or kept.is_symlink():
        raise OutputError(f"{kept} exists and would be lost; move it away first")
    write_bytes(kept, old)
    write_bytes(yaml_path, _LINE.sub(rb"\g<key>" + str(FREE_THRESH).encode(), old))
    return kept
