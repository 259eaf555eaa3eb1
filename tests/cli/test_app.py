"""The frame of the commands: all of them for help, one of them to run."""

from typing import Any

import pytest
import typer

from pgm_places.cli.app import COMMANDS, app_for


def commands_for(*arguments: str) -> dict[str, Any]:
    group: Any = typer.main.get_command(app_for(arguments))
    return dict(group.commands)


@pytest.mark.parametrize("arguments", [(), ("--help",), ("lable",), ("--version", "label")])
def test_help_and_errors_know_every_command(arguments: tuple[str, ...]) -> None:
    assert list(commands_for(*arguments)) == list(COMMANDS)


@pytest.mark.parametrize("name", COMMANDS)
def test_a_command_alone_is_declared_as_among_the_others(name: str) -> None:
    alone, among = commands_for(name, "--help"), commands_for()[name]
    assert list(alone) == [name]
    assert alone[name].name == name
    assert alone[name].callback.__name__ == name.replace("-", "_")
    assert [repr(item) for item in alone[name].params] == [repr(item) for item in among.params]
