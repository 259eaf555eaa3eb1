"""The paper's experiments from a checkout: python -m experiments.paper 7.1 7.5."""

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path

from experiments.paper.command import reproduce
from pgm_places.cli.terminal import complain
from pgm_places.errors import PgmPlacesError


def main(words: Sequence[str] | None = None) -> None:
    """Run the sections that are named, or all."""
    parser = argparse.ArgumentParser(prog="python -m experiments.paper", description=__doc__)
    parser.add_argument("names", nargs="*", metavar="SECTION", help="such as 7.1 7.5; default: all")
    parser.add_argument("--out", type=Path, default=Path("reproduced"), help="folder of the page")
    parser.add_argument(
        "--stockholm",
        type=Path,
        help="folder of COLD-Stockholm, whose floors 6 and 7 are those of section 7.6",
    )
    parser.add_argument("--again", action="store_true", help="rerun sections that are there")
    parser.add_argument("--force", action="store_true", help="write into a folder of other files")
    parser.add_argument("--threads", type=int, dest="n_threads", help="default: all cores")
    parser.add_argument("--quiet", action="store_true", help="say less")
    try:
        reproduce(**vars(parser.parse_args(words)))
    except PgmPlacesError as error:
        complain(f"experiments.paper: {error}")
        sys.exit(2)


if __name__ == "__main__":
    main()
