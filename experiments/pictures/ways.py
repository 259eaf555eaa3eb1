"""Two diagrams that lead to pages: what to run for what you have, and how a map gets its labels."""

from experiments.pictures.svg import arrow, box, link, svg, text, write

WAYS = (
    ("a map", "label map.yaml", "labels, probabilities, places", ("label a map", "places")),
    ("thousands of maps", "label floors/", "the same for each, and a list", ("many maps",)),
    ("labels that are wrong", "studio map.yaml", "corrected labels, a taught model",
     ("studio",)),
    ("labelled maps", "train office.toml", "a model of your own",
     ("training data", "configuration")),
    ("a drive", "track drive.log", "a label for each step", ("trajectories",)),
    ("a robot that maps", "live --dds", "places that keep their ids", ("live", "ros")),
    ("nodes and edges", "from Python", "labels and their bound", ("own problem", "extending")),
)  # fmt: skip
"""What you have, what you run, what you get, and the pages about it."""
FILES = {"label a map": "first_steps", "many maps": "scale"}

HEADS = ((0, "you have"), (200, "you run: pgm-places"), (420, "you get"), (716, "read"))
WIDTH, TOP, STEP, BOX = 1000, 40, 54, 38
HAVE, GET, PILL = 184, 262, 132

STEPS = (
    (0, 1, ("a map",), "concepts"),
    (1, 0, ("a scan from each", "cell: 321 features"), "features"),
    (1, 2, ("segments, and the", "gates between them"), "gates"),
    (2, 1, ("lists and networks:", "probabilities"), "boosting"),
    (3, 1, ("a graph with", "potentials"), "concepts"),
    (4, 1, ("labels that", "fit together"), "methods"),
    (5, 1, ("rooms and how", "they connect"), "places"),
)
"""Column, row, what is there, and the page about it; each column follows from the one before."""
SIDE, TALL, BETWEEN, HALF_ROW = 138, 58, 33, 62


def ways() -> None:
    """Write the diagram of the guide."""
    parts = [text(x, 16, head, "small", "start") for x, head in HEADS]
    for number, (have, run, get, pages) in enumerate(WAYS):
        y = TOP + number * STEP
        middle = y + BOX / 2
        parts += [
            box(1, y, HAVE, BOX),
            text(HAVE / 2, middle, have, "head"),
            text(292, middle - 9, run, "code"),
            arrow((HAVE + 6, middle + 6), (416, middle + 6)),
            box(420, y, GET, BOX),
            text(420 + GET / 2, middle, get, "small"),
        ]
        for place, page in enumerate(pages):
            x = 716 + place * (PILL + 10)
            parts.append(link(x, y + 2, PILL, page, FILES.get(page, page.replace(" ", "_"))))
    title = "What to run: from what you have to what you get, and the pages about it"
    write("guide", svg(WIDTH, TOP + STEP * len(WAYS), title, parts))


def map_to_labels() -> None:
    """Write the diagram of how it works."""
    parts = []
    for column, row, lines, page in STEPS:
        x, y = 1 + column * (SIDE + BETWEEN), 2 + row * HALF_ROW
        middle = y + TALL / 2
        first = middle - 9 * (len(lines) - 1)
        parts.append(box(x, y, SIDE, TALL))
        parts += [text(x + SIDE / 2, first + 18 * n, line, "small") for n, line in enumerate(lines)]
        parts.append(link(x + 9, y + TALL + 8, SIDE - 18, page, page))
        for before in (step for step in STEPS if step[0] == column - 1):
            start = 2 + before[1] * HALF_ROW + TALL / 2
            bend = x - BETWEEN / 2
            parts.append(
                arrow((x - BETWEEN + 4, start), (bend, start), (bend, middle), (x - 4, middle))
            )
    title = "How a map gets its labels, step by step, and the page about each step"
    write("how_it_works", svg(6 * (SIDE + BETWEEN) - BETWEEN + 2, 4 * HALF_ROW - 20, title, parts))
