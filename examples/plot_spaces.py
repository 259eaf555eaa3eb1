"""
A floor: segments, gates and places
===================================

A floor is cut at its narrow passages, at three scales. The narrow openings become gates. The areas
between gates that are doorways are rooms and corridors. The ground truth decides which gates are
doorways, and shows how many doors were found.
"""

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.colors import ListedColormap
from matplotlib.patches import Polygon

from pgm_places.simulation import generate_building
from pgm_places.spaces.doorways import match_doors
from pgm_places.spaces.gates import gate_candidates
from pgm_places.spaces.places import places_between
from pgm_places.spaces.segmentation import Segmentation

building = generate_building(seed=3)
grid = building.grid
found = Segmentation.of(grid)
for ratio, scale in zip(found.ratios, found.scales, strict=True):
    print(f"scale {ratio:4}: {scale.count:3} segments, {len(scale.openings):3} openings")

# %%
# Gates are rectangles in the map frame. This is the score if every candidate counts as a doorway:
gates = gate_candidates(found)
truth = match_doors(gates, building.labels, building.label_names.index("doorway"))
scores = truth.scores(np.ones(len(gates), bool))
print(f"{scores.found} of {scores.doors} doors, {100 * scores.precision:.0f} % of the candidates")

# %%
# Colours are random; doorways are outlined in black, all other candidates in red.
places = places_between(gates, truth.is_doorway)
colours = np.random.default_rng(1).uniform(0.35, 0.95, (found.scales[0].count, 3))
height, width = np.array(grid.shape) * grid.resolution_m
pictures = {f"segments at ratio {r:g}": s for r, s in zip(found.ratios, found.scales, strict=True)}
figure, axes = plt.subplots(2, 2, figsize=(12, 6), layout="constrained")
for axis, (title, division) in zip(
    axes.flat, (pictures | {"places": places.segments}).items(), strict=True
):
    raster = np.ma.masked_less(division.raster(), 0)
    axis.imshow(~grid.free, cmap=ListedColormap(["white", "#2d2d2d"]), origin="lower",
                extent=(0, width, 0, height))  # fmt: skip
    axis.imshow(raster, cmap=ListedColormap(colours[: division.count]), origin="lower",
                extent=(0, width, 0, height), interpolation="nearest")  # fmt: skip
    axis.set_title(f"{title}: {division.count}")
    axis.set_axis_off()
for axis in (axes[0, 0], axes[1, 1]):
    for gate, is_doorway in zip(gates, truth.is_doorway, strict=True):
        edge = "black" if is_doorway else "red"
        axis.add_patch(Polygon(gate.corners_m - grid.origin_xy_m, fill=False, edgecolor=edge))
