"""Pictures of maps on their way to places, of generated floors and the shipped model."""

from typing import Any

import numpy as np
from matplotlib.colors import LinearSegmentedColormap, ListedColormap
from matplotlib.patches import Polygon

from experiments.pictures.kept import (
    COLOURS,
    NAMES,
    at,
    crop,
    draw_ground,
    draw_labels,
    figure,
    floor,
    found_on,
    keep,
    legend,
    plain,
    right,
    shipped,
)
from pgm_places import LabelledMap, PlaceLabeler, label_map, topological_map
from pgm_places.datasets import generate_building
from pgm_places.features.extraction import extract_one
from pgm_places.features.laser import laser_feature_names
from pgm_places.inference.labeling import normalized_entropy
from pgm_places.live.live_map import LiveMap
from pgm_places.maps.occupancy_grid import OccupancyGrid
from pgm_places.models.decision_list import DecisionListClassifier
from pgm_places.palette import GROUND_SWATCHES, WALL, label_swatches, levels
from pgm_places.pictures.canvas import label_canvas, view_of
from pgm_places.pictures.drawing import INK, MUTED, Drawing
from pgm_places.pictures.sheet import Panel, sheet
from pgm_places.pictures.topology_pictures import topology_drawing
from pgm_places.report.explanation_picture import explanation_picture
from pgm_places.sensing.ray_casting import cast_poses
from pgm_places.spaces.gates import gate_candidates
from pgm_places.spaces.segmentation import Segmentation
from pgm_places.teaching.explanation import explain_cell
from pgm_places.teaching.teacher import Teacher
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


def gates() -> None:
    """Rooms that labels alone join, and that gates tell apart."""
    found = found_on(*JOINED)
    by_labels = topological_map(found.grid, found.labels, found.label_names)
    by_gates = places(JOINED)
    anchors = [region.anchor_m for region in by_gates.regions if region.label == "room"]
    owners = [by_labels.region_at(*anchor) for anchor in anchors]
    joined = [owner for owner in owners if owner and owners.count(owner) > 1]
    box = np.array(joined[-1].box_m)
    low, high = box[:2] - np.array((3.0, 1.5)), box[2:] + np.array((3.0, 2.5))
    picture = figure(10, 10 / 2 * (high[1] - low[1]) / (high[0] - low[0]) + 0.8)
    axes = picture.subplots(1, 2)
    for axis, made, title in zip(
        axes, (by_labels, by_gates), ("doorways as labelled", "doorways as gates"), strict=True
    ):
        draw_labels(axis, found.grid, made.labels, title, alpha=0.55)
        for region in made.regions:
            if region.gate is not None:
                axis.add_patch(Polygon(region.gate.corners_m, facecolor="none", edgecolor=INK))
            x, y = region.anchor_m
            if region.label != "doorway" and low[0] < x < high[0] and low[1] < y < high[1]:
                axis.text(x, y, region.name, ha="center", va="center", fontsize=9, color=INK,
                          clip_on=True)  # fmt: skip
        axis.set_xlim(low[0], high[0])
        axis.set_ylim(low[1], high[1])
    legend(picture)
    keep("gates", picture)


def spaces() -> None:
    """Segments at the finest scale with all gates, and the places between those accepted."""
    found = found_on(*OFFICE)
    grid = found.grid
    division = Segmentation.of(grid)
    candidates = gate_candidates(division)
    rng = np.random.default_rng(4)
    picture = figure(8.4, 6.6)
    axes = picture.subplots(2, 1)
    shades = rng.uniform(0.45, 0.95, (division.scales[0].count, 3))
    accepted = found.doorways
    panels = (
        (division.scales[0].raster(), candidates, f"{division.scales[0].count} segments, "
         f"{len(candidates)} gates"),
        (accepted.place, accepted.gates, f"{accepted.place.max() + 1} places "
         f"between {len(accepted.gates)} doorways"),
    )  # fmt: skip
    for axis, (raster, shown, title) in zip(axes, panels, strict=True):
        draw_ground(axis, grid)
        colours = ListedColormap(shades[: raster.max() + 1])
        axis.imshow(
            np.ma.masked_less(raster, 0), cmap=colours, vmin=0, vmax=raster.max(), **at(grid)
        )
        for gate in shown:
            axis.add_patch(Polygon(gate.corners_m, facecolor="white", edgecolor=INK, lw=0.8))
        crop(axis, grid)
        plain(axis, title)
    keep("spaces", picture)


