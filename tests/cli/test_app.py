"""The frame of the commands: help, version, completion, and what is refused."""

import re
import shutil
import subprocess

import pytest

from pgm_places._version import __version__
from pgm_places.cli.app import COMMANDS, command
from tests.cli.conftest import Run


def test_the_help_lists_every_command_with_its_first_sentence(run: Run) -> None:
    code, out, _ = run("--help")
    assert (code, out) == run()[:2] == run("-h")[:2]
    lines = out.splitlines()
    assert code == 0 and max(map(len, lines)) <= 80
    listed = lines[lines.index("Label maps:") :]
    rows = [line for line in listed if line.startswith("  ")]
    assert [row.split()[0] for row in rows] == list(COMMANDS)
    assert all(re.fullmatch(r"  \S+ +[A-Z].+\.", row) for row in rows)
    assert len({re.search(r" {2,}[A-Z]", row).end() for row in rows}) == 1  # type: ignore[union-attr]


@pytest.mark.parametrize("name", COMMANDS)
def test_the_help_of_a_command_says_what_each_parameter_means(name: str, run: Run) -> None:
    code, out, _ = run(name, "--help")
    assert code == 0 and max(map(len, out.splitlines())) <= 80
    for item in command(name).parameters:
        text = item.declared.help
        assert text.endswith("."), item.name
        assert "".join(text.split()) in "".join(out.split())
        assert all(flag in out for flag in item.switches)


def test_help_is_an_option_only_before_the_end_of_options(run: Run) -> None:
    assert run("where", "-h")[0] == 0
    code, _, error = run("where", "--", "-h", "0", "0")
    assert (code, error.count("\n")) == (2, 1)


def test_a_switch_shows_both_its_flags_and_which_holds(run: Run) -> None:
    text = " ".join(run("topology", "--help")[1].split())
    assert "--correct/--no-correct Correct erroneous regions. [default: --correct]" in text
    assert "-o, --out PATH Folder for the results; created if needed. [required]" in text


def test_version(run: Run) -> None:
    assert run("--version") == (0, f"pgm-places {__version__}\n", "")


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["lable"], "there is no command 'lable'. Did you mean 'label'?"),
        (["--versoin"], "there is no option '--versoin'. Did you mean '--version'?"),
    ],
)
def test_what_there_is_not_is_one_line(words: list[str], said: str, run: Run) -> None:
    code, out, error = run(*words)
    assert (code, out, error.count("\n")) == (2, "", 1)
    assert said in error


@pytest.mark.skipif(not shutil.which("bash"), reason="there is no bash")
@pytest.mark.parametrize(
    ("words", "found"),
    [
        (["wh"], ["where"]),
        (["--v"], ["--version"]),
        (["label", "--me"], ["--method", "--memory"]),
        (["label", "-"], ["-m", "-o", "-q", "-j"]),
        (["topology", "--no-c"], ["--no-correct"]),
        (["label", "x"], []),
    ],
)
def test_bash_completes_commands_and_flags(words: list[str], found: list[str], run: Run) -> None:
    _, script, _ = run("--show-completion")
    asked = (
        f"COMP_WORDS=(pgm-places {' '.join(words)}); COMP_CWORD={len(words)}\n"
        '_pgm_places; echo "${COMPREPLY[@]}"'
    )
    ended = subprocess.run(
        ["bash", "-c", f"{script}\n{asked}"], capture_output=True, text=True, check=True
    )
    assert set(found) <= set(ended.stdout.split())
    assert found or not ended.stdout.split()
