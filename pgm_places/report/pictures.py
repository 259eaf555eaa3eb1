"""Every picture from one place: functions that return the bytes of a PNG file."""

from pgm_places.report.map_pictures import (
    difference_map,
    label_map,
    overview,
    probability_maps,
)
from pgm_places.report.plots import confusion_picture, history_plot, reliability_plot

__all__ = [
    "confusion_picture",
    "difference_map",
    "history_plot",
    "label_map",
    "overview",
    "probability_maps",
    "reliability_plot",
]