def _scan(grid: OccupancyGrid, here: Any) -> Any:
    angles = np.arange(360) * 2 * np.pi / 360
    [ranges] = cast_poses(grid, [[*here, 0.0]], angles, max_range_m=30.0)
    ends = np.asarray(here) + ranges[:, None] * np.stack([np.cos(angles), np.sin(angles)], axis=1)
    return ranges, ends


def _standing(label: str) -> Any:
    """The middle of a place of a label: of its largest region, or of its first doorway."""
    regions = [region for region in places().regions if region.label == label]
    if label == "doorway":
        return regions[1].anchor_m
    return max(regions, key=lambda region: region.area_m2).anchor_m


def features() -> None:
    """Three scans and what some of the features say of them."""
    grid = found_on(*OFFICE).grid
    shown = ("f8", "f5", "f31", "f17", "f18", "f14[1.0]")
    words = {
        "f8": "mean range, m",
        "f5": "area, m²",
        "f31": "roundness",
        "f17": "major axis, m",
        "f18": "minor axis, m",
        "f14[1.0]": "jumps over 1 m",
    }
    columns = [laser_feature_names().index(name) for name in shown]
    picture = figure(10, 4.5)
    axes = picture.subplots(1, 3)
    for axis, name, colour in zip(axes, NAMES, COLOURS, strict=True):
        here = _standing(name)
        ranges, ends = _scan(grid, here)
        draw_ground(axis, grid)
        axis.add_patch(Polygon(ends, facecolor=colour, alpha=0.35, edgecolor=colour, lw=1.2))
        for end in ends[::6]:
            axis.plot(*np.stack([here, end]).T, color=BEAM, lw=0.4, alpha=0.6)
        axis.plot(*here, "o", color="white", markeredgecolor=INK, ms=6)
        reach = 4.6
        axis.set_xlim(here[0] - reach, here[0] + reach)
        axis.set_ylim(here[1] - reach, here[1] + reach)
        plain(axis, name)
        values = extract_one(ranges, max_range_m=30.0)[columns]
        lines = [f"{words[key]}: {value:.3g}" for key, value in zip(shown, values, strict=True)]
        for place, part in ((0.0, lines[:3]), (0.5, lines[3:])):
            axis.text(place, -0.03, "\n".join(part), transform=axis.transAxes, va="top",
                      fontsize=9, color=INK, linespacing=1.5)  # fmt: skip
    keep("features", picture)


