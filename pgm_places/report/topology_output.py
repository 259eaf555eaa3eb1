"""What the commands write about places: the topological map's files and its picture."""

from pathlib import Path

from pgm_places.io.atomic import write_bytes
from pgm_places.io.places.topology_files import save_topology
from pgm_places.maps.occupancy_grid import OccupancyGrid
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
    from pgm_places.report.topology_pictures import topology_picture

    picture = write_bytes(folder / "topology.png", topology_picture(grid, topology, title=title))
    return [*save_topology(folder, topology), picture]


def topology_summary(topology: TopologicalMap) -> str:
    """One line: how many places of each class, connections and corrections."""
    counts = []
    for label in topology.label_names:
        count = sum(region.label == label for region in topology.regions)
        counts.append(f"{count} {label}{'' if count == 1 else 's'}")
    corrected = len(topology.corrections)
    return (
        f"places: {', '.join(counts)}; {len(topology.connections)} connections; "
        f"{corrected} correction{'' if corrected == 1 else 's'}"
    )
