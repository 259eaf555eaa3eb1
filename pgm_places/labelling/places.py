"""Finding the places of a labelled map with the rules of its model."""

from collections.abc import Mapping, Sequence

from pgm_places.labelers.labelled_places import LabelledCells
from pgm_places.progress import warn
from pgm_places.spaces.doorways import Doorways
from pgm_places.topology.cuts import Line
from pgm_places.topology.from_labels import topological_map
from pgm_places.topology.place_ids import PlaceIds
from pgm_places.topology.rules import TopologyOptions
from pgm_places.topology.topological_map import TopologicalMap


def separating_gates(doorways: Doorways | None, rules: TopologyOptions) -> Doorways | None:
    """The gates that separate places; None if labels do, by the rules or without gates."""
    gates = doorways if rules.doorways == "gates" else None
    return gates if gates is not None and len(gates) else None


def places_of(
    cells: LabelledCells,
    rules: TopologyOptions,
    *,
    ids: PlaceIds | None = None,
    own_names: Mapping[int, str] | None = None,
    cuts: Sequence[Line] = (),
) -> TopologicalMap:
    """The topological map of labelled cells.

    Parameters
    ----------
    cells : LabelledCells
    rules : TopologyOptions
    ids : PlaceIds, optional
        Earlier places, whose ids and names are reused. A warning is reported if they belong to a
        map with another origin, or to another map.
    own_names : mapping of int to str, optional
        The user's names, by id.
    cuts : sequence of lines
        See :func:`~pgm_places.topology.from_labels.topological_map`.
    """
    if ids is not None and (message := ids.fit_to(cells.grid)):
        warn(message)
    return topological_map(
        cells.grid,
        cells.labels,
        cells.label_names,
        rules=rules,
        correct=rules.correct,
        min_width_m=rules.min_width_m,
        beliefs=cells.beliefs,
        layout=cells.layout,
        hall=cells.hall,
        doorways=separating_gates(cells.doorways, rules),
        known=ids,
        own_names=own_names,
        cuts=cuts,
    )
