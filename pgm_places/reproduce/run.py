"""Running sections of the paper: finished ones are kept in a folder and not run again."""

import json
import time
from collections.abc import Iterator, Sequence
from pathlib import Path

from pgm_places._version import __version__
from pgm_places.io.atomic import write_bytes, write_text
from pgm_places.io.output_set import claim, output_set
from pgm_places.progress import Progress, Silent
from pgm_places.reproduce.html_page import html_page
from pgm_places.reproduce.markdown import markdown_page
from pgm_places.reproduce.section import Section
from pgm_places.reproduce.sections import SECTIONS
from pgm_places.reproduce.setting import Setting, data_folder

__all__ = ["finished_section", "reproduce"]

RECORD = "section.json"
KEPT = "kept"
"""The folder of intermediate results, from which experiments resume."""


def reproduce(
    ids: Sequence[str],
    out: Path,
    *,
    again: bool = False,
    force: bool = False,
    progress: Progress | None = None,
    n_threads: int | None = None,
) -> Iterator[Section]:
    """Each section once it is finished; the pages of all finished ones are written every time.

    Parameters
    ----------
    ids : sequence of str
        Keys of ``SECTIONS``.
    out : Path
        Receives a folder per section, ``reproduce.md`` and ``reproduce.html``, and in ``kept`` what
        interrupted experiments resume from.
    again : bool
        Run finished sections again. Those from another version of the package or from other
        buildings are always run again.
    force : bool
        Write into a folder that this package did not make, and overwrite files changed there.
    progress, n_threads
        Of the experiments.

    Raises
    ------
    PgmPlacesError
        From the experiment, or because ``out`` is refused; sections finished before are kept.
    """
    progress = progress or Silent()
    claim(out, force=force)
    for key in ids:
        data = data_for(key)
        section = None if again else finished_section(out, key)
        is_new = (
            section is None or section.version != __version__ or section.real != (data is not None)
        )
        with output_set(out, f"section {key}" if is_new else "pages", force=force) as files:
            if section is None or is_new:
                setting = Setting(data, progress, n_threads, out / KEPT / key)
                section = _run(key, files.stage / key, setting)
            _write_pages(files.stage, out)
        yield section


def data_for(key: str) -> Path | None:
    """The folder of the real data if it holds what a section needs."""
    data = data_folder()
    if data is None or not all((data / name).is_dir() for name in SECTIONS[key].folders):
        return None
    return data


def _run(key: str, folder: Path, setting: Setting) -> Section:
    """The section, once its experiment has run and been written to the folder."""
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
    for name, content in found.files.items():
        write_bytes(folder / name, content)
    record = json.dumps(section.to_dict(), indent=1, ensure_ascii=False, allow_nan=False)
    write_text(folder / RECORD, record + "\n")
    return section


def finished_section(out: Path, key: str) -> Section | None:
    """The stored section; None if there is none in the current format."""
    try:
        content = json.loads((out / key / RECORD).read_text(encoding="utf-8"))
        return Section.from_dict(content)
    except (OSError, ValueError, KeyError, TypeError):
        return None


def _write_pages(stage: Path, out: Path) -> None:
    """Write the pages of all finished sections, staged ones included, in the paper's order."""
    found = [finished_section(stage, key) or finished_section(out, key) for key in SECTIONS]
    sections = [section for section in found if section is not None]
    write_text(stage / "reproduce.md", markdown_page(sections))
    write_text(stage / "reproduce.html", html_page(sections, stage, out))
