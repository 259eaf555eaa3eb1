"""The setting of an experiment on real maps, as its command line asks for it."""

import argparse
from pathlib import Path

from experiments.paper.setting import Setting, data_folder
from pgm_places.cli.progress import LineProgress

__all__ = ["asked_setting"]


def asked_setting(what: str | None) -> Setting:
    """The setting of ``--kept`` and ``--threads``; ``--help`` begins with the first line."""
    parser = argparse.ArgumentParser(description=(what or "").partition("\n")[0])
    parser.add_argument("--kept", type=Path, help="folder of what is slow to compute")
    parser.add_argument("--threads", type=int)
    given = parser.parse_args()
    return Setting(data_folder(), LineProgress(), given.threads, given.kept)
