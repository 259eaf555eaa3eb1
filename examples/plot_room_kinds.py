"""
Rooms: the purpose of each
==========================

The places between the doorways of hotel floors are labelled with their purpose. A forest classifies
each place by its shape, or by shape and size; relaxation learns which kinds of rooms are neighbours
and revises all labels of a floor together. Here, size is enough, and neighbours add nothing. On
real floors with nine kinds of rooms, neighbours do not help either (:doc:`/notes/studies`).
"""

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.colors import ListedColormap
from matplotlib.patches import Patch
from sklearn.ensemble import RandomForestClassifier

from pgm_places import LabelingProblem, StructuredLabeler, build
from pgm_places.simulation import generate_building
from pgm_places.spaces.doorways import match_doors
from pgm_places.spaces.gates import gate_candidates
from pgm_places.spaces.places import neighbour_graph, place_features, places_between
from pgm_places.spaces.segmentation import Segmentation
from pgm_places.spaces.space_spec import PLACE_FEATURES

KINDS = ("corridor", "guest room", "bathroom")
COLOURS = ("#f0c75e", "#4f86c6", "#c8553d")
SHAPE = ("roundness", "aspect", "filling")
SIZE = ("area", "radius", "short", "long")
N_TRAINING = 7
CORRIDOR, GUEST_ROOM, BATHROOM = range(3)


def floor(seed):
    """A floor's places as two problems, what each is for, the raster of places, and the map."""
    made = generate_building(seed, style="hotel")
    corridor, doorway = (made.label_names.index(name) for name in ("corridor", "doorway"))
    gates = gate_candidates(Segmentation.of(made.grid))
    places = places_between(gates, match_doors(gates, made.labels, doorway).is_doorway)
    raster = places.segments.raster()
    inside = raster >= 0
    cells = np.bincount(raster[inside], minlength=places.count)
    passage = np.bincount(raster[inside], made.labels[inside] == corridor, places.count)
    is_corridor = 2 * passage > cells
    # A bathroom is entered from a guest room, not from the corridor.
    opens_to_corridor = np.zeros(places.count, bool)
    for first, second in places.graph.edges:
        opens_to_corridor[first] |= is_corridor[second]
        opens_to_corridor[second] |= is_corridor[first]
    kind = np.where(opens_to_corridor, GUEST_ROOM, BATHROOM)
    kind[is_corridor] = CORRIDOR
    seen = dict(zip((spec.id for spec in PLACE_FEATURES), place_features(places).T, strict=True))
    graph = neighbour_graph(places)
    problems = [
        LabelingProblem(graph, KINDS, node_features=np.column_stack([seen[name] for name in names]))
        for names in (SHAPE, SHAPE + SIZE)
    ]
    return problems, kind, raster, made.grid


def show(axis, title, kind, raster, grid):
    """A floor with each place in the colour of its kind."""
    rows, columns = (slice(part.min(), part.max() + 1) for part in np.nonzero(~grid.unknown))
    ground = np.where(grid.unknown, 0, np.where(grid.free, 1, 2))[rows, columns]
    axis.imshow(ground, cmap=ListedColormap(["#e8e8e8", "white", "#2d2d2d"]), origin="lower")
    shown = np.ma.masked_where(raster < 0, kind[raster])[rows, columns]
    axis.imshow(shown, cmap=ListedColormap(COLOURS), vmin=0, vmax=2, origin="lower",
                interpolation="nearest")  # fmt: skip
    axis.set_title(title, loc="left")
    axis.set_axis_off()


floors = [floor(seed) for seed in range(1, 13)]
problems, kinds = zip(*(item[:2] for item in floors), strict=True)
truth = np.concatenate(kinds[N_TRAINING:])

# %%
# Accuracy on floors left out of training. By the coefficients of relaxation, corridors are never
# neighbours, and bathrooms hardly ever.
pictures = {"true": kinds[N_TRAINING]}
for name, versions in zip(("shape", "shape and size"), zip(*problems, strict=True), strict=True):
    forest = RandomForestClassifier(100, min_samples_leaf=3, random_state=0)
    labeler = StructuredLabeler(build("relaxation", {"max_iterations": 2}), forest)
    labeler.fit(versions[:N_TRAINING], kinds[:N_TRAINING])
    unseen = versions[N_TRAINING:]
    alone = [labeler.scores(problem).argmax(axis=1) for problem in unseen]
    together = [labeler.label(problem).labels for problem in unseen]
    for words, found in ((name, alone), (f"{name}, with neighbours", together)):
        pictures[words] = found[0]
        right = np.count_nonzero(np.concatenate(found) == truth)
        print(f"{words:32} {right} of {len(truth)} places are right")
print("what goes together:", labeler.backend_.compatibility[0, :3, :3].round(2), sep="\n")

# %%
# One of these floors, without the last row of the table:
figure, axes = plt.subplots(2, 2, figsize=(12, 6.6), layout="constrained")
for axis, (title, found) in zip(axes.flat, pictures.items(), strict=False):
    wrong = np.count_nonzero(found != kinds[N_TRAINING])
    show(axis, f"{title}: {wrong} wrong" if wrong else title, found, *floors[N_TRAINING][2:])
handles = [Patch(color=colour, label=kind) for colour, kind in zip(COLOURS, KINDS, strict=True)]
figure.legend(handles=handles, loc="outside lower center", ncols=3, frameon=False)
