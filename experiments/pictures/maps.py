"""Pictures of maps on their way to places, of generated floors and the shipped model."""

import numpy as np
from matplotlib.colors import LinearSegmentedColormap

from experiments.pictures.kept import (
    NAMES,
    at,
    crop,
    draw_ground,
    draw_labels,
    figure,
    found_on,
    keep,
    legend,
    plain,
    right,
    shipped,
)
from pgm_places import LabelledMap, PlaceLabeler, label_map, topological_map
from pgm_places.datasets import MapSimulation, generate_building, simulate_map
from pgm_places.inference.labeling import normalized_entropy
from pgm_places.models.decision_list import DecisionListClassifier
from pgm_places.palette import levels
from pgm_places.pictures.drawing import MUTED
from pgm_places.pictures.topology_pictures import topology_drawing
from pgm_places.topology.topological_map import TopologicalMap

OFFICE, JOINED = (64, "office"), (60, "office")
DOUBT = LinearSegmentedColormap.from_list("doubt", levels("entropy", 24))
BEAM = "#1f5fa8"


def own_map() -> None:
    """A map, its labels, and where the model is in doubt."""
    found = found_on(*OFFICE)
    picture = figure(8.4, 9.4)
    axes = picture.subplots(3, 1)
    draw_ground(axes[0], found.grid)
    crop(axes[0], found.grid)
    plain(axes[0], "map.yaml: free, occupied, unknown")
    draw_labels(axes[1], found.grid, found.labels, "labels.png: the label of every free cell")
    draw_ground(axes[2], found.grid)
    doubt = found.on_map(normalized_entropy(found.labeling.beliefs), np.nan)
    shown = np.ma.masked_invalid(doubt)
    drawn = axes[2].imshow(shown, cmap=DOUBT, vmin=0, vmax=1, **at(found.grid))
    crop(axes[2], found.grid)
    plain(axes[2], "overview.png: doubt, the entropy of its probabilities")
    bar = picture.colorbar(drawn, ax=axes, fraction=0.02, pad=0.01, shrink=0.3, anchor=(0, 0))
    bar.ax.tick_params(labelsize=9, colors=MUTED)
    legend(picture)
    keep("own_map", picture)


def painted() -> None:
    """Part of a map painted by hand, and another floor labelled by what was learned from it."""
    first = generate_building(70, size="small", resolution_m=0.1)
    second = generate_building(71, size="small", resolution_m=0.1)
    part = np.full_like(first.labels, -1)
    columns = slice(0, int(0.55 * part.shape[1]))
    part[:, columns] = first.labels[:, columns]
    list_ = DecisionListClassifier(40, order="rarest-first")
    labeler = PlaceLabeler(NAMES, ["relaxation"], classifier=list_, space=None)
    labeler.fit([LabelledMap(first.grid, part)])
    labels = label_map(labeler, second.grid).labels
    picture = figure(10, 3.3)
    axes = picture.subplots(1, 2)
    draw_labels(axes[0], first.grid, part, "floor1_labels.png: painted in part")
    title = f"floor 2, labelled by what was learned: {100 * right(second, labels):.1f} % right"
    draw_labels(axes[1], second.grid, labels, title)
    legend(picture)
    keep("painted", picture)


def places(floor_: tuple[int, str] = OFFICE) -> TopologicalMap:
    """The topological map of a floor."""
    found = found_on(*floor_)
    return topological_map(
        found.grid,
        found.labels,
        found.label_names,
        beliefs=found.labeling.beliefs,
        layout=found.layout,
        doorways=found.doorways,
    )


def topology() -> None:
    """The places over the map, and the diagram."""
    keep("topology", topology_drawing(found_on(*OFFICE).grid, places()).png())


def networks() -> None:
    """A floor as a robot maps it, labels without and with networks, and where views differ."""
    drawn = generate_building(
        41,
        style="clinic",
        halls="hall",
        furniture=False,
        slam_noise=False,  # type: ignore[arg-type]
    )
    plan = LabelledMap(drawn.grid, drawn.labels, name="plan")
    robot = MapSimulation(coverage=(0.75, 0.75), glass=(0.4, 0.4), corridor_furniture=(2.0, 2.0))
    grid = simulate_map(plan, (*NAMES, "hall"), seed=41, options=robot, resolution_m=0.05).grid
    labeler = shipped()
    doubt = np.full(grid.shape, np.nan)
    doubt[grid.free] = labeler.unary_model_.seen(grid).doubt(np.argwhere(grid.free))
    picture = figure(8.4, 6.9)
    axes = picture.subplots(2, 2)
    draw_ground(axes[0, 0], grid)
    crop(axes[0, 0], grid)
    plain(axes[0, 0], "the map")
    for axis, method, title in (
        (axes[0, 1], "adaboost", "boosted lists alone"),
        (axes[1, 0], labeler.default_method, "with the networks"),
    ):
        draw_labels(axis, grid, label_map(labeler, grid, method=method).labels, title)
    draw_ground(axes[1, 1], grid)
    axes[1, 1].imshow(doubt, cmap=DOUBT, vmin=0, vmax=4.0, **at(grid))
    crop(axes[1, 1], grid)
    plain(axes[1, 1], "where their views disagree")
    keep("floor", picture)
