"""The names of the files that each command writes, known before it has anything to write."""

from collections.abc import Iterable

from pgm_places.io.places.label_probabilities import probability_file

__all__ = ["COMPARISON", "DEMO", "LIVE", "PLACES", "SETTINGS", "TRACK", "label_names"]

COMPARISON = ("results.json", "report.html")
DEMO = ("map.yaml", "map.png", "labels.png", "labels.yaml", "demo.toml", *COMPARISON)
PLACES = ("topology.json", "regions.png", "regions.geojson", "topology.png")
TRACK = ("beliefs.csv", "path.png", "beliefs.png", "report.html")
LIVE = ("places.jsonl", "check.csv", *PLACES)
SETTINGS = ("places.json", "gate_places.png")


def label_names(labels: Iterable[str]) -> tuple[str, ...]:
    """The files of a labelled map with these labels, its places included."""
    probabilities = map(probability_file, labels)
    files = ("labels.png", "labels.yaml", "overview.png", "summary.json", "check.csv")
    return (*files, *probabilities, *PLACES, *SETTINGS)
