"""The arguments that several commands share."""

from pathlib import Path
from typing import Annotated

from pgm_places.cli.declarations import Argument, Option
from pgm_places.options import UnknownGrey, Whole

Config = Annotated[Path, Argument(metavar="CONFIG.toml", help="Experiment configuration (TOML).")]
Places = Annotated[Path, Argument(metavar="DIR", help="Folder written by label or topology.")]
Place = Annotated[str, Argument(metavar="PLACE", help="Name or id of a place.")]

Out = Annotated[Path, Option("--out", "-o", help="Folder for the results; created if needed.")]
Cache = Annotated[
    Path | None, Option(metavar="DIR", help="Cache the features of training maps in this folder.")
]
Threads = Annotated[
    Whole | None, Option("--threads", help="Number of threads; all cores by default.")
]
Model = Annotated[
    str, Option("--model", "-m", help="Folder written by 'train', or the name of a shipped model.")
]
Method = Annotated[str | None, Option(help="Method of the model; its last one by default.")]
UnknownValue = Annotated[
    UnknownGrey | None,
    Option(
        metavar="GREY|none",
        help="Grey value to read as unknown; none to rely on the thresholds alone; by default "
        "205 if the file looks like a map saver's.",
    ),
]
Quiet = Annotated[bool, Option("--quiet", "-q", help="Hide progress.")]
Force = Annotated[
    bool,
    Option(
        "--force", help="Overwrite files that pgm-places did not write, or that were changed since."
    ),
]
ForceMisfit = Annotated[
    bool,
    Option(
        "--force",
        help="Label a drive that does not fit its map; overwrite files that pgm-places did not "
        "write, or that were changed since.",
    ),
]
