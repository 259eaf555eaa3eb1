"""Places found, missed and invented per method of a configuration, by corrections and by gates.

``python experiments/topology.py CONFIG.toml [--pictures FOLDER]`` prints a Markdown table per test
map; found places are those of the window that was tested.
"""

import argparse
from pathlib import Path

import numpy as np

from experiments.paper.markdown import markdown_table
from experiments.paper.topology import topology_table
from pgm_places.experiment.config import load_config
from pgm_places.experiment.experiment import Experiment
from pgm_places.experiment.maps import load_maps
from pgm_places.experiment.runs import compare_fitted, train
from pgm_places.pictures.topology_pictures import topology_drawing


def main() -> None:
    """Run the configuration and print the tables."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("config", type=Path)
    parser.add_argument("--pictures", type=Path)
    arguments = parser.parse_args()
    path = arguments.config.resolve()
    experiment = Experiment(load_config(path), path.parent)
    tests = load_maps(experiment, "test")
    trained = train(experiment)
    found = compare_fitted(trained, tests)
    space = trained.labeler.unary_model_.space
    for k, item in enumerate(found.maps):
        answers = {
            method.id: item.layout.to_raster(method.labelings[k].labels.astype(np.int16), fill=-1)
            for method in found.methods
        }
        doorways = None if space is None else space.spaces(item.grid).doorways
        table, maps, _ = topology_table(item, answers, found.label_names, doorways)
        print(f"\n{table.caption}\n\n{markdown_table(table)}\n")
        for method in found.methods:
            doors = method.doors[k]
            print(f"doors of {method.id}: {doors.found} / {doors.missed} / {doors.invented}")
        if arguments.pictures is not None:
            folder = arguments.pictures / item.name
            folder.mkdir(parents=True, exist_ok=True)
            for method, topology in maps.items():
                picture = topology_drawing(item.grid, topology, title=method).png()
                (folder / f"{method}.png").write_bytes(picture)


if __name__ == "__main__":
    main()
