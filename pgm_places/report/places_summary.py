"""Summary of a map's places: counts, uncertain area, and places that could be several rooms."""

import shlex
from pathlib import Path

from pgm_places.pictures.topology_pictures import count_line, marked_checks
from pgm_places.topology.checks import SplitCandidate, doubtful_share, split_candidates
from pgm_places.topology.cuts import line_width_m
from pgm_places.topology.regions import Region
from pgm_places.topology.topological_map import TopologicalMap

_MOST_SPLITS = 5


def places_summary(topology: TopologicalMap, folder: Path | None = None) -> str:
    """Lines with counts and uncertain area; with ``folder``, places that could be several rooms."""
    n = len(topology.corrections)
    fragments = f"{n} fragment{'' if n == 1 else 's'} relabelled or dropped"
    lines = [f"places: {count_line(topology)}; {fragments}"]
    doubt = doubt_summary(topology)
    lines += [] if doubt is None else [doubt]
    if folder is not None and (found := split_candidates(topology)):
        lines += [hidden_line(item) for item in found[:_MOST_SPLITS]]
        more = len(found) - _MOST_SPLITS
        lines += [f"and {more} more place{'' if more == 1 else 's'}"] if more > 0 else []
        command = shlex.join(["pgm-places", "split", str(folder)])
        lines.append(
            f"to split along the lines in topology.png: {command}, or one place: "
            f"{command} {found[0].place.id}"
        )
    return "\n".join(lines)


def edit_summary(before: TopologicalMap, after: TopologicalMap) -> str:
    """Lines that say which places were split into which, and which became part of which."""
    olds, news = ({item.id for item in places.regions} for places in (before, after))
    parts, gone = dict[int, list[str]](), dict[int, list[str]]()
    for item in after.regions:
        if item.id not in olds and (origin := before.region_at(*item.anchor_m)):
            parts.setdefault(origin.id, []).append(_with_area(item))
    for item in before.regions:
        if item.id not in news and (target := after.region_at(*item.anchor_m)):
            gone.setdefault(target.id, []).append(item.name)
    lines = [
        f"{before.place(number).name} was split into "
        + ", ".join([_with_area(after.place(number)), *names])
        for number, names in parts.items()
    ]
    lines += [
        f"{', '.join(names)} became part of {_with_area(after.place(number))}"
        for number, names in gone.items()
    ]
    return "\n".join(lines)


def _with_area(place: Region) -> str:
    return f"{place.name} ({place.area_m2:.1f} m²)"


def hidden_line(item: SplitCandidate) -> str:
    """A split candidate as text: number and areas of its rooms, and widths of the openings."""
    sizes = ", ".join(f"{area_m2:.1f}" for area_m2 in item.areas_m2)
    widths = ", ".join(f"{line_width_m(line):.2f}" for line in item.lines_m)
    openings = "an opening" if len(item.lines_m) == 1 else "openings"
    rooms = f"{item.count} rooms ({sizes} m²)"
    return f"{item.place.name} could be {rooms}, joined by {openings} of {widths} m"


def doubt_summary(topology: TopologicalMap) -> str | None:
    """The uncertain share of the area and the places with most of it; None if unknown."""
    share = doubtful_share(topology)
    if share is None:
        return None
    first = "; ".join(
        f"{check.place.name} ({check.doubtful_m2:.1f} m²"
        + (f" may be {check.second_label})" if check.second_label else ")")
        for check in marked_checks(topology)
    )
    return f"Uncertain: {100 * share:.1f} % of the area." + (
        f" Check first: {first}" if first else ""
    )
