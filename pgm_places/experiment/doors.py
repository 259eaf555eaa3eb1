"""How many doors of a map, or passages of a drive, a method found, missed and invented."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from pgm_places.experiment.evaluated_items import EvalDrive, EvalMap
from pgm_places.inference.labeling import Labeling
from pgm_places.spaces.door_truth import DoorScores, match_doors, match_painted
from pgm_places.unary.space_model import MapSpaces

PASSAGE_M = 0.3
"""A doorway that is labelled this much before or after it was passed through has been found."""


def door_scores(item: EvalMap, labeling: Labeling, doorway: int) -> DoorScores:
    """How many doors of a map a method found, missed and invented.

    Its doors are the connected pieces of cells that it labelled as doorways.

    Parameters
    ----------
    item : EvalMap
    labeling : Labeling
        Of the map's layout.
    doorway : int
        The label of doorways.
    """
    painted = item.layout.to_raster(labeling.labels.astype(np.int16), fill=-1)
    match = match_painted(painted, item.grid, _known(item), doorway)
    return match.scores(np.ones(len(match.door), np.bool_))


def gate_scores(item: EvalMap, spaces: MapSpaces, doorway: int) -> DoorScores:
    """How many doors of a map the accepted gates match, independent of a method's labels."""
    match = match_doors(spaces.gates, _known(item), doorway)
    return match.scores(spaces.places.accepted)


def _known(item: EvalMap) -> NDArray[np.int16]:
    """(H, W) the true labels inside the window, -1 elsewhere."""
    return np.where(item.window, item.truth, np.int16(-1))


def passage_scores(item: EvalDrive, labeling: Labeling, doorway: int) -> DoorScores:
    """How many doorways that a drive passes through a method found, missed and invented.

    A passage is a run of steps in a doorway that is entered and left, and counts once, however many
    steps it takes. It is found if some step within ``PASSAGE_M`` of it along the path is labelled
    doorway. A run of steps labelled doorway that has no doorway so near counts as invented, unless
    the truth is unknown there.
    """
    truth, found = item.node_truth, labeling.labels
    way = np.concatenate([[0.0], np.cumsum(item.trajectory.step_lengths_m)])[: len(truth)]
    around = np.concatenate([[-1], truth, [-1]])
    passages: list[slice] = []
    partial: list[slice] = []
    for run in _runs(truth == doorway):
        whole = around[run.start] >= 0 and around[run.stop + 1] >= 0  # known before and after
        (passages if whole else partial).append(run)

    def meets(one: slice, others: Sequence[slice]) -> bool:
        low, high = way[one.start] - PASSAGE_M, way[one.stop - 1] + PASSAGE_M
        return any(way[other.stop - 1] >= low and way[other.start] <= high for other in others)

    claims = _runs(found == doorway)
    known = [claim for claim in claims if (truth[claim] >= 0).any()]
    known = [claim for claim in known if meets(claim, passages) or not meets(claim, partial)]
    return DoorScores(
        doors=len(passages),
        found=sum(meets(passage, claims) for passage in passages),
        accepted=len(known),
        right=sum(meets(claim, passages) for claim in known),
    )


def _runs(inside: NDArray[np.bool_]) -> list[slice]:
    """The runs of consecutive steps where the mask is true."""
    edges = np.flatnonzero(np.diff(np.concatenate([[0], inside.astype(np.int8), [0]])))
    return [slice(int(first), int(end)) for first, end in edges.reshape(-1, 2)]
