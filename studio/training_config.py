"""Training configuration of the studio: ``train.toml``, with which 'train' learns the paint."""

import json
import os
from collections.abc import Collection, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

from pgm_places.errors import InputError
from pgm_places.experiment.config import NO_MODEL
from pgm_places.io.atomic import write_text
from pgm_places.options import Options, option_values
from pgm_places.spaces.entered_options import EnteredOptions
from pgm_places.studio.session import MapSession
from pgm_places.teaching.paint import Paint
from pgm_places.teaching.training_selection import OF_PAINT_ALONE, TeachingOptions
from pgm_places.trained import NAMES

CORRECTIONS = "corrections.png"


def write_training(
    sessions: Sequence[MapSession],
    folder: Path,
    title: str,
    painted: Collection[str],
    *,
    beside: bool = False,
) -> list[Path]:
    """Write a configuration that trains one model on the paint of several maps, and the paint.

    ``painted`` lists the classes that are painted on any map. The maps need not be open. The paint
    is written into each session's folder, or into the configuration's folder with ``beside``.
    """
    first = sessions[0]
    alone = first.labeler is None
    if alone and len(set(painted)) < 2:
        raise InputError("paint at least two classes; there is nothing to tell apart yet")
    options = option_values(TeachingOptions())
    if alone:
        options = {name: options[name] for name in OF_PAINT_ALONE}
    names = list(
        dict.fromkeys(name for session in sessions for name in session.painting.classes.names)
    )
    paths = [(folder if beside else session.folder) / CORRECTIONS for session in sessions]
    images = [
        paint_of(session).with_classes(names).save(path, session.grid)
        for session, path in zip(sessions, paths, strict=True)
    ]
    text = "\n".join(
        [
            *_keys({"title": title, "base_model": _base_model(first)}),
            *_table("[labels]", {"names": names}),
            *_table("[teaching]", options),
            *_tables_of_rules(first),
            *(
                line
                for session, path in zip(sessions, paths, strict=True)
                for line in _table("[[train]]", _source(session, path, folder))
            ),
            "",
        ]
    )
    return [write_text(folder / "train.toml", text), *images]


def rules_of(session: MapSession) -> dict[str, Options]:
    """The rules of the model, by the names of their tables in a configuration."""
    loaded = session.loaded
    return {
        "topology": session.rules,
        "entered": EnteredOptions() if loaded is None else loaded.entered,
    }


def _tables_of_rules(session: MapSession) -> Iterator[str]:
    """The rules that differ from the defaults, as tables of a configuration."""
    for name, options in rules_of(session).items():
        if options != type(options)():
            yield from _table(f"[{name}]", option_values(options))


def _source(session: MapSession, corrections: Path, folder: Path) -> dict[str, Any]:
    """The entry of a painted map in a configuration."""
    found: dict[str, Any] = {
        "map": str(session.source.yaml_path.resolve()),
        "corrections": os.path.relpath(corrections.resolve(), folder.resolve()),
    }
    if session.source.unknown_value is not None:
        found["unknown_value"] = session.source.unknown_value
    return found


def _base_model(session: MapSession) -> str:
    if session.labeler is None:
        return NO_MODEL
    return session.model if session.model in NAMES else str(Path(session.model).resolve())


def _table(header: str, values: Mapping[str, Any]) -> list[str]:
    return ["", header, *_keys(values)]


def _keys(values: Mapping[str, object]) -> list[str]:
    """Lines of TOML; strings, numbers, booleans and lists are written as in JSON."""
    return [f"{name} = {json.dumps(value, ensure_ascii=False)}" for name, value in values.items()]


def paint_of(session: MapSession) -> Paint:
    """The paint of a map; an error if there is none."""
    if not session.painting.n_painted:
        raise InputError("nothing is painted yet")
    return Paint(session.painting.labels.copy(), session.painting.classes.names)
