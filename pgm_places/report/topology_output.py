"""The output of commands about places: the topological map's files and its picture."""

from pathlib import Path

from pgm_places.io.atomic import write_bytes
from pgm_places.io.places.topology_files import save_topology
from pgm_places.maps.occupancy_grid import OccupancyGrid
from pgm_places.report.topology_pictures import count_line, topology_picture
from pgm_places.topology.topological_map import TopologicalMap

__all__ = ["topology_summary", "write_topology"]


def write_topology(
    folder: Path, grid: OccupancyGrid, topology: TopologicalMap, *, title: str | None = None
) -> list[Path]:
    """Write the topological map's files and ``topology.png``; the paths.

    Raises
    ------
    OutputError
        Where a file cannot be written.
    """
    picture = write_bytes(folder / "topology.png", topology_picture(grid, topology, title=title))
    return [*save_topology(folder, topology), picture]


def topology_summary(topology: TopologicalMap) -> str:
    """One line: how many places of each class, connections and corrections."""
    n = len(topology.corrections)
    return f"places: {count_line(topology)}; {n} correction{'' if n == 1 else 's'}"
