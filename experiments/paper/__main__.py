"""The paper's experiments from a checkout: python -m experiments.paper 7.1 7.5."""

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path

from experiments.paper.command import reproduce
from experiments.paper.sections import SECTIONS
from pgm_places.cli.terminal import complain
from pgm_places.errors import PgmPlacesError


def main(words: Sequence[str] | None = None) -> None:
    """Run the sections that are named, or all."""
    parser = argparse.ArgumentParser(prog="python -m experiments.paper", description=__doc__)
    parser.add_argument(
        "names", nargs="*", metavar="SECTION", help=f"any of {', '.join(SECTIONS)}; default: all"
    )
    parser.add_argument(
        "--out",
        type=Path,
        default=Path("reproduced"),
        help="folder of the results; default: reproduced",
    )
    parser.add_argument(
        "--stockholm",
        type=Path,
        help="folder of COLD-Stockholm, the paper's floors of section 7.6: runs 7.6-kth",
    )
    parser.add_argument("--again", action="store_true", help="run finished sections again")
    parser.add_argument("--force", action="store_true", help="write into a folder with other files")
    parser.add_argument(
        "--threads", type=int, dest="n_threads", help="number of threads; default: all cores"
    )
    parser.add_argument("--quiet", action="store_true", help="print no progress")
    try:
        reproduce(**vars(parser.parse_args(words)))
    except PgmPlacesError as error:
        complain(f"experiments.paper: {error}")
        sys.exit(2)


if __name__ == "__main__":
    main()
