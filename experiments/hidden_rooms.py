"""How many rooms that were taken for one are told of, and how many are that are one.

``pgm-places label DATA/robots --out LABELLED``, then ``python -m experiments.hidden_rooms LABELLED
DATA/robots`` compares the places of each map with the rooms of its labels: pieces of one label.
Places of corridors and halls, which are never told of, do not count.

- A place that holds at least half of two rooms or more, and 4 m2 of each, is a merge. It is found
  if the lines part two rooms.
- A place that is told of, though its parts are of the same room, is a false alarm. People who
  labelled may have drawn two rooms as one.
- Each doorway between two of these places, both of 4 m2 or more, is then removed in turn, so that
  they become one. How many of these merges are found says what would become of missed doorways.
"""

import argparse
from collections import Counter
from collections.abc import Iterator
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from pgm_places.errors import InputError
from pgm_places.io.places.result_folder import places_path
from pgm_places.io.places.topology_files import load_topology
from pgm_places.maps.components import connected_components
from pgm_places.topology.cuts import cut_along
from pgm_places.topology.hidden_rooms import CIRCULATION, HiddenRooms, hidden_rooms
from pgm_places.topology.place_edits import merged
from pgm_places.topology.regions import Region
from pgm_places.topology.topological_map import TopologicalMap

UNJUDGED, DOORWAY = 0, 179
LEAST_M2, MOST = 4.0, 0.5


def rooms_of(path: Path) -> NDArray[np.int64]:
    """(H, W) number of the piece of one label at each cell, -1 for doorways and unjudged ones."""
    values = np.asarray(Image.open(path))[::-1].astype(np.int16)
    values[(values == UNJUDGED) | (values == DOORWAY)] = -1
    return np.asarray(connected_components(values).piece, np.int64)


def held(topology: TopologicalMap, place: Region, rooms: NDArray[np.int64]) -> int:
    """How many rooms a place holds."""
    cell_m2 = topology.grid.resolution_m**2
    size = np.bincount(rooms[rooms >= 0])
    here = rooms[topology.region == place.id]
    inside = np.bincount(here[here >= 0], minlength=len(size))
    return int(((inside >= MOST * size) & (inside * cell_m2 >= LEAST_M2)).sum())


def parts_rooms(topology: TopologicalMap, item: HiddenRooms, rooms: NDArray[np.int64]) -> bool:
    """Whether two parts are for the most part of different rooms."""
    parts = cut_along(topology, item.place, item.lines_m)
    room, found = rooms[tuple(parts.cells.T)], set()
    for number in range(len(parts)):
        counts = np.bincount(room[(parts.number == number) & (room >= 0)])
        found |= {int(counts.argmax())} if len(counts) else set()
    return len(found) > 1


def with_doorways_missed(topology: TopologicalMap) -> Iterator[tuple[TopologicalMap, int]]:
    """The map with each doorway between two of its places removed, and the id of what results."""
    places = {
        place.id
        for place in topology.regions
        if is_counted(topology, place) and place.area_m2 >= LEAST_M2
    }
    for door in topology.regions:
        if door.label == topology.doorway_label:
            near = [place.id for place in topology.neighbours(door.id) if place.id in places]
            if len(near) == 2:
                try:
                    yield merged(topology, *near), near[0]
                except InputError:  # they touch elsewhere, too, or share other doorways
                    continue


def is_counted(topology: TopologicalMap, place: Region) -> bool:
    """Whether a place may be told of."""
    return place.label not in (topology.doorway_label, *CIRCULATION)


def compare(topology: TopologicalMap, rooms: NDArray[np.int64], name: str) -> Counter[str]:
    """The counts of one map."""
    told = {item.place.id: item for item in hidden_rooms(topology)}
    counts = Counter[str]()
    for place in filter(lambda item: is_counted(topology, item), topology.regions):
        counts["places"] += 1
        is_merge = held(topology, place, rooms) > 1
        item = told.get(place.id)
        is_right = item is not None and parts_rooms(topology, item, rooms)
        counts["merges"] += is_merge
        counts["found"] += is_right
        counts["false"] += item is not None and not is_right
        if is_merge or item is not None:
            said = "not told of" if item is None else f"looks like {item.count}"
            print(f"{name}: {place.name}, {place.area_m2:.1f} m2: {said}, {is_right=}, {is_merge=}")
    for other, number in with_doorways_missed(topology):
        counts["doorways missed"] += 1
        counts["of these found"] += number in {item.place.id for item in hidden_rooms(other)}
    return counts


def main() -> None:
    """Print the counts of each map and of all."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("labelled", type=Path)
    parser.add_argument("maps", type=Path)
    given = parser.parse_args()
    total = Counter[str]()
    for path in sorted(given.maps.glob("*/labels.png")):
        folder = given.labelled / path.parent.name / "map"
        if not places_path(folder).exists():
            continue
        topology, rooms = load_topology(folder), rooms_of(path)
        if topology.region.shape == rooms.shape:
            counts = compare(topology, rooms, path.parent.name)
            total += counts
            total["maps"] += 1
            print(f"{path.parent.name}: {dict(counts)}", flush=True)
    print(f"all: {dict(total)}")


if __name__ == "__main__":
    main()
