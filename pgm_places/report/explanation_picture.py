"""Picture of the explanation of a label: the scan on the map, and the votes of features."""

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pgm_places.palette import label_colours
from pgm_places.pictures.canvas import label_canvas, view_of
from pgm_places.pictures.drawing import INK, MUTED, Drawing, text_width
from pgm_places.teaching.interactive_labeler import InteractiveResult
from pgm_places.teaching.reasons import CellExplanation, FeatureVote, Question, value_with_unit

_EDGE, _MAP, _ROW, _PANEL = 24, 560, 21, 500
_BAR = 110
_MOST_VOTES, _MOST_LINES = 7, 5
_FOR, _AGAINST = "#2f7d4f", "#b5482a"
_BEAM = "#1f5fa8"


def explanation_lines(found: CellExplanation) -> list[str]:
    """The explanation as lines of text."""
    alone = "" if found.label == found.alone else f"; without its neighbours {found.alone}"
    painted = " (painted)" if found.painted else ""
    place = "" if found.region is None else f", {found.region.name}"
    lines = [f"({found.x_m:.2f}, {found.y_m:.2f}){place}: {found.label}{painted}{alone}"]
    for name, values in (
        ("after the graph", found.probabilities),
        ("before the graph", found.probabilities_alone),
    ):
        if values is not None:
            lines.append(f"{name}: {_shares(values)}")
    for question in found.questions:
        lines.append(
            f"{question.label}? log-odds {question.log_odds:+.2f} = {question.bias:+.2f} "
            f"{question.from_scan:+.2f} by the scan {question.from_spaces:+.2f} by the space around"
        )
        lines += [
            f"  {vote.log_odds:+.2f}  {vote.name} = {_with_unit(vote, vote.value)} (threshold "
            f"{_with_unit(vote, vote.threshold)})"
            for vote in question.votes[:_MOST_LINES]
        ]
    if found.gate_probability is not None:
        lines.append(f"doorway here: {_gate_text(found)}")
    if found.networks is not None:
        lines.append(f"floor networks: {_shares(found.networks)}")
    if found.doorway_log_odds:
        added = f"{found.doorway_log_odds:+.2f} to the log-odds of a doorway"
        lines.append(f"where the accepted gates are: {added}")
    towards = sum(item.towards for item in found.neighbours)
    if found.label != found.alone:
        lines.append(
            f"neighbours: {len(found.neighbours)}, together {towards:+.2f} towards {found.label} "
            f"rather than {found.alone}"
        )
    return lines


def _with_unit(vote: FeatureVote, value: float) -> str:
    return value_with_unit(vote.name, value, of_space=vote.of_space)


def _shares(probabilities: Mapping[str, float]) -> str:
    return ", ".join(f"{label} {100 * p:.1f} %" for label, p in probabilities.items())


def _gate_text(found: CellExplanation) -> str:
    at = (
        "no gate" if not found.gate_probability else f"gate of {100 * found.gate_probability:.0f} %"
    )
    return f"{at}, which adds {found.gate_log_odds:+.2f} to its log-odds"


def explanation_picture(taught: InteractiveResult, found: CellExplanation) -> bytes:
    """A PNG file: the scan over the labelled map, and the features with the largest votes."""
    colours = dict(zip(taught.label_names, label_colours(taught.label_names), strict=True))
    votes = [question.votes[:_MOST_VOTES] for question in found.questions]
    height = _EDGE + 74 + sum((len(part) + 3) * _ROW for part in votes) + 40
    height = max(height, _EDGE + 74 + 460)
    panel = _map_panel(taught, found, (_MAP, height - 2 * _EDGE - 60))
    left = 2 * _EDGE + panel.image.width
    page = Drawing(left + _PANEL + _EDGE, height)
    title = f"{found.label} at ({found.x_m:.2f}, {found.y_m:.2f})"
    page.text(_EDGE, _EDGE + 8, title, size=20, bold=True)
    page.text(_EDGE, _EDGE + 36, _subtitle(found), size=14, colour=MUTED)
    page.paste(panel, _EDGE, _EDGE + 60)
    y = _EDGE + 70.0
    for question, part in zip(found.questions, votes, strict=True):
        y = _draw_question(page, question, part, colours.get(question.label, INK), (left, y))
    if found.gate_probability is not None:
        page.text(left, y + 6, f"doorway: {_gate_text(found)}", size=13)
    return page.png()


