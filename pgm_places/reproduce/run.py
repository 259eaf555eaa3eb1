"""Running sections of the paper: finished ones are kept in a folder and not run again."""

import json
import time
from collections.abc import Iterator, Sequence
from pathlib import Path

from pgm_places._version import __version__
from pgm_places.io.atomic import atomic_folder, write_text
from pgm_places.progress import Progress, Silent
from pgm_places.reproduce.html_page import html_page
from pgm_places.reproduce.markdown import markdown_page
from pgm_places.reproduce.section import Section
from pgm_places.reproduce.sections import SECTIONS
from pgm_places.reproduce.setting import Setting, data_folder

__all__ = ["finished_section", "reproduce", "write_pages"]

RECORD = "section.json"
KEPT = "kept"
"""Folder of what experiments keep to go on with."""


def reproduce(
    ids: Sequence[str],
    out: Path,
    *,
    again: bool = False,
    progress: Progress | None = None,
    n_threads: int | None = None,
) -> Iterator[Section]:
    """Each section once it is finished; the pages of all finished ones are written every time.

    Parameters
    ----------
    ids : sequence of str
        Keys of ``SECTIONS``.
    out : Path
        Gets a folder per section, ``reproduce.md`` and ``reproduce.html``, and in ``kept`` what
        long experiments go on with when they were stopped.
    again : bool
        Run finished sections again. Those that another version of the package or
        other buildings gave are always run again.
    progress, n_threads
        Of the experiments.

    Raises
    ------
    PgmPlacesError
        From the experiment; what was finished before stays.
    """
    progress = progress or Silent()
    for key in ids:
        data = data_for(key)
        section = None if again else finished_section(out, key)
        if section is None or section.version != __version__ or section.real != (data is not None):
            section = _run(key, out, Setting(data, progress, n_threads, out / KEPT / key))
        write_pages(out)
        yield section


def data_for(key: str) -> Path | None:
    """The folder of the real data if it holds what a section needs."""
    data = data_folder()
    if data is None or not all((data / name).is_dir() for name in SECTIONS[key].folders):
        return None
    return data


def _run(key: str, out: Path, setting: Setting) -> Section:
    spec = SECTIONS[key]
    start = time.perf_counter()
    found = spec.run(setting)
    section = Section(
        key,
        spec.title,
        spec.paper,
        setting.data is not None,
        time.perf_counter() - start,
        __version__,
        found.setting,
        found.findings,
        found.tables,
        found.pictures,
        found.remarks,
    )
    with atomic_folder(out / key, replaces=_is_section) as folder:
        for name, content in found.files.items():
            (folder / name).write_bytes(content)
        record = json.dumps(section.to_dict(), indent=1, ensure_ascii=False, allow_nan=False)
        (folder / RECORD).write_text(record + "\n", encoding="utf-8")
    return section


def _is_section(folder: Path) -> bool:
    return (folder / RECORD).is_file()


def finished_section(out: Path, key: str) -> Section | None:
    """The section as it was stored; None where it is not there, or not in this form."""
    try:
        content = json.loads((out / key / RECORD).read_text(encoding="utf-8"))
        return Section.from_dict(content)
    except (OSError, ValueError, KeyError, TypeError):
        return None


def write_pages(out: Path) -> list[Path]:
    """Write the pages of all finished sections, in the order of the paper."""
    found = [finished_section(out, key) for key in SECTIONS]
    sections = [section for section in found if section is not None]
    return [
        write_text(out / "reproduce.md", markdown_page(sections)),
        write_text(out / "reproduce.html", html_page(sections, out)),
    ]
