"""
A robot's view: places while it drives
======================================

What ``pgm-places live`` publishes, drawn as RViz shows it: the map, the markers of its places, the
robot with its path and scan, and the place where it is.
"""

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.collections import PatchCollection
from matplotlib.patches import Polygon

from pgm_places import trained_labeler
from pgm_places.labelers.trajectory_labeler import TrajectoryLabeler
from pgm_places.live.live_map import LiveMap
from pgm_places.live.place_finder import MapView, PlaceFinder
from pgm_places.palette import label_colours
from pgm_places.sensing.ray_casting import cast_poses
from pgm_places.simulation import generate_building
from pgm_places.trajectories.scan import Scan, ScanGeometry

labeler, grid = trained_labeler(), generate_building(5, size="small", resolution_m=0.05).grid
labelled = LiveMap(labeler).on_map(grid)
finder = PlaceFinder(TrajectoryLabeler.from_places(labeler))
finder.use(MapView.of(labelled))

# %%
# The robot drives from a room through a door into the corridor, straight from point to point.
topology = labelled.topology
door = next(item for item in topology.regions if item.label == "doorway")
room = next(item for item in topology.neighbours(door.id) if item.label == "room")
hall = next(item for item in topology.neighbours(door.id) if item.label == "corridor")
stops = np.array([room.anchor_m, door.anchor_m, hall.anchor_m])
path = np.concatenate([np.linspace(*stops[:2], 40), np.linspace(*stops[1:], 40)])
way = np.gradient(path, axis=0)
poses = np.column_stack([path, np.arctan2(way[:, 1], way[:, 0])])
laser = ScanGeometry.half_circle(181, range_max_m=10.0)
scans = cast_poses(grid, poses, laser.angles_rad, max_range_m=laser.range_max_m)
for step, (pose, ranges) in enumerate(zip(poses, scans, strict=True)):
    found = finder.step(Scan(step / 10, pose, ranges.astype(np.float32), laser))
    if found.changed:
        where = "between places" if found.region is None else found.region.name
        print(f"{found.time_s:4.1f} s: {where} ({found.label} {found.probability:.2f})")

# %%
# Free cells are grey, occupied cells black, as in RViz; the scan is red.
colours = dict(zip(topology.label_names, label_colours(topology.label_names), strict=True))
width, height = grid.shape[1] * grid.resolution_m, grid.shape[0] * grid.resolution_m
figure, axis = plt.subplots(figsize=(10, 10 * height / width), layout="constrained")
shade = np.select([grid.free, grid.occupied], [0.85, 0.05], 0.35)
axis.imshow(shade, cmap="gray", vmin=0, vmax=1, origin="lower", extent=(0, width, 0, height))
for region in topology.regions:
    areas = [Polygon(rings[0]) for rings in region.polygons]
    axis.add_collection(PatchCollection(areas, facecolor=colours[region.label], alpha=0.45))
    if region.label != "doorway":
        axis.annotate(region.name, region.anchor_m, ha="center", va="center", fontsize=8)
angles = poses[60, 2] + laser.angles_rad
ends = poses[60, :2] + scans[60, :, None] * np.column_stack([np.cos(angles), np.sin(angles)])
axis.plot(*ends[scans[60] < laser.range_max_m].T, ".", color="red", markersize=3)
axis.plot(*path[:61].T, color="#1a9850", linewidth=2)
axis.plot(*path[60], marker=(3, 0, np.rad2deg(poses[60, 2]) - 90), color="#1a9850", markersize=14)
axis.set_axis_off()
