"""The ``pgm-places`` command: its frame, and its commands in the order of its help."""

import importlib
from collections.abc import Sequence
from typing import Annotated

import typer

from pgm_places._version import __version__
from pgm_places.cli.terminal import say

__all__ = ["app_for"]

COMMANDS = {
    "demo": "experiments",
    "compare": "experiments",
    "train": "experiments",
    "label": "label",
    "studio": "studio",
    "topology": "places",
    "export": "places",
    "where": "places",
    "rename": "place_edits",
    "merge": "place_edits",
    "split": "place_edits",
    "explain": "explain",
    "simulate": "simulate",
    "simulate-map": "simulate_map",
    "track": "track",
    "live": "live",
    "reproduce": "reproduce",
    "doctor": "doctor",
}
"""The module of each command."""

TAKE_POSITIONS = {"where", "split", "explain"}
"""Commands whose arguments may be negative numbers, which look like flags."""


def app_for(arguments: Sequence[str]) -> typer.Typer:
    """The command line, with the only command that these arguments can run, or with all.

    Declaring all of them takes longer than a short command runs.
    """
    app = typer.Typer(
        name="pgm-places",
        help="Label the places of a robot's map: corridor, room, doorway, or your own.",
        no_args_is_help=True,
        add_completion=True,
        pretty_exceptions_enable=False,
        rich_markup_mode=None,  # plain help starts faster and reads the same everywhere
    )
    app.callback()(_options)
    named = [name for name in arguments[:1] if name in COMMANDS]
    for name in named or COMMANDS:
        module = importlib.import_module(f"pgm_places.cli.{COMMANDS[name]}")
        settings = {"ignore_unknown_options": name in TAKE_POSITIONS}
        app.command(name, context_settings=settings)(getattr(module, name.replace("-", "_")))
    return app


def _show_version(wanted: bool) -> None:
    if wanted:
        say(f"pgm-places {__version__}")
        raise typer.Exit


def _options(
    _version: Annotated[
        bool,
        typer.Option("--version", callback=_show_version, is_eager=True, help="Show the version."),
    ] = False,
) -> None:
    """Label the places of a robot's map: corridor, room, doorway, or your own."""
