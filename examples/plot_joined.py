"""
A map and a robot's path, labelled together
===========================================

A robot drives through a building with a known map. The map's cells and the robot's steps are
labelled together; each step has its own scan, noisier than the map's.
``LabelGraph.joined`` combines both in one graph: each step is linked to the cell where the robot
stands, so that the map informs the path and the path informs the map.
The network learns the weight of a link along with those of neighbours in the map and in time.
"""

from itertools import pairwise

import matplotlib.pyplot as plt
import networkx as nx
import numpy as np
from matplotlib.colors import ListedColormap

from pgm_places import LabelGraph, LabelingProblem, LabelledMap, PlaceLabeler, Sensor, build
from pgm_places.features.extraction import extract
from pgm_places.models.decision_list import DecisionListClassifier
from pgm_places.palette import WALL, label_colours
from pgm_places.sensing.ray_casting import cast_poses
from pgm_places.sensing.sensor import SensorNoise
from pgm_places.simulation import generate_building
from pgm_places.unary.cell_scorers import aligned_log_proba

buildings = [generate_building(seed, size="small") for seed in (0, 1, 2)]
names = buildings[0].label_names
first = LabelledMap(buildings[0].grid, buildings[0].labels)
sensor = Sensor(noise=SensorNoise(sigma_m=0.05))
quick = DecisionListClassifier(10, order="rarest-first")
labeler = PlaceLabeler(names, sensor=sensor, classifier=quick, space=None).fit([first])


def drive(cells, rng):
    # every second node on the paths between some random cells of the map
    places = cells.to_networkx()
    stops = rng.choice(sorted(max(nx.connected_components(places), key=len)), 25)
    legs = [nx.shortest_path(places, a, b)[:-1] for a, b in pairwise(stops)]
    return np.concatenate(legs)[::2]


def joined_problem(building, rng):
    # the problem on cells and steps, its ground truth, and the cells of the path
    cells = labeler.problem(building.grid)
    path = drive(cells.graph, rng)
    where = cells.graph.positions_m[path]
    poses = np.column_stack([where, rng.uniform(0, 2 * np.pi, len(path))])
    scans = cast_poses(building.grid, poses, sensor.angles_rad, max_range_m=30.0)
    scans = np.maximum(scans + rng.normal(scale=0.1, size=scans.shape), 0.01)
    features = extract(scans, max_range_m=30.0)
    heard = aligned_log_proba(labeler.unary_model_.classifier, features, len(names))
    links = np.column_stack([path, np.arange(len(path))])
    graph = LabelGraph.joined(cells.graph, LabelGraph.from_trajectory(where), links)
    kinds = np.eye(4)[graph.edge_kind]  # one column for each kind of edge: a weight for each
    unary = np.vstack([cells.unary, heard])
    truth = LabelledMap(building.grid, building.labels).truth(cells.graph)
    problem = LabelingProblem(graph, names, unary, edge_features=kinds)
    return problem, np.concatenate([truth, truth[path]]), path


rng = np.random.default_rng(7)
(train, known, before), (test, truth, path) = (joined_problem(b, rng) for b in buildings[1:])
was_step = np.arange(len(known)) >= len(known) - len(before)
is_step = np.arange(len(truth)) >= len(truth) - len(path)

# %%
# First map and path separately, then both jointly; a subproblem keeps the edges inside it.
found = {"each step, each cell": test.unary.argmax(axis=1)}
network = build("amn", {"edge_features": ("given",), "loss": "hamming", "certify": True})
apart = np.empty(len(truth), int)
for train_part, test_part in [(was_step, is_step), (~was_step, ~is_step)]:
    fitted = network.fit([train.subproblem(train_part)], [known[train_part]])
    apart[test_part] = fitted.infer(test.subproblem(test_part)).labels
found["path and map apart"] = apart
labeling = network.fit([train], [known]).infer(test)
found["joined"] = labeling.labels
for name, labels in found.items():
    right = [(labels == truth)[part & (truth >= 0)].mean() for part in (is_step, ~is_step)]
    print(f"{name:20} steps {100 * right[0]:.1f} %, cells {100 * right[1]:.1f} %")
print(f"joined: {labeling.status}, gap to the best possible score {labeling.gap:.1g}")

# %%
colours = label_colours(names)
picture, grid = ListedColormap(colours), buildings[2].grid
layout = LabelGraph.from_grid(grid).layout
y, x = layout.cells_rc[path].T
figure, axes = plt.subplots(2, 2, figsize=(12, 6.8), layout="constrained")
for axis, (name, labels) in zip(axes.flat, {"truth": truth, **found}.items(), strict=True):
    cells = np.ma.masked_less(layout.to_raster(labels[~is_step], fill=-1), 0)
    axis.imshow(np.ma.masked_equal(grid.occupied, 0), cmap=ListedColormap([WALL]), origin="lower")
    axis.imshow(cells, cmap=picture, vmin=-0.5, vmax=2.5, alpha=0.45, origin="lower")
    axis.scatter(x, y, c=np.array(colours)[labels[is_step]], s=16, edgecolors="k", linewidths=0.3)
    axis.set(title=name, xlim=(x.min() - 12, x.max() + 12), ylim=(y.min() - 12, y.max() + 12))
    axis.set_axis_off()
for name, colour in zip(names, colours, strict=True):
    axes[0, 0].scatter([], [], c=colour, edgecolors="k", label=name)
figure.legend(loc="outside lower center", ncols=3, frameon=False)
