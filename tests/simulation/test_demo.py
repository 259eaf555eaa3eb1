from pathlib import Path

from pgm_places.experiment.config import load_config
from pgm_places.experiment.experiment import Experiment
from pgm_places.experiment.sources import load_maps
from pgm_places.simulation.demo import write_demo


def test_the_parts_of_the_demo_are_named_wherever_its_files_lie(tmp_path: Path) -> None:
    """Files are written aside first, so names must not follow from the folder."""
    experiment = Experiment(load_config(write_demo(tmp_path, seed=0)), tmp_path)
    [learned], [tested] = (load_maps(experiment, part) for part in ("train", "test"))
    assert (learned.name, tested.name) == ("left part", "right part")
    assert learned.building == tested.building
