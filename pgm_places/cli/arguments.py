"""The arguments that several commands share."""

from pathlib import Path
from typing import Annotated

import typer

__all__ = [
    "Cache",
    "Config",
    "Force",
    "Model",
    "Out",
    "Place",
    "Places",
    "Quiet",
    "Threads",
    "UnknownValue",
]

Config = Annotated[
    Path, typer.Argument(metavar="CONFIG.toml", help="Experiment configuration (TOML).")
]
Places = Annotated[Path, typer.Argument(metavar="DIR", help="Folder written by label or topology.")]
Place = Annotated[str, typer.Argument(metavar="PLACE", help="Name or id of a place.")]

Out = Annotated[
    Path, typer.Option("--out", "-o", help="Folder for the results; created if needed.")
]
Cache = Annotated[
    Path | None,
    typer.Option(metavar="DIR", help="Cache the features of training maps in this folder."),
]
Threads = Annotated[
    int | None, typer.Option("--threads", min=1, help="Number of threads; all cores by default.")
]
Model = Annotated[
    str,
    typer.Option(
        "--model", "-m", help="Folder written by 'train', or the name of a shipped model."
    ),
]
UnknownValue = Annotated[
    int | None,
    typer.Option(min=0, max=255, help="Grey value to read as unknown, such as 205."),
]
Quiet = Annotated[bool, typer.Option("--quiet", "-q", help="Hide progress.")]
Force = Annotated[
    bool,
    typer.Option(
        "--force", help="Overwrite files that pgm-places did not write, or that were changed since."
    ),
]
