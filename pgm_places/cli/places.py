"""Commands about places: topology, export and where."""

import re
from collections.abc import Sequence
from math import isfinite
from pathlib import Path
from typing import TYPE_CHECKING

import typer

from pgm_places.cli.flags import named_as_flags
from pgm_places.cli.progress import make_progress
from pgm_places.cli.terminal import say, say_written
from pgm_places.errors import InputError
from pgm_places.topology.rules import TopologyOptions

if TYPE_CHECKING:
    from pgm_places.topology.topological_map import TopologicalMap

__all__ = ["run_export", "run_topology", "run_where"]


def run_topology(
    labels_path: Path,
    map_yaml: Path,
    out: Path,
    *,
    names_path: Path | None,
    unknown_value: int | None,
    rules: TopologyOptions,
    propose_splits_m: float,
    force: bool,
    quiet: bool,
) -> None:
    """``pgm-places topology``."""
    from pgm_places.io.maps.label_image import load_labels
    from pgm_places.io.maps.label_values import listed_names
    from pgm_places.io.maps.map_server import load_map
    from pgm_places.io.output_set import output_set
    from pgm_places.report.file_names import PLACES
    from pgm_places.report.topology_output import places_summary, write_places

    progress = make_progress(quiet=quiet)
    with progress.stage("map and labels"):
        loaded = load_map(map_yaml, unknown_value=unknown_value)
        names = listed_names(labels_path, names_path)
        labels = load_labels(labels_path, names, grid=loaded.grid, names_path=names_path)
    for message in loaded.warnings:
        progress.warn(message)
    with (
        output_set(out, "topology", names=PLACES, force=force) as files,
        progress.stage("places"),
    ):
        topology = write_places(
            files, map_yaml.stem, rules, grid=loaded.grid, labels=labels, label_names=names
        )
    say(places_summary(topology))
    if propose_splits_m:
        for line in _proposals(topology, propose_splits_m):
            say(line)
    say_written(files)


def _proposals(topology: "TopologicalMap", narrower_than_m: float) -> list[str]:
    """A line per possible split."""
    from pgm_places.topology.proposals import propose_splits

    with named_as_flags({"split_rooms_m": "--propose-splits"}):
        found = propose_splits(topology, narrower_than_m)
    lines = [
        f"possible split: {split.region} ({split.areas_m2[0]:.1f} and {split.areas_m2[1]:.1f} m²) "
        f"at ({split.middle_m[0]:.2f}, {split.middle_m[1]:.2f}), {split.width_m:.2f} m wide"
        for split in found
    ]
    return lines or [f"no split proposed: no constriction is narrower than {narrower_than_m:g} m"]


def run_export(
    folder: Path,
    to: str,
    out: Path | None,
    values: Sequence[str],
    *,
    robot_radius_m: float | None = None,
    force: bool,
) -> None:
    """``pgm-places export``."""
    from pgm_places.io.output_set import output_set
    from pgm_places.io.places.exports import export
    from pgm_places.io.places.topology_files import load_named_topology

    topology = load_named_topology(folder)
    with output_set(out or folder, f"export {to}", force=force, shared=True) as files:
        export(
            topology,
            to,
            files.stage,
            values=_values(values) or None,
            robot_radius_m=robot_radius_m,
            lies_in=out or folder,
        )
    say_written(files)


def _values(texts: Sequence[str]) -> dict[str, int]:
    """``["room=100"]`` as ``{"room": 100}``."""
    values = {}
    for text in texts:
        name, equals, number = text.rpartition("=")
        if not equals or not name or not re.fullmatch("[0-9]{1,9}", number.strip()):
            raise InputError(f"--set expects NAME=NUMBER, such as room=100, got {text!r}")
        values[name.strip()] = int(number)
    return values


def run_where(folder: Path, x_m: float, y_m: float) -> None:
    """``pgm-places where``."""
    from pgm_places.io.places.topology_files import load_named_topology

    if not (isfinite(x_m) and isfinite(y_m)):
        raise InputError(f"X and Y must be finite metres, got {x_m:g} and {y_m:g}")
    topology = load_named_topology(folder)
    region = topology.region_at(x_m, y_m)
    if region is None:
        say("no place at this position")
        raise typer.Exit(1)
    near = ", ".join(other.name for other in topology.neighbours(region.id)) or "nothing"
    confidence = "" if region.confidence is None else f", confidence {region.confidence:.2f}"
    say(f"{region.name} (id {region.id}, {region.label}, {region.area_m2:.1f} m²{confidence})")
    say(f"next to: {near}")
