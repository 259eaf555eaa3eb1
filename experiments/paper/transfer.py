"""Section 7.4: classifiers in buildings that they were not trained on."""

from experiments.paper.comparison_pictures import error_sheet, label_sheet
from experiments.paper.figures import DOORWAY, by_way, method_findings, method_table, percent
from experiments.paper.section import Outcome, Picture, Table
from experiments.paper.setting import AS_PRINTED, WAYS, Setting
from pgm_places.experiment.comparison import Comparison
from pgm_places.experiment.runs import compare_fitted, train
from pgm_places.experiment.sources import load_maps
from pgm_places.labelers.place_labeler import PlaceLabeler
from pgm_places.labelling.label import label_map
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
    found: dict[str, dict[str, Comparison]] = {way: {} for way in WAYS}
    files: dict[str, bytes] = {}
    for way, preset in WAYS.items():
        for name, words in TRANSFERS.items():
            experiment = setting.experiment(name, preset=preset)
            tests = load_maps(experiment, "test")
            trained = train(experiment)
            found[way][words] = compare_fitted(trained, tests)
            if way == AS_PRINTED:
                files |= _pictures(name, found[way][words], trained.labeler, grid)
    captions = {
        "unlabelled.png": "Trained on building 52, the list alone (paper, Fig. 10).",
        "unlabelled_topology.png": f"Trained on buildings 79 and 52, with {SHOWN}: the topological "
        "map (compare the paper's Fig. 11, of another building).",
    }
    for name, words in TRANSFERS.items():
        captions[f"{name}_labels.png"] = f"{words}, {AS_PRINTED}."
        captions[f"{name}_errors.png"] = f"{words}, {AS_PRINTED}: errors of each method."
    return Outcome(
        setting="Every method is trained on whole buildings and tested on another one; the Intel "
        "Research Lab has no ground truth here, so there are pictures only.",
        findings=tuple(
            item for way, of_way in found.items() for item in method_findings(of_way, way=way)
        ),
        tables=(
            method_table("Transfer between buildings", by_way(found)),
            _by_map(by_way(found)),
        ),
        pictures=tuple(Picture(*item) for item in captions.items()),
        files=files,
    )


def _pictures(
    name: str, found: Comparison, labeler: PlaceLabeler, grid: OccupancyGrid
) -> dict[str, bytes]:
    """Labels and errors on the first test map, and the map without labels."""
    files = {f"{name}_labels.png": label_sheet(found), f"{name}_errors.png": error_sheet(found)}
    if name == "transfer_52":
        files["unlabelled.png"] = _labels(labeler, grid, found.methods[0].id)
    if name == "transfer_79_52":
        files["unlabelled_topology.png"] = _topology(labeler, grid)
    return files


def _labels(labeler: PlaceLabeler, grid: OccupancyGrid, method: str) -> bytes:
    labelled = label_map(labeler, grid, method=method)
    return label_picture(grid, labelled.labels, labelled.label_names)


def _topology(labeler: PlaceLabeler, grid: OccupancyGrid) -> bytes:
    labelled = label_map(labeler, grid, method=SHOWN)
    return topology_drawing(
        grid, topological_map(grid, labelled.labels, labelled.label_names)
    ).png()


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
