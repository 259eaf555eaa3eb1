"""
Rooms: what each is for
=======================

The places between the doorways of hotel floors are labelled with what they are for: a forest
guesses the use of each place from its proportions, as if the scale of the plan were unknown, and
relaxation, which has learned what lies beside what, revises all guesses of a floor together. On
real floors, with their scale and nine kinds of rooms, neighbours do not help: :doc:`/results` has
the figures.
"""

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.colors import ListedColormap
from matplotlib.patches import Patch
from sklearn.ensemble import RandomForestClassifier

from pgm_places import LabelingProblem, StructuredLabeler, build
from pgm_places.datasets import generate_building
from pgm_places.spaces.door_truth import match_doors
from pgm_places.spaces.gates import gate_candidates
from pgm_places.spaces.place_neighbours import neighbour_graph
from pgm_places.spaces.places import place_features, places_between
from pgm_places.spaces.segmentation import Segmentation
from pgm_places.spaces.space_spec import PLACE_FEATURES

KINDS = ("corridor", "guest room", "bathroom")
COLOURS = ("#f0c75e", "#4f86c6", "#c8553d")
SHOWN = 1
PROPORTIONS = ("roundness", "aspect", "filling")
CORRIDOR, GUEST_ROOM, BATHROOM = range(3)


def floor(seed):
    """A floor's places as a problem, what each place is for, the raster of places, and the map."""
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
    columns = [k for k, spec in enumerate(PLACE_FEATURES) if spec.id in PROPORTIONS]
    seen = place_features(places)[:, columns]
    problem = LabelingProblem(neighbour_graph(places), KINDS, node_features=seen)
    return problem, kind, raster, made.grid


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


def add_legend(figure):
    """The colours of the kinds, below the pictures."""
    handles = [Patch(color=colour, label=kind) for colour, kind in zip(COLOURS, KINDS, strict=True)]
    figure.legend(handles=handles, loc="outside lower center", ncols=3, frameon=False)


floors = [floor(seed) for seed in range(1, 9)]
problems, kinds = [item[0] for item in floors], [item[1] for item in floors]
figure, axis = plt.subplots(figsize=(7, 5), layout="constrained")
show(axis, "a floor to learn from", *floors[SHOWN][1:])
add_legend(figure)

# %%
# The coefficients of relaxation say what goes together: bathrooms lie beside guest rooms, and
# hardly ever beside a corridor. They are learned from the guesses of forests that have not seen
# the floor.
forest = RandomForestClassifier(100, min_samples_leaf=3, random_state=0)
labeler = StructuredLabeler(build("relaxation", {"max_iterations": 3}), forest)
labeler.fit(problems[:-1], kinds[:-1])
print(labeler.backend_.compatibility[0, :3, :3].round(2))

# %%
# A floor that was not trained on, each place alone and all together:
alone = labeler.scores(problems[-1]).argmax(axis=1)
together = labeler.label(problems[-1]).labels
truth = kinds[-1]
figure, axes = plt.subplots(3, 1, figsize=(8, 10), layout="constrained")
pictures = {"true": truth, "each place alone": alone, "with its neighbours": together}
for axis, (title, found) in zip(axes, pictures.items(), strict=True):
    right = "" if found is truth else f": {(found == truth).sum()} of {len(truth)} places are right"
    show(axis, title + right, found, *floors[-1][2:])
    print(title + right)
add_legend(figure)
