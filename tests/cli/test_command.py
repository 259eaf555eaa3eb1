"""What a command line says: arguments in their order, options anywhere, each value checked."""

from pathlib import Path
from typing import Annotated, Any

import pytest

from pgm_places.cli.command import Command
from pgm_places.cli.declarations import Argument, Option
from pgm_places.errors import InputError
from pgm_places.options import Whole
from pgm_places.options.marks import Ge, Le


def draw(
    folder: Annotated[Path, Argument(metavar="DIR", help="A folder.")],
    points: Annotated[list[float] | None, Argument(metavar="X...", help="Numbers.")] = None,
    name: Annotated[str | None, Option(help="A name.")] = None,
    n_lines: Annotated[Whole | None, Option("--lines", "-n", help="Lines.")] = None,
    grey: Annotated[Annotated[int, Ge(0), Le(255)], Option("--grey", help="Grey.")] = 7,
    scale: Annotated[float, Option(help="Scale.")] = 1.0,
    tags: Annotated[list[str] | None, Option("--tag", "-t", help="Tags.")] = None,
    quiet: Annotated[bool, Option("--quiet", "-q", help="Quiet.")] = False,
    fast: Annotated[bool, Option("--fast", "-f", help="Fast.")] = False,
    smooth: Annotated[bool, Option("--smooth/--no-smooth", help="Smooth.")] = True,
) -> None:
    """Draw."""


def said(*words: str) -> dict[str, Any]:
    """What differs from the defaults."""
    plain = {"points": None, "name": None, "n_lines": None, "grey": 7, "scale": 1.0, "tags": None}
    plain |= {"quiet": False, "fast": False, "smooth": True}
    values = Command("draw", draw).values(words)
    return {name: value for name, value in values.items() if plain.get(name, ()) != value}


@pytest.mark.parametrize(
    ("words", "values"),
    [
        (["--name", "b"], {"name": "b"}),
        (["--name=b=c"], {"name": "b=c"}),
        (["--name", "--quiet"], {"name": "--quiet"}),
        (["--name", "a", "--name", ""], {"name": ""}),
        (["--name="], {"name": ""}),
        *((words, {"n_lines": 4}) for words in (["-n4"], ["-n=4"], ["-n", "4"])),
        (["-qf"], {"quiet": True, "fast": True}),
        (["-qn4"], {"quiet": True, "n_lines": 4}),
        (["--no-smooth"], {"smooth": False}),
        (["--no-smooth", "--smooth"], {}),
        (["-t", "a", "--tag", "b"], {"tags": ["a", "b"]}),
        (["--scale", "3"], {"scale": 3.0}),
        (["--scale", "-3"], {"scale": -3.0}),
        (["1", "-2.5", "-q", "-.5", "-1e-3"], {"points": [1.0, -2.5, -0.5, -1e-3], "quiet": True}),
    ],
)
def test_what_words_say(words: list[str], values: dict[str, Any]) -> None:
    assert said("out", *words) == {"folder": Path("out"), **values}
    assert said("-") == {"folder": Path("-")}
    after_dashes = {"folder": Path("--fast"), "points": [-1.0], "quiet": True}
    assert said("-q", "--", "--fast", "-1") == after_dashes


@pytest.mark.parametrize(
    ("words", "message"),
    [
        ([], "DIR must be given; see pgm-places draw --help"),
        (["a", "x"], "X... must be a finite number, got 'x'"),
        (["a", "nan"], "X... must be a finite number, got nan"),
        (["a", "--name"], "--name needs a value"),
        (["a", "--nam", "b"], "there is no option --nam. Did you mean '--name'?"),
        (["a", "-x"], "there is no option -x."),
        (["a", "--quiet=yes"], "--quiet takes no value, got 'yes'"),
        (["a", "--quiet="], "--quiet takes no value, got ''"),
        (["a", "-n", "0"], "--lines must be a whole number of at least 1, got 0"),
        (["a", "-n", "2.5"], "--lines must be a whole number of at least 1, got 2.5"),
        (["a", "--grey", "300"], "--grey must be a whole number from 0 to 255, got 300"),
        (["a", "--grey", "dark"], "--grey must be a whole number from 0 to 255, got 'dark'"),
    ],
)
def test_what_is_refused(words: list[str], message: str) -> None:
    with pytest.raises(InputError) as caught:
        said(*words)
    assert str(caught.value).startswith(message)


def test_an_argument_too_many() -> None:
    def two(
        x: Annotated[float, Argument(metavar="X", help="X.")],
        y: Annotated[float, Argument(metavar="Y", help="Y.")],
    ) -> None:
        """Two."""

    with pytest.raises(InputError, match="unexpected argument '3'; see pgm-places two"):
        Command("two", two).values(["1", "2", "3"])
    with pytest.raises(InputError, match="X and Y must be given"):
        Command("two", two).values([])
