"""Demo: writes a generated building as map files, and a configuration."""

from pathlib import Path

from pgm_places.io.atomic import write_text
from pgm_places.io.maps.label_image import save_labels
from pgm_places.io.maps.map_server import save_map
from pgm_places.simulation.building import generate_building

CONFIG = """\
# One building: learn on its left part, label its right part with every method.
title = "Generated building, left part to right part"
resolution_m = 0.1  # a quarter of the map's own cells: quicker; take the line out to compare

[labels]
names = [{names}]

[[train]]
name = "left part"
map = "map.yaml"
labels = "labels.png"
columns = [0, {split}]

[[test]]
name = "right part"
map = "map.yaml"
labels = "labels.png"
columns = [{split}, "end"]

[[methods]]
id = "adaboost"
name = "independent"
unary = "laser"

# One half of a building has too few spaces to learn from: unary = "context" sees cells only.
[[methods]]
name = "relaxation"
unary = "context"

[[methods]]
name = "amn"
unary = "context"
certify = true
"""


def write_demo(folder: Path, *, seed: int = 0) -> Path:
    """Write the building's map and labels and a configuration; the configuration's path."""
    building = generate_building(seed=seed)
    save_map(building.grid, folder / "map")
    save_labels(folder / "labels.png", building.labels, building.label_names)
    names = ", ".join(f'"{name}"' for name in building.label_names)
    config = folder / "demo.toml"
    write_text(config, CONFIG.format(names=names, split=building.split_column))
    return config
