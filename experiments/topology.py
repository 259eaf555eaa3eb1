"""Places found, missed and invented per method of a configuration, with and without corrections.

``python experiments/topology.py CONFIG.toml [--pictures FOLDER]`` prints a Markdown table per test
map; found places are those of the window that was tested.
"""

import argparse
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pgm_places.config import load_config
from pgm_places.experiment import Experiment, compare
from pgm_places.grid import OccupancyGrid
from pgm_places.region_scores import RegionScores, fill_labels, score_regions
from pgm_places.report.topology_pictures import topology_picture
from pgm_places.topology.corrections import CorrectionRules
from pgm_places.topology.from_labels import topological_map

FURTHER = CorrectionRules(widest_doorway_m=1.6, close_leaks_m=1.5, split_rooms_m=1.5)
"""The corrections that are off by default, at the widths of the doors and openings of an office."""

VARIANTS: dict[str, dict[str, Any]] = {
    "none": {"correct": False},
    "": {},
    "further, ": {"rules": FURTHER},
}

HEAD = (
    "| method | corrections | rooms found / merged / missed / invented | "
    "doorways found / missed / invented | connections found / missed / invented | purity |\n"
    "|---|---|---|---|---|---|"
)


def row(method: str, corrections: str, scores: RegionScores) -> str:
    """A row of the table."""
    room, door = scores.classes["room"], scores.classes["doorway"]
    return (
        f"| {method} | {corrections} | {room.hit} of {room.n_true} / {room.merged} / "
        f"{room.missed} / {room.invented} | {door.hit} of {door.n_true} / {door.missed} / "
        f"{door.invented} | {scores.connections_hit} of {scores.connections_true} / "
        f"{scores.connections_missed} / {scores.connections_invented} | "
        f"{100 * scores.purity:.1f} % |"
    )


def table(
    grid: OccupancyGrid,
    truth: NDArray[np.int16],
    answers: Mapping[str, NDArray[np.int16]],
    names: tuple[str, ...],
    window: NDArray[np.bool_],
    pictures: Path | None = None,
) -> str:
    """The table of one map; pictures of the corrected maps go to a folder."""
    inside = np.where(window, fill_labels(grid, truth, names), np.int16(-1))
    # The same rules drop the specks that hand-made labels have too.
    true_map = topological_map(grid, inside, names)
    lines = [HEAD]
    for method, raster in answers.items():
        labels = np.where(window, raster, np.int16(-1))
        for name, options in VARIANTS.items():
            found = topological_map(grid, labels, names, **options)
            text = f"{name}{len(found.corrections)}" if found.corrections else "-"
            lines.append(row(method, text, score_regions(found, true_map)))
            if pictures is not None:
                picture = topology_picture(grid, found, title=f"{method}, {text}")
                (pictures / f"{method}_{list(VARIANTS).index(name)}.png").write_bytes(picture)
    return "\n".join(lines)


def main() -> None:
    """Run the configuration and print the tables."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("config", type=Path)
    parser.add_argument("--pictures", type=Path)
    arguments = parser.parse_args()
    path = arguments.config.resolve()
    found = compare(Experiment(load_config(path), path.parent))
    for k, item in enumerate(found.maps):
        answers = {
            method.id: item.layout.to_raster(method.labelings[k].labels.astype(np.int16), fill=-1)
            for method in found.methods
        }
        folder = None if arguments.pictures is None else arguments.pictures / item.name
        if folder is not None:
            folder.mkdir(parents=True, exist_ok=True)
        rows = table(item.grid, item.truth, answers, found.label_names, item.window, folder)
        print(f"\n{item.name}\n\n{rows}")


if __name__ == "__main__":
    main()
