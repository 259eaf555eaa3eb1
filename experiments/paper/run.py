"""Running sections of the paper: finished ones are stored in a folder and not run again."""

import json
import time
from collections.abc import Iterable, Iterator, Mapping, Sequence
from pathlib import Path

from experiments.paper.html_page import html_page
from experiments.paper.markdown import markdown_page
from experiments.paper.section import Section
from experiments.paper.sections import SECTIONS, PaperSection
from experiments.paper.setting import Setting, data_folder
from pgm_places._version import __version__
from pgm_places.errors import ConfigError
from pgm_places.io.atomic import write_bytes, write_text
from pgm_places.io.output_set import claim, output_set
from pgm_places.progress import Progress, Silent

RECORD = "section.json"
KEPT = "kept"
"""The folder of intermediate results, from which experiments resume."""


def reproduce(
    ids: Sequence[str],
    out: Path,
    *,
    sections: Mapping[str, PaperSection] = SECTIONS,
    again: bool = False,
    force: bool = False,
    progress: Progress | None = None,
    n_threads: int | None = None,
    stockholm: Path | None = None,
) -> Iterator[Section]:
    """Each section once it is finished; the pages of all finished ones are written every time.

    Parameters
    ----------
    ids : sequence of str
        Keys of ``sections``.
    out : Path
        Receives a folder per section, ``reproduce.md`` and ``reproduce.html``, and in ``kept`` what
        interrupted experiments resume from.
    sections : mapping of str to PaperSection
        The paper's sections by default; pages list them in this order.
    again : bool
        Run finished sections again. Those from another version of the package or from other
        buildings are always run again.
    force : bool
        Write into a folder that this package did not make, and overwrite files changed there.
    progress, n_threads
        Of the experiments.
    stockholm : Path, optional
        The folder of COLD-Stockholm.

    Raises
    ------
    PgmPlacesError
        From the experiment, or because ``out`` is refused; sections finished before are kept.
    """
    progress = progress or Silent()
    claim(out, force=force)
    for key in ids:
        spec = sections[key]
        data = data_for(spec, stockholm)
        section = None if again else finished_section(out, key)
        is_new = (
            section is None or section.version != __version__ or section.real != (data is not None)
        )
        with output_set(out, f"section {key}" if is_new else "pages", force=force) as files:
            if section is None or is_new:
                setting = Setting(data, progress, n_threads, out / KEPT / key, spec.configs)
                section = _run(key, spec, files.stage / key, setting)
            _write_pages(files.stage, out, sections)
        yield section


def data_for(spec: PaperSection, stockholm: Path | None = None) -> Path | None:
    """The folder of the real data if it holds what a section needs.

    Raises
    ------
    ConfigError
        The section needs COLD-Stockholm, and a part of it is missing.
    """
    data = stockholm if spec.of_stockholm else data_folder()
    missing = [name for name in spec.folders if data is None or not (data / name).is_dir()]
    if missing and spec.of_stockholm:
        raise ConfigError(
            f"{spec.title}: no folder {missing[0]} in {data}; give COLD-Stockholm in the layout of "
            "docs/paper.md: --stockholm FOLDER"
            if data is not None
            else f"{spec.title}: needs COLD-Stockholm: --stockholm FOLDER (docs/paper.md)"
        )
    return None if missing else data


def _run(key: str, spec: PaperSection, folder: Path, setting: Setting) -> Section:
    """The section, once its experiment has run and been written to the folder."""
    start = time.perf_counter()
    outcome = spec.run(setting)
    section = Section(
        key,
        spec.title,
        spec.paper,
        setting.data is not None,
        time.perf_counter() - start,
        __version__,
        outcome.setting,
        outcome.findings,
        outcome.tables,
        outcome.pictures,
        outcome.remarks,
    )
    for name, content in outcome.files.items():
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


def _write_pages(stage: Path, out: Path, keys: Iterable[str]) -> None:
    """Write the pages of all finished sections, staged ones included, in this order."""
    every = [finished_section(stage, key) or finished_section(out, key) for key in keys]
    finished = [section for section in every if section is not None]
    write_text(stage / "reproduce.md", markdown_page(finished))
    write_text(stage / "reproduce.html", html_page(finished, stage, out))
