"""The names of the files that each command writes, known before it has anything to write."""

from collections.abc import Iterable

from pgm_places.io.places.label_probabilities import probability_file
from pgm_places.report.outputs import Outputs

__all__ = ["COMPARISON", "DEMO", "LIVE", "PLACES", "SETTINGS", "TRACK", "label_names"]

COMPARISON = ("results.json", "report.html")
DEMO = ("map.yaml", "map.png", "labels.png", "labels.yaml", "demo.toml", *COMPARISON)
PLACES = ("topology.json", "regions.png", "regions.geojson", "topology.png")
TRACK = ("beliefs.csv", "path.png", "beliefs.png", "report.html")
LIVE = ("places.jsonl", "check.csv", *PLACES)
_PICTURES = ("overview.png", "topology.png")
SETTINGS = ("places.json", "gate_places.png")


def label_names(labels: Iterable[str], outputs: Outputs | None = None) -> tuple[str, ...]:
    """The files of a labelled map with these labels, its places included."""
    outputs = outputs or Outputs()
    probabilities = map(probability_file, labels) if outputs.probabilities else ()
    files = ("labels.png", "labels.yaml", "overview.png", "summary.json", "check.csv")
    names = (*files, *probabilities, *PLACES, *SETTINGS)
    return names if outputs.pictures else tuple(name for name in names if name not in _PICTURES)
