"""``pgm-places reproduce``: the door to the paper's experiments, which a checkout holds."""

import sys
from importlib import import_module
from pathlib import Path
from typing import Annotated

from pgm_places.cli.arguments import Force, Out, Quiet, Threads
from pgm_places.cli.declarations import Argument
from pgm_places.errors import InputError

_CHECKOUT = Path(__file__).resolve().parents[2]


def reproduce(
    names: Annotated[list[str] | None, Argument("SECTION...")] = None,
    out: Out = Path("reproduced"),
    again: bool = False,
    force: Force = False,
    n_threads: Threads = None,
    quiet: Quiet = False,
) -> None:
    """Reproduce the experiments of the paper. Writes a page comparing its figures with ours.

    Parameters
    ----------
    names
        Sections such as 7.1 7.5; all by default.
    again
        Rerun sections that have already been run.
    """
    if not (_CHECKOUT / "experiments" / "paper").is_dir():
        raise InputError(
            "the paper's experiments come with the source, not with the installed package; get a "
            "checkout of it, run 'pip install --editable .' there, and try again"
        )
    if str(_CHECKOUT) not in sys.path:
        sys.path.insert(0, str(_CHECKOUT))
    paper = import_module("experiments.paper.command")
    paper.reproduce(names or (), out, again=again, force=force, n_threads=n_threads, quiet=quiet)
