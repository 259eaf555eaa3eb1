"""The kind of a file, by its first bytes; files of another kind are not overwritten."""

import json
import re
from pathlib import Path

from pgm_places.errors import OutputError

HEAD = 64 << 10
"""Bytes that are read to determine the kind."""

_MAGIC = {
    b"\x89PNG\r\n\x1a\n": "a PNG",
    b"P5": "a PGM",
    b"P2": "a PGM",
    b"II*\0": "a TIFF",
    b"MM\0*": "a TIFF",
    b"\xff\xd8": "a JPEG",
    b"BM": "a BMP",
    b"PK\x03\x04": "an archive",
    b"%PDF": "a PDF",
}
_PNG_COLOURS = {0: "grey", 2: "colour", 3: "indexed", 4: "grey", 6: "colour"}
_KEY = re.compile(r"^(\w+)[ \t]*:", re.MULTILINE)
_FORMAT = re.compile(r'"(?:format|type)"\s*:\s*("(?:[^"\\]|\\.)*")')


def kind_of(head: bytes) -> str:
    r"""The kind of a file by its first bytes.

    Examples
    --------
    >>> kind_of(b"image: map.pgm\nresolution: 0.05\n"), kind_of(b"values:\n  room: 77\n")
    ('the description of a map', 'a file of label names')
    """
    for magic, name in _MAGIC.items():
        if head.startswith(magic):
            kind = _PNG_COLOURS.get(head[25]) if name == "a PNG" and len(head) > 25 else None
            return f"{name} ({kind})" if kind else name
    if b"\0" in head:
        return "a binary file"
    text = head.decode("utf-8", "replace").lstrip("\ufeff \t\r\n")
    if text.startswith("{"):
        if len(head) < HEAD and not _is_json(text):
            return ""  # damaged
        match = _FORMAT.search(text)
        return f"JSON ({json.loads(match[1], strict=False)})" if match else "JSON"
    keys = set(_KEY.findall(text))
    if {"image", "resolution"} <= keys:
        return "the description of a map"
    return "a file of label names" if "values" in keys else "text"


def _is_json(text: str) -> bool:
    try:
        json.loads(text)
    except (ValueError, RecursionError):
        return False
    return True


def refuse_another_kind(path: Path, new: bytes) -> None:
    """Refuse to overwrite a file of another kind; an empty or damaged file may be overwritten.

    Raises
    ------
    OutputError
        The file would be lost.
    """
    try:
        with path.open("rb") as file:
            old = file.read(HEAD)
    except OSError:  # no file, or an unreadable one, which the writer will report
        return
    there, coming = kind_of(old), kind_of(new[:HEAD])
    if old and there and there != coming:
        raise OutputError(
            f"cannot overwrite {path}: it is {there}, and {coming} would take its place; choose "
            "another name, or move the file away"
        )
