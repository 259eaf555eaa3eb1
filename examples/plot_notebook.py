"""
In a notebook: from a map to a comparison
=========================================

Maps and results display themselves as the last line of a cell. A building is generated, labelled
and turned into places; then two methods are compared on another building.
"""

import matplotlib.pyplot as plt
import numpy as np

from pgm_places import LabelledMap, PlaceLabeler, evaluate, topological_map
from pgm_places.labelling.label import label_map
from pgm_places.simulation import generate_building

training, test = (generate_building(seed=seed, size="small") for seed in (1, 2))
names = training.label_names
known = LabelledMap(training.grid, training.labels)
known.plot(label_names=names)

# %%
# Two methods on the same classifier, trained on the first building:
labeler = PlaceLabeler(names, ["independent", "relaxation"], unary="laser").fit([known])

# %%
# The second building: its labels, and how uncertain they are.
figure, axes = plt.subplots(2, 2, figsize=(12, 7), layout="constrained")
truth = test.labels[test.grid.free]
for row, method in zip(axes, ("independent", "relaxation"), strict=True):
    found = label_map(labeler, test.grid, method=method)
    found.plot(row[0])
    found.plot(row[1], show="uncertainty")
    scores = evaluate(truth, found.labels[test.grid.free], names)
    row[0].set_title(f"{method}: {100 * scores.accuracy:.1f} % of the cells right")
    print(f"{method}: balanced accuracy {100 * scores.balanced_accuracy:.1f} %")

# %%
# The places of the second building, and the graph that connects them.
places = topological_map(test.grid, found.labels, names)
places.plot()
print(places)
print(f"{np.sum([place.area_m2 for place in places.regions]):.0f} m2 in all")
