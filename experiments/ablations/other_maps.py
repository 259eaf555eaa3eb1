"""Ablations of the map's content: furniture, and how much of the building was seen."""

import numpy as np

from experiments.paper.categories import load_building79
from experiments.paper.comparison_pictures import label_sheet
from experiments.paper.figures import method_findings, method_table
from experiments.paper.section import Outcome, Picture
from experiments.paper.setting import Setting
from pgm_places.datasets import generate_building
from pgm_places.experiment.comparison import Comparison
from pgm_places.experiment.maps import load_maps
from pgm_places.experiment.runs import compare, compare_fitted, train
from pgm_places.io.maps.map_server import load_map
from pgm_places.labelers.tracking import map_of_scans
from pgm_places.labelling.label import label_map
from pgm_places.maps.coarsening import coarsen
from pgm_places.maps.labelled_map import LabelledMap
from pgm_places.maps.occupancy_grid import OccupancyGrid
from pgm_places.pictures.map_pictures import label_map as label_picture
from pgm_places.sensing.simulated_robot import SimulatedRobot
from pgm_places.trajectories.scan import ScanGeometry
from pgm_places.trajectories.trajectory import Trajectory

SNAPSHOTS = ("map3", "map8", "map14")
SHARES = (0.25, 0.5, 0.75, 1.0)
FURNISHED = {
    "furniture_real": "trained with furniture, tested with it",
    "furniture_drawn": "trained without, tested without",
    "furniture_real_to_drawn": "trained with, tested without",
    "furniture_drawn_to_real": "trained without, tested with",
}


def furniture(setting: Setting) -> Outcome:
    """The real map of building 79 compared with one drawn by hand, without furniture."""
    found = {words: compare(setting.experiment(name)) for name, words in FURNISHED.items()}
    pictures, files = [], {}
    for name, words in FURNISHED.items():
        files[f"{name}.png"] = label_sheet(found[words])
        pictures.append(Picture(f"{name}.png", f"{words.capitalize()}."))
    return Outcome(
        setting="Building 79, left half to right half, 5 cm: the real SLAM map and the same floor "
        "drawn by hand with straight walls and empty rooms.",
        findings=method_findings(found),
        tables=(method_table("Furniture in training and in testing", found),),
        pictures=tuple(pictures),
        files=files,
    )


def partial_maps(setting: Setting) -> Outcome:
    """Maps of the first part of a drive, and snapshots of a building while it was mapped."""
    experiment = setting.experiment("ablations", {"methods": _WITHOUT_NETWORK})
    [whole] = load_maps(experiment, "test")
    trained = train(experiment)
    drive = _drive(setting, whole)
    found: dict[str, Comparison] = {}
    for share in SHARES:
        with setting.progress.stage(f"map of {100 * share:.0f} % of the drive"):
            seen = seen_part(whole, drive[: max(int(share * len(drive)), 1)])
        if seen.labelled_cells.any():
            found[f"{100 * share:.0f} %"] = compare_fitted(trained, [seen])
    pictures, files = [], {}
    for words, comparison in found.items():
        name = f"seen_{words.removesuffix(' %')}.png"
        files[name] = label_sheet(comparison)
        pictures.append(Picture(name, f"The map after {words} of the drive."))
    for name, grid in _snapshots(setting).items():
        labels = label_map(trained.labeler, grid, n_threads=setting.n_threads)
        files[f"{name}.png"] = label_picture(grid, labels.labels, labels.label_names)
        pictures.append(Picture(f"{name}.png", f"A snapshot taken while mapping, {name}."))
    return Outcome(
        setting="Trained on the left half of building 79 as mapped completely; tested "
        "on what the first part of a drive saw of the right half.",
        findings=method_findings({f"{words} of the drive": item for words, item in found.items()}),
        tables=(method_table("Share of the drive that the map was made from", found),),
        pictures=tuple(pictures),
        files=files,
    )


_WITHOUT_NETWORK = [
    {"name": "independent", "id": "adaboost", "unary": "laser", "options": {}},
    {"name": "relaxation", "id": "relaxation", "unary": "context", "options": {}},
]


def _drive(setting: Setting, whole: LabelledMap) -> Trajectory:
    """The real log in the frame of the map, or a simulated tour of it."""
    if setting.data is not None:
        return load_building79(setting.data).path
    robot = SimulatedRobot(ScanGeometry.half_circle(180, range_max_m=20.0), scan_every_s=0.5)
    return robot.explore(whole.grid, spacing_m=2.0, seed=1)


def seen_part(whole: LabelledMap, drive: Trajectory) -> LabelledMap:
    """The map that the scans of a drive make, with the true labels and the window of the whole."""
    grid = map_of_scans(drive, resolution_m=whole.grid.resolution_m)
    cells = np.argwhere(grid.free)
    at = whole.grid.cells_at_m(grid.cell_centres_m(cells))
    inside = ((at >= 0) & (at < whole.grid.shape)).all(axis=1)
    labels = np.full(grid.shape, -1, np.int16)
    window = np.zeros(grid.shape, np.bool_)
    rows, columns = cells[inside].T
    labels[rows, columns] = whole.labels[at[inside, 0], at[inside, 1]]
    window[rows, columns] = whole.cells[at[inside, 0], at[inside, 1]]
    return LabelledMap(grid, labels, window, f"{len(drive):,} scans")


def _snapshots(setting: Setting) -> dict[str, OccupancyGrid]:
    if setting.data is None:
        return {"generated": coarsen(generate_building(82, furniture=False).grid, 0.1)}
    folder = setting.data / "freiburg079_partial"
    return {name: load_map(folder / f"{name}.yaml").grid for name in SNAPSHOTS}
