"""Section 7.4: classifiers in buildings that they were not trained on."""

from experiments.paper.comparison_pictures import confusion_of, error_sheet, label_sheet
from experiments.paper.figures import DOORWAY, method_findings, method_table, percent
from experiments.paper.section import Outcome, Picture, Table
from experiments.paper.setting import Setting
from pgm_places.experiment.comparison import Comparison
from pgm_places.experiment.maps import load_maps
from pgm_places.experiment.runs import compare_fitted, train
from pgm_places.labelers.label_map import label_map
from pgm_places.labelers.place_labeler import PlaceLabeler
from pgm_places.maps.occupancy_grid import OccupancyGrid
from pgm_places.pictures.map_pictures import label_map as label_picture
from pgm_places.pictures.topology_pictures import topology_drawing
from pgm_places.topology.from_labels import topological_map

UNLABELLED = "intel"
"""A building without ground truth: pictures only."""

TRANSFERS = {
    "transfer_52": "52 to 79",
    "transfer_79_52": "79 + 52 to another town",
    "transfer_saarbruecken_52": "another town + 52 to 79",
}
SHOWN = "relaxation"


def run(setting: Setting) -> Outcome:
    """All pairs of buildings; figures only where the test building has labels."""
    grid = setting.unlabelled_map(UNLABELLED)
    found, files, pictures = {}, {}, []
    for name, words in TRANSFERS.items():
        experiment = setting.experiment(name)
        tests = load_maps(experiment, "test")
        trained = train(experiment)
        found[words] = compare_fitted(trained, tests)
        files[f"{name}_labels.png"] = label_sheet(found[words])
        files[f"{name}_errors.png"] = error_sheet(found[words])
        where = found[words].maps[0].name
        pictures += [
            Picture(f"{name}_labels.png", f"{words}: {where}."),
            Picture(f"{name}_errors.png", f"{words}: errors of each method on {where}."),
        ]
        if name == "transfer_52":
            files["unlabelled.png"] = _labels(trained.labeler, grid, "adaboost")
            pictures.append(
                Picture(
                    "unlabelled.png", "Trained on building 52, the list alone (paper, Fig. 10)."
                )
            )
        if name == "transfer_79_52":
            files["unlabelled_topology.png"] = _topology(trained.labeler, grid)
            files["confusion.png"] = confusion_of(found[words].methods[-1])
            pictures += [
                Picture(
                    "unlabelled_topology.png",
                    f"Trained on buildings 79 and 52, with {SHOWN}: the topological map (compare "
                    "the paper's Fig. 11, of another building).",
                ),
                Picture("confusion.png", f"{words}: confusion between places."),
            ]
    return Outcome(
        setting="Every method is trained on whole buildings and tested on another one; the Intel "
        "Research Lab has no ground truth here, so there are pictures only.",
        findings=method_findings(found),
        tables=(method_table("Transfer between buildings", found), _by_map(found)),
        pictures=tuple(pictures),
        files=files,
    )


def _labels(labeler: PlaceLabeler, grid: OccupancyGrid, method: str) -> bytes:
    found = label_map(labeler, grid, method=method)
    return label_picture(grid, found.labels, found.label_names)


def _topology(labeler: PlaceLabeler, grid: OccupancyGrid) -> bytes:
    found = label_map(labeler, grid, method=SHOWN)
    return topology_drawing(grid, topological_map(grid, found.labels, found.label_names)).png()


def _by_map(found: dict[str, Comparison]) -> Table:
    rows = []
    for words, comparison in found.items():
        for k, item in enumerate(comparison.maps):
            for method in comparison.methods:
                scored = method.evaluations[k]
                figures = (scored.accuracy, scored.balanced_accuracy, scored.f1.get(DOORWAY))
                rows.append((words, item.name, method.id, *map(percent, figures)))
    heading = ("", "map", "method", "accuracy", "balanced", "doorway F1")
    return Table("Each map separately", heading, tuple(rows))