def _subtitle(found: CellExplanation) -> str:
    parts = [] if found.region is None else [found.region.name]
    for name, values in (("", found.probabilities), ("alone ", found.probabilities_alone)):
        if values is not None:
            best = max(values, key=lambda label: values[label])
            parts.append(f"{name}{100 * values[best]:.0f} % {best}")
    return ", ".join([*parts, "painted"] if found.painted else parts)


def _map_panel(taught: InteractiveResult, found: CellExplanation, size: tuple[int, int]) -> Drawing:
    """The labelled map around the cell with the beams of its scan, limited in size."""
    grid = taught.grid
    here = np.array([found.x_m, found.y_m])
    ways = np.stack([np.cos(found.angles_rad), np.sin(found.angles_rad)], axis=1)
    ends = here + found.ranges_m[:, None] * ways
    cells = grid.cells_at_m(ends).clip(0, np.array(grid.shape) - 1)
    shown = np.zeros(grid.shape, np.bool_)
    # Long corridors are cut to the space next to the votes; view_of adds half a metre on each side.
    [middle] = grid.cells_at_m([here])
    reach = np.array([size[1], size[0]]) // 2 - int(0.5 / grid.resolution_m) - 1
    (r0, c0) = np.maximum(np.maximum(cells.min(axis=0), middle - reach), 0)
    (r1, c1) = np.minimum(cells.max(axis=0), middle + reach)
    shown[r0 : r1 + 1, c0 : c1 + 1] = True
    view = view_of(grid, shown, most_pixels=size[0] * size[1])
    canvas = label_canvas(grid, taught.labels, taught.label_names, view)
    height, width = canvas.indices.shape
    scale = max(1, min(size[0] // width, size[1] // height))
    panel = Drawing.of(canvas, scale)

    def pixels(points: ArrayLike) -> NDArray[np.float64]:
        return scale * view.pixels_at_m(grid, points)

    for end in ends[::3]:
        panel.line(pixels([here, end]), colour=_BEAM, width=0.7)
    panel.disc(pixels([here])[0], diameter=11, fill="white", edge=INK)
    return panel


def _draw_question(
    page: Drawing,
    question: Question,
    votes: Sequence[FeatureVote],
    colour: str,
    at: tuple[float, float],
) -> float:
    left, y = at
    page.box(left, y - 7, 14, 14, fill=colour)
    page.text(left + 22, y, f"{question.label}?", size=15, bold=True)
    page.text(
        left + 34 + text_width(f"{question.label}?", 15, bold=True),
        y,
        f"log-odds {question.log_odds:+.1f}: scan {question.from_scan:+.1f}, "
        f"space {question.from_spaces:+.1f}, at first {question.bias:+.1f}",
        size=12,
        colour=MUTED,
    )
    y += _ROW + 3
    widest = max((abs(vote.log_odds) for vote in question.votes), default=1.0) or 1.0
    middle = left + _BAR / 2
    for vote in votes:
        length = _BAR / 2 * abs(vote.log_odds) / widest
        start = middle if vote.log_odds > 0 else middle - length
        page.box(start, y - 6, max(length, 1), 12, fill=_FOR if vote.log_odds > 0 else _AGAINST)
        text = f"{vote.log_odds:+.2f}  {vote.name} = {_with_unit(vote, vote.value)}"
        page.text(left + _BAR + 10, y, text, size=12)
        y += _ROW
    page.line([[middle, y - len(votes) * _ROW - 8], [middle, y - 12]], colour=MUTED, width=1)
    return y + _ROW
