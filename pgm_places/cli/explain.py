"""``pgm-places explain``: why a position of a map has its label, as text and as a picture."""

from pathlib import Path
from typing import Annotated

from pgm_places.cli.arguments import Method, Model, Quiet, Threads, UnknownValue, read_map
from pgm_places.cli.declarations import Argument, Option
from pgm_places.cli.terminal import make_progress, say


def explain(
    map_yaml: Annotated[Path, Argument("MAP.yaml")],
    x: Annotated[float, Argument("X")],
    y: Annotated[float, Argument("Y")],
    out: Annotated[Path | None, Option("--out", "-o")] = None,
    model: Model = "default",
    method: Method = None,
    corrections: Path | None = None,
    unknown_value: UnknownValue = None,
    n_threads: Threads = None,
    quiet: Quiet = False,
) -> None:
    """Explain the label at a position. Shows the evidence of its scan, place and graph.

    Names such as f27_sd are laser features, which the documentation lists under Features; names
    such as way_out[0.9] are space features at one scale (m), listed under Gates and corrections.

    Parameters
    ----------
    map_yaml
        A map_server map.
    x, y
        Position in the map frame (m).
    out
        Write a picture of it (PNG).
    corrections : FILE.png|FILE.geojson
        Known labels, as for label.
    """
    from pgm_places.io.atomic import write_bytes
    from pgm_places.labelling.model import LoadedModel
    from pgm_places.labelling.options import ModelOptions
    from pgm_places.report.explanation_picture import explanation_lines, explanation_picture
    from pgm_places.teaching.explanation import explain_cell, explain_region
    from pgm_places.teaching.interactive_labeler import InteractiveLabeler
    from pgm_places.teaching.paint import Paint
    from pgm_places.teaching.reasons import value_with_unit

    progress = make_progress(quiet=quiet)
    loaded = LoadedModel.load(ModelOptions(model=model, method=method))
    grid = read_map(map_yaml, unknown_value, progress).grid
    teacher = InteractiveLabeler(grid, loaded, n_threads=n_threads)
    paint = teacher.blank()
    if corrections is not None:
        paint = Paint.read(corrections, grid, teacher.classes)
    taught = teacher.label(paint, progress=progress)
    explanation = explain_cell(taught, x, y)
    for line in explanation_lines(explanation):
        say(line)
    if (place := explanation.region) is not None:
        of_region = explain_region(taught, place.id)
        shape = [
            f"{name} {value_with_unit(name, of_region.features[name], of_space=True)}"
            for name in list(of_region.features)[:6]
        ]
        gates = [f"{gate.width_m:.2f} m ({100 * p:.0f} %)" for gate, p in of_region.gates[:6]]
        if shape:
            say(f"space between gates that holds most of {place.name}: {', '.join(shape)}")
            say(f"gates next to it: {', '.join(gates) or 'none'}")
    if out is not None:
        say(f"wrote {write_bytes(out, explanation_picture(taught, explanation))}")