def concepts() -> None:
    """From a map to labels in five pictures."""
    found = found_on(*OFFICE)
    grid = found.grid
    here = np.asarray(_standing("corridor"))
    ranges, ends = _scan(grid, here)
    low, high = here - np.array((5.0, 6.5)), here + np.array((11.0, 6.5))
    picture = figure(11, 2.3)
    axes = picture.subplots(1, 5)
    titles = ("a map", "a scan from each cell", "321 features of it",
              "probabilities (corridor)", "labels that fit together")  # fmt: skip
    for axis, title in zip(axes, titles, strict=True):
        if title != titles[2]:
            draw_ground(axis, grid)
            axis.set_xlim(low[0], high[0])
            axis.set_ylim(low[1], high[1])
        plain(axis, title)
        axis.title.set_fontsize(9.5)
    for end in ends[::4]:
        axes[1].plot(*np.stack([here, end]).T, color=BEAM, lw=0.5)
    axes[1].plot(*here, "o", color="white", markeredgecolor=INK, ms=5)
    values = extract_one(ranges, max_range_m=30.0)[::7]
    ranks = np.argsort(np.argsort(values)) / len(values)
    axes[2].bar(np.arange(len(values)), 0.08 + ranks, width=0.7, color="#6b7684")
    axes[2].set_box_aspect((high[1] - low[1]) / (high[0] - low[0]))
    corridor = found.on_map(found.labeling.beliefs[:, 0], np.nan)
    gradient = LinearSegmentedColormap.from_list("probability", levels("probability", 24))
    axes[3].imshow(np.ma.masked_invalid(corridor), cmap=gradient, vmin=0, vmax=1, **at(grid))
    labels = np.ma.masked_less(found.labels, 0)
    axes[4].imshow(labels, cmap=ListedColormap(COLOURS), vmin=0, vmax=2, **at(grid))
    for axis in axes[[0, 1, 3, 4]]:
        axis.set_xlim(low[0], high[0])
        axis.set_ylim(low[1], high[1])
    keep("concepts", picture)


def unknown_as_free() -> None:
    """What the same image means under two thresholds."""
    grid = floor(*OFFICE).grid
    pixels = np.where(grid.unknown, 205, np.where(grid.free, 254, 0))
    picture = figure(10, 1.85)
    axes = picture.subplots(1, 3)
    axes[0].imshow(pixels, cmap="gray", vmin=0, vmax=255, **at(grid))
    wrong = grid.with_cells(np.where(grid.unknown, 0, grid.cells))
    titles = ("the image: 254, 205 and 0", "free_thresh: 0.196", "free_thresh: 0.25")
    for axis, read, title in zip(axes, (None, grid, wrong), titles, strict=True):
        if read is not None:
            draw_ground(axis, read)
        crop(axis, grid)
        plain(axis, title)
        axis.set_axis_on()
        axis.set_xticks([])
        axis.set_yticks([])
        axis.spines[:].set_color("#c9ccd1")
    shades = {"free": "white", "occupied": WALL, "unknown": GROUND_SWATCHES[1].colour}
    for name, colour in shades.items():
        axes[1].scatter([], [], marker="s", c=colour, edgecolors=MUTED, s=60, label=name)
    picture.legend(loc="outside lower right", ncols=3, frameon=False, fontsize=9.5)
    keep("unknown_as_free", picture)


def growing_map() -> None:
    """A floor as it grows, with the ids of its places."""
    whole = generate_building(5, size="small", resolution_m=0.05).grid
    columns = np.arange(whole.shape[1])
    live = LiveMap(shipped())
    panels = []
    for share in (0.4, 0.7, 1.0):
        seen = np.where(columns < share * whole.shape[1], whole.cells, -1)
        found = live.on_map(whole.with_cells(seen))
        view = view_of(whole, most_pixels=400_000)
        canvas = label_canvas(found.topology.grid, found.topology.labels, NAMES, view)
        rooms = [region for region in found.topology.regions if region.label != "doorway"]

        def ids(page: Drawing, scale: int, rooms: Any = rooms, view: Any = view) -> None:
            for region in rooms:
                [(x, y)] = scale * view.pixels_at_m(whole, [region.anchor_m])
                page.text(x, y, str(region.id), size=17, bold=True, centred=True, halo=3)

        title = f"map {found.map_seq}: {len(found.topology.regions)} places"
        panels.append(Panel(canvas, title, ids))
        print(found.map_seq, found.appeared, found.vanished)
    legend_ = (*label_swatches(NAMES), *GROUND_SWATCHES[:2])
    keep("growing_map", sheet(panels, columns=3, legend=legend_, long_side=1200).png())


def explain() -> None:
    """Why a cell has its label."""
    grid = found_on(*OFFICE).grid
    teacher = Teacher(grid, shipped())
    taught = teacher.label(teacher.blank())
    keep("explain", explanation_picture(taught, explain_cell(taught, *_standing("room"))))
