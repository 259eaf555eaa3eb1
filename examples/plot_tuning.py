"""
Tuning: what the options do to a map
====================================

The model is trained on three small buildings and labels a fourth; each column varies one option.
With few boosting rounds the classifier makes enough errors to show the effects.

* Relaxation: more iterations remove specks first and doorways next.
* Potts: one weight of agreement for all edges; too large a weight closes doorways.
* AMN: the loss sets the priorities. Plain Hamming loss counts cells and gives up uncertain
  doorways; a class-weighted loss keeps them, at the price of some false ones.

Doorways cover few cells, so accuracy says little about them: look at recall and precision.
"""

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.colors import ListedColormap

from pgm_places import LabelledMap, PlaceLabeler, build, evaluate
from pgm_places.models.decision_list import DecisionListClassifier
from pgm_places.palette import WALL, label_colours
from pgm_places.simulation import generate_building

buildings = [generate_building(seed, size="small", resolution_m=0.2) for seed in (0, 3, 4, 2)]
maps = [LabelledMap(building.grid, building.labels) for building in buildings]
names, grid = buildings[0].label_names, buildings[-1].grid
columns = {
    "relaxation": [{"max_iterations": n} for n in (1, 10, 50, 200)],
    "potts": [{"weight": weight} for weight in (0.1, 0.3, 1.0, 3.0)],
    "amn": [
        {"loss": "hamming"},
        *({"class_weight": power} for power in ("cube-root", "sqrt", "inverse")),
    ],
}
methods = {
    f"{method} {n}": build(method, options)
    for method, settings in columns.items()
    for n, options in enumerate(settings)
}
quick = DecisionListClassifier(20, order="rarest-first")
labeler = PlaceLabeler(names, methods, classifier=quick, space=None).fit(maps[:-1])
graph, scores = labeler.scores(grid)
truth = maps[-1].truth(graph)
known = np.argwhere(buildings[-1].labels >= 0)

# %%
figure, axes = plt.subplots(4, 3, figsize=(13, 9.6), layout="constrained")
cells, picture = graph.layout, ListedColormap(label_colours(names))
for line, (method, settings) in zip(axes.T, columns.items(), strict=True):
    for n, (axis, options) in enumerate(zip(line, settings, strict=True)):
        labels = labeler.infer(graph, scores, method=f"{method} {n}").labels
        result = evaluate(truth, labels, names)
        axis.imshow(
            np.ma.masked_equal(grid.occupied, 0), cmap=ListedColormap([WALL]), origin="lower"
        )
        shown = np.ma.masked_less(cells.to_raster(labels, fill=-1), 0)
        axis.imshow(
            shown, cmap=picture, vmin=-0.5, vmax=2.5, origin="lower", interpolation="nearest"
        )
        (option, value), *_ = options.items()
        recall, precision = result.recall["doorway"], result.precision["doorway"] or 0
        doors = f"doorways: recall {100 * recall:.0f} %, precision {100 * precision:.0f} %"
        right = f"{100 * result.accuracy:.1f} % right, {doors}"
        axis.set_title(f"{method}, {option} = {value}\n{right}", fontsize=10)
        axis.set(
            ylim=known[:, 0][[0, -1]] + [-3, 3], xlim=(known[:, 1].min() - 3, known[:, 1].max() + 3)
        )
        axis.set_axis_off()
for name, colour in zip(names, picture.colors, strict=True):
    axes[0, 0].scatter([], [], c=colour, marker="s", label=name)
figure.legend(loc="outside lower center", ncols=3, frameon=False)
