"""The ``pgm-places`` command: its options, and its commands in the order of its help."""

import importlib
from collections.abc import Sequence

from pgm_places.cli.command import HELP, HELP_SWITCHES, Command
from pgm_places.cli.terminal import say
from pgm_places.errors import InputError, nearest_name

_GROUPS = {
    "Label maps": (
        ("experiments", "demo"),
        ("label", "label", "index"),
        ("studio", "studio"),
        ("explain", "explain"),
        ("doctor", "doctor"),
    ),
    "Places of a labelled map": (
        ("places", "topology", "where", "rename", "merge", "split", "export"),
    ),
    "Drives and robots": (
        ("track", "track"),
        ("live", "live"),
        ("simulate", "simulate", "simulate-map"),
    ),
    "Train and evaluate": (("experiments", "train", "compare"),),
}
"""Modules with their commands, in the order of the help and by its headings."""

COMMANDS = {
    name: module for group in _GROUPS.values() for module, *names in group for name in names
}
"""The module of each command."""

_SUMMARY = "Label the places of a robot's map: corridor, room, doorway, or your own."
_OPTIONS = {
    "--version": "Show the version.",
    "--show-completion": "Print the shell completion script for bash or zsh; "
    'eval "$(pgm-places --show-completion)" turns it on.',
}


def command(name: str) -> Command:
    """A command by its name; only its own module is imported."""
    module = importlib.import_module(f"pgm_places.cli.{COMMANDS[name]}")
    return Command(name, getattr(module, name.replace("-", "_")))


def run(words: Sequence[str]) -> None:
    """Run the command of a command line."""
    first, *others = words or [HELP]
    if first in COMMANDS:
        _run(command(first), others)
    elif first in HELP_SWITCHES:
        from pgm_places.cli.command import help_of_all

        groups = {
            title: [command(name) for _, *names in group for name in names]
            for title, group in _GROUPS.items()
        }
        say(help_of_all(_SUMMARY, _OPTIONS, groups))
    elif first == "--version":
        from pgm_places._version import __version__

        say(f"pgm-places {__version__}")
    elif first == "--show-completion":
        from pgm_places.cli.command import completion

        say(completion(_OPTIONS, map(command, COMMANDS)))
    elif first.startswith("-"):
        raise _unknown("option", first, [*_OPTIONS, HELP])
    else:
        raise _unknown("command", first, list(COMMANDS))


def _run(chosen: Command, words: Sequence[str]) -> None:
    options = words[: words.index("--")] if "--" in words else words
    if any(word in HELP_SWITCHES for word in options):
        from pgm_places.cli.command import help_of

        say(help_of(chosen))
    else:
        chosen.run(words)


def _unknown(kind: str, name: str, known: Sequence[str]) -> InputError:
    return InputError(f"there is no {kind} {name!r}. {nearest_name(name, known)}")
