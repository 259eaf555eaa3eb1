"""The ``pgm-places`` command: its frame, and its commands in the order of its help."""

from typing import Annotated

import typer

from pgm_places._version import __version__
from pgm_places.cli.doctor import doctor
from pgm_places.cli.experiments import compare, demo, train
from pgm_places.cli.explain import explain
from pgm_places.cli.label import label
from pgm_places.cli.live import live
from pgm_places.cli.place_edits import merge, rename, split
from pgm_places.cli.places import export, topology, where
from pgm_places.cli.reproduce import reproduce
from pgm_places.cli.simulate import simulate
from pgm_places.cli.simulate_map import simulate_map
from pgm_places.cli.studio import studio
from pgm_places.cli.terminal import say
from pgm_places.cli.track import track

__all__ = ["app"]

COMMANDS = (
    *(demo, compare, train, label, studio),
    *(topology, export, where, rename, merge, split, explain),
    *(simulate, simulate_map, track, live, reproduce, doctor),
)
TAKE_POSITIONS = {where, split, explain}
"""Commands whose arguments may be negative numbers, which look like flags."""

app = typer.Typer(
    name="pgm-places",
    help="Label the places of a robot's map: corridor, room, doorway, or your own.",
    no_args_is_help=True,
    add_completion=True,
    pretty_exceptions_enable=False,
    rich_markup_mode=None,  # plain help starts faster and reads the same everywhere
)
for command in COMMANDS:
    app.command(context_settings={"ignore_unknown_options": command in TAKE_POSITIONS})(command)


def _show_version(wanted: bool) -> None:
    if wanted:
        say(f"pgm-places {__version__}")
        raise typer.Exit


@app.callback()
def _options(
    _version: Annotated[
        bool,
        typer.Option("--version", callback=_show_version, is_eager=True, help="Show the version."),
    ] = False,
) -> None:
    """Label the places of a robot's map: corridor, room, doorway, or your own."""
