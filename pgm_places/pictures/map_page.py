"""Page of a labelled map, index.html: picture and table of places, checks, and files."""

import html
import re
from collections.abc import Collection, Iterable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from pgm_places.maps.occupancy_grid import OccupancyGrid
from pgm_places.palette import GROUND_SWATCHES, Swatch, label_swatches, tinted
from pgm_places.pictures.page import data_uri, render
from pgm_places.pictures.topology_pictures import PALE, count_line, marked_checks, places_drawing
from pgm_places.topology.checks import doubtful_share, split_candidates
from pgm_places.topology.regions import Region
from pgm_places.topology.topological_map import TopologicalMap

PAGE_FILE = "index.html"
_GROUND = (*GROUND_SWATCHES[:-1], replace(GROUND_SWATCHES[-1], name="free, in no place"))
_TITLE = re.compile("<title>([^<]+)</title>")

_MOST_ROWS = 1000
"""Most rows of a table; places.json has all."""

_FILES = (
    ("labels.png", "the label of each cell, on the map image's own raster"),
    ("labels.yaml", "what the values of labels.png mean"),
    ("overview.png", "the labels and the uncertainty, as a picture"),
    ("topology.png", "the places over the map, and which lead to which, as a picture"),
    ("places.json", "the places: names, areas, outlines, and which lead to which"),
    ("regions.png", "the id of the place at each cell"),
    ("regions.geojson", "the outlines of the places, for QGIS and others"),
    ("check.csv", "all places, those to check first at the top"),
    ("place_names.yaml", "the names that you gave"),
    ("details", "files that programs read: probabilities, settings, record of the run"),
)


def earlier_title(folder: Path) -> str | None:
    """The title of the page in a folder; None without one."""
    try:
        with (folder / PAGE_FILE).open("rb") as file:
            found = _TITLE.search(file.read(1 << 16).decode("utf-8", "replace"))
    except OSError:
        return None
    return None if found is None else html.unescape(found[1])


class MapPage:
    """The page of a labelled map, rendered by the packing thread."""

    def __init__(
        self,
        grid: OccupancyGrid,
        topology: TopologicalMap,
        *,
        title: str,
        names: Collection[str],
        map_name: str = "MAP.yaml",
        warnings: Sequence[str] = (),
        picture: bool = True,
    ) -> None:
        self._topology, self._picture = topology, None
        if picture:
            self._picture = places_drawing(grid, topology)
        n_outside = int((grid.free & (topology.region == 0)).sum())
        self._values: dict[str, Any] = {
            "title": title,
            "warnings": warnings,
            "outside_m2": n_outside * grid.resolution_m**2,
            "files": [
                (name, words)
                for name, words in _FILES
                if any(each.split("/")[0] == name for each in names)
            ],
            "map_name": map_name,
        }

    def content(self) -> bytes:
        """The page, in UTF-8."""
        found, share = self._topology, doubtful_share(self._topology)
        areas = found.area_m2
        doorways = [item for item in found.regions if item.label == found.doorway_label]
        places = [item for item in found.regions if item.label != found.doorway_label]
        largest = max(places or doorways, key=lambda item: item.area_m2, default=None)
        page = render(
            "map.html",
            picture=None if self._picture is None else data_uri(self._picture.png()),
            counts=count_line(found),
            cards=_cards(found, places, doorways, share),
            legend=[(item, area) for item in _swatches(found) if (area := areas[item.name])],
            ground=_GROUND,
            checks=marked_checks(found),
            hidden=split_candidates(found),
            places=_rows(places, found),
            doorways=_rows(doorways, found),
            n_places=len(places),
            n_doorways=len(doorways),
            most=_MOST_ROWS,
            largest=largest,
            **self._values,
        )
        return page.encode("utf-8")


def _cards(
    found: TopologicalMap,
    places: Sequence[Region],
    doorways: Sequence[Region],
    share: float | None,
) -> list[tuple[str, str]]:
    """The main figures."""
    cards = [
        (f"{len(places):,}", "place" if len(places) == 1 else "places"),
        (f"{len(doorways):,}", "doorway" if len(doorways) == 1 else "doorways"),
        (f"{sum(found.area_m2.values()):,.1f} m²", "labelled area"),
    ]
    return cards if share is None else [*cards, (f"{100 * share:.1f} %", "of the area uncertain")]


def _rows(regions: Iterable[Region], found: TopologicalMap) -> list[dict[str, object]]:
    """The rows of a table of places."""
    swatch = {item.name: item for item in _swatches(found)}
    return [
        {
            "place": item,
            "swatch": swatch[item.label],
            "near": _near(item, found),
        }
        for item in list(regions)[:_MOST_ROWS]
    ]


def _near(region: Region, found: TopologicalMap) -> list[str]:
    """The names of the places next to a place: directly, or through doorways."""
    if region.label == found.doorway_label:
        return [other.name for other in found.neighbours(region.id)]
    reached, todo = {region.id}, [region.id]
    near: dict[int, str] = {}
    while todo:
        for other in found.neighbours(todo.pop()):
            if other.id in reached:
                continue
            reached.add(other.id)
            if other.label == found.doorway_label:
                todo.append(other.id)
            else:
                near[other.id] = other.name
    return [near[number] for number in sorted(near)]


def _swatches(found: TopologicalMap) -> list[Swatch]:
    """The labels with their colours in the picture."""
    swatches = label_swatches(found.label_names)
    return [replace(item, colour=tinted(item.colour, PALE)) for item in swatches]
