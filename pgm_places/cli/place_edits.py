"""``pgm-places rename``, ``merge`` and ``split``: places of a folder, changed by hand."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from pgm_places.cli.arguments import Place, Places
from pgm_places.cli.declarations import Argument
from pgm_places.cli.terminal import say, say_written
from pgm_places.errors import InputError

if TYPE_CHECKING:
    from pgm_places.topology.topological_map import TopologicalMap


def rename(
    folder: Places,
    place: Place,
    name: Annotated[str, Argument("NAME")],
) -> None:
    """Give a place a name of your own, in place_names.yaml.

    Parameters
    ----------
    name
        Its new name.
    """
    from pgm_places.io.places.topology_files import load_named_topology, write_own_name
    from pgm_places.topology.place_edits import renamed

    topology = load_named_topology(folder)
    number = topology.place(_key(place)).id
    renamed(topology, {number: name})  # a name that another place has is refused here
    path = write_own_name(folder, number, name)
    say(f"place {number} is called {name!r} (in {path})")


def merge(
    folder: Places,
    first: Place,
    second: Annotated[str, Argument("OTHER")],
) -> None:
    """Merge two places into one. It keeps the id and the name of the first.

    Parameters
    ----------
    second
        The place to merge into the first.
    """
    from pgm_places.io.places.topology_files import load_named_topology
    from pgm_places.topology.place_edits import merged

    _write(folder, merged(load_named_topology(folder), _key(first), _key(second)), "merge")


def split(
    folder: Places,
    place: Place,
    points: Annotated[list[float] | None, Argument("[X Y [X2 Y2]]")] = None,
) -> None:
    """Split a place: along a line, at a point, or into its rooms.

    A point splits it where it is narrowest. The rooms are those that 'label' and check.csv tell of.

    Parameters
    ----------
    points
        A point, or the ends of a line (m); none to split it into the rooms that it looks like.
    """
    from pgm_places.io.places.topology_files import load_named_topology
    from pgm_places.topology.place_edits import split_across, split_apart, split_at

    topology = load_named_topology(folder)
    if not points:
        edited = split_apart(topology, _key(place))
    elif len(points) == 2:
        edited = split_at(topology, _key(place), points)
    elif len(points) == 4:
        edited = split_across(topology, _key(place), points[:2], points[2:])
    else:
        raise InputError(
            f"split takes a point X Y, a line X1 Y1 X2 Y2 or nothing, got {len(points)} numbers"
        )
    _write(folder, edited, "split")


def _key(text: str) -> int | str:
    """A place by its id or name."""
    return int(text) if text.isdecimal() else text


def _write(folder: Path, topology: "TopologicalMap", by: str) -> None:
    from pgm_places.io.output_set import output_set
    from pgm_places.report.topology_output import places_summary, write_topology

    # The command that wrote the folder goes on owning its other files.
    with output_set(folder, by, force=True, shared=True) as files:
        write_topology(files.stage, topology.grid, topology, title=folder.name)
    say(places_summary(topology, folder))
    say_written(files)
