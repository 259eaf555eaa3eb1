"""Reasons: why a cell has its label, as plain data for the browser."""

from dataclasses import asdict
from typing import Any

import numpy as np

from pgm_places.teaching.explanation import explain_cell
from pgm_places.teaching.reasons import FeatureVote
from pgm_places.teaching.taught import Taught

MOST_VOTES = 4
"""Of each sign, for each class."""
MOST_BEAMS = 180


def reasons_record(taught: Taught, x_m: float, y_m: float) -> dict[str, Any]:
    """The scan of the cell at a position, the votes for each class, its gate and its neighbours.

    Raises
    ------
    InputError
        There is no free cell.
    """
    found = explain_cell(taught, x_m, y_m)
    step = -(-len(found.ranges_m) // MOST_BEAMS)
    ranges, angles = found.ranges_m[::step], found.angles_rad[::step]
    ends = np.stack([x_m + ranges * np.cos(angles), y_m + ranges * np.sin(angles)], axis=1)
    return {
        "painted": found.painted,
        "scan_m": ends.round(3).tolist(),
        "questions": [
            {
                "label": question.label,
                "log_odds": question.log_odds,
                "from_scan": question.from_scan,
                "from_spaces": question.from_spaces,
                "votes": [asdict(vote) for vote in _strongest(question.votes)],
            }
            for question in found.questions
        ],
        "gate_probability": found.gate_probability,
        "gate_log_odds": found.gate_log_odds,
        "networks": found.networks,
        "away_from_gates": found.away_from_gates,
        "pulls": [
            {"at_m": [pull.x_m, pull.y_m], "label": pull.label, "towards": pull.towards}
            for pull in found.neighbours
        ],
    }


def _strongest(votes: tuple[FeatureVote, ...]) -> list[FeatureVote]:
    """The strongest votes for and against, those for first."""
    signs = ([v for v in votes if v.log_odds > 0], [v for v in votes if v.log_odds < 0])
    return [vote for same in signs for vote in same[:MOST_VOTES]]
