"""The setting of an experiment on real maps, as its command line asks for it."""

import argparse
from pathlib import Path

from experiments.paper.setting import Setting, data_folder
from pgm_places.cli.terminal import LineProgress


def setting_of(given: argparse.Namespace) -> Setting:
    """The setting of ``--kept`` and ``--threads``."""
    return Setting(data_folder(), LineProgress(), given.threads, given.kept)


def setting_parser(what: str | None = None) -> argparse.ArgumentParser:
    """The arguments that make a setting."""
    found = argparse.ArgumentParser(description=(what or "").partition("\n")[0])
    found.add_argument("--kept", type=Path, help="folder of what is slow to compute")
    found.add_argument("--threads", type=int)
    return found
