"""The chart "which method?": an SVG whose colours are those of the page around it."""

from experiments.pictures.svg import arrow, box, link, svg, text, write

COLUMNS: dict[str, tuple[tuple[tuple[str, ...], str], ...]] = {
    "the steps of a sequence": (
        (("Does each label last about", "as long every time?"), "semi_markov"),
        (("Do edges have features, or must", "the scores be learned too?"), "crf"),
        (("Otherwise, also online",), "hmm"),
    ),
    "the cells of a map": (
        (("Many millions of cells, or", "beliefs for a next stage?"), "relaxation"),
        (("Must rare labels, such as", "doorways, not be missed?"), "amn"),
        (("Otherwise",), "potts"),
    ),
    "the nodes of another graph": (
        (("Do neighbours repel, follow", "or exclude each other?"), "crf"),
        (("Are some nodes labelled,", "to learn weights from?"), "amn"),
        (("Otherwise",), "potts"),
    ),
}
"""For each kind of problem: questions from top to bottom, and the method if the answer is yes."""

TOP, STEP, BOX = 152, 92, 56
ASKS, METHOD = 232, 118
COLUMN, GAP = ASKS + 28 + METHOD, 20
WIDTH, HEIGHT = 3 * COLUMN + 2 * GAP + 2, 468
MIDDLE = 1 + COLUMN + GAP + ASKS / 2


def column(number: int, title: str) -> list[str]:
    """The questions of one kind of problem, below each other."""
    left = 1 + number * (COLUMN + GAP)
    middle = left + ASKS / 2
    parts = [
        arrow((MIDDLE, 50), (MIDDLE, 68), (middle, 68), (middle, 86)),
        box(left, 90, ASKS, 34),
        text(middle, 107, title, "head"),
    ]
    y = TOP
    for lines, name in COLUMNS[title]:
        last = len(lines) == 1
        parts.append(arrow((middle, y - 28 if y == TOP else y - 36), (middle, y - 4)))
        if y > TOP:
            parts.append(text(middle + 8, y - 22, "no", "small", "start"))
        parts.append(box(left, y, ASKS, BOX))
        first = y + BOX / 2 - 9 * (len(lines) - 1)
        parts += [text(middle, first + 18 * n, line, "small") for n, line in enumerate(lines)]
        parts.append(arrow((left + ASKS, y + BOX / 2), (left + ASKS + 24, y + BOX / 2)))
        if not last:
            parts.append(text(left + ASKS + 12, y + BOX / 2 - 11, "yes", "small"))
        parts.append(link(left + ASKS + 28, y + (BOX - 34) / 2, METHOD, name, name))
        y += STEP
    return parts


def which_method() -> None:
    """Write the chart; every method in it is a link."""
    parts = [
        box(MIDDLE - 110, 12, 220, 38),
        text(MIDDLE, 31, "What is to be labelled?", "head"),
    ]
    for number, title in enumerate(COLUMNS):
        parts += column(number, title)
    y = HEIGHT - 26
    parts += [
        text(0, y, "Every comparison begins with the labels of the classifier alone:", "small",
             "start"),
        link(444, y - 17, METHOD, "independent", "potts"),
    ]  # fmt: skip
    title = "Which method? Questions that lead from the kind of problem to a method"
    write("which_method", svg(WIDTH, HEIGHT, title, parts))
