"""The command lines of the documentation: each parses, and those that can run do."""

import re
import shlex
import sys
from pathlib import Path

import pytest

from pgm_places.cli.app import COMMANDS, command
from pgm_places.cli.entry import main
from pgm_places.errors import InputError
from pgm_places.io.maps.label_image import save_labels
from pgm_places.io.maps.map_server import save_map
from pgm_places.simulation import generate_building
from tests.faults.killed_commands import CONFIG

ROOT = Path(__file__).parents[1]
PAGES = [ROOT / "README.md", ROOT / "CONTRIBUTING.md", *sorted((ROOT / "docs").glob("*.md"))]
BLOCK = re.compile(r"^```(?:console|bash|sh)\n(.*?)^```", re.MULTILINE | re.DOTALL)
QUOTED = re.compile(r"`(pgm-places [^`]+)`")

RUN_PAGES = ("README.md", "ros.md", "places.md", "training_data.md")
"""Pages whose lines run one after the other in one folder, with the files of ``reader``."""


def our_words(line: str) -> list[str]:
    """The arguments of pgm-places in a line of a shell; none where it runs something else."""
    words = shlex.split(line, comments=True)
    while words and re.fullmatch(r"[A-Z_]+=.*", words[0]):
        del words[0]  # a variable of the environment
    return words[1:] if words and Path(words[0]).name == "pgm-places" else []


def console_lines(page: Path) -> list[list[str]]:
    """The arguments of our command in each line of a page's blocks, less comments."""
    blocks = "\n".join(BLOCK.findall(page.read_text(encoding="utf-8"))).replace("\\\n", " ")
    lines = [our_words(line[2:]) for line in blocks.splitlines() if line.startswith("$ ")]
    return [words for words in lines if words]


LINES = {
    f"{page.name}: {shlex.join(words)}": words for page in PAGES for words in console_lines(page)
}
MENTIONS = {
    f"{page.name}: {line}": our_words(line)
    for page in PAGES
    for line in QUOTED.findall(page.read_text(encoding="utf-8"))
}


def parse(words: list[str]) -> None:
    """Parse a command line as the command would, and run nothing."""
    assert words[0] in COMMANDS, f"there is no command {words[0]!r}"
    if "--help" not in words:
        command(words[0]).values(words[1:])


def test_there_are_lines_to_test() -> None:
    names = {"label", "train", "compare", "topology", "where", "export", "track", "simulate"}
    assert names <= {words[0] for words in LINES.values()}
    assert len(MENTIONS) > 10


@pytest.mark.parametrize("line", LINES)
def test_a_line_of_a_console_parses(line: str) -> None:
    parse(LINES[line])


@pytest.mark.parametrize("line", MENTIONS)
def test_a_command_in_running_text_has_the_flags_it_is_said_to_have(line: str) -> None:
    name, *words = MENTIONS[line]
    if name == "--help":
        return
    known = {flag for item in command(name).parameters for flag in item.switches} | {"--help"}
    assert {word for word in words if re.match("--?[a-z]", word)} <= known


@pytest.mark.parametrize(
    ("line", "message"),
    [
        ("lable map.yaml", "there is no command 'lable'"),
        ("label map.yaml", "--out must be given"),
        ("topology labels.png map.yaml --map map.yaml --out out", "there is no option --map"),
        ("label map.yaml --out", "--out needs a value"),
    ],
)
def test_a_wrong_line_does_not_parse(line: str, message: str) -> None:
    with pytest.raises((AssertionError, InputError)) as caught:
        parse(shlex.split(line))
    assert message in str(caught.value)


@pytest.fixture
def reader(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The folder of a reader who has maps, labels and a configuration."""
    made = generate_building(size="small", resolution_m=0.1)
    for name in ("map", "office", "plan"):
        save_map(made.grid, tmp_path / name, image_format="pgm")
        save_labels(tmp_path / f"{name}_labels.png", made.labels, made.label_names)
    save_labels(tmp_path / "labels.png", made.labels, made.label_names)
    (tmp_path / "office.toml").write_text(CONFIG.format(name="office"))
    monkeypatch.chdir(tmp_path)
    return tmp_path


def exit_code(words: list[str], monkeypatch: pytest.MonkeyPatch) -> int:
    monkeypatch.setattr(sys, "argv", ["pgm-places", *words])
    with pytest.raises(SystemExit) as ended:
        main()
    return int(ended.value.code or 0)


@pytest.mark.parametrize("page", RUN_PAGES)
def test_the_lines_of_a_page_run(
    page: str, reader: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    for model in ("model", "office-model"):
        if page != "README.md":  # which trains it
            assert exit_code(["train", "office.toml", "--out", model, "-q"], monkeypatch) == 0
    path = next(path for path in PAGES if path.name == page)
    n_run = 0
    for words in console_lines(path):
        shipped = words[0] in ("label", "track") and "--model" not in words
        if shipped and words[0] == "label" and page != "README.md":
            words, shipped = [*words, "--model", "office-model"], False  # smaller, as quick
        if shipped or words[0] in ("demo", "studio", "live"):
            continue  # tests/cli, tests/studio and tests/live run these and the shipped models
        quiet = [] if words[0] in ("doctor", "where", "export") else ["--quiet"]
        code = exit_code([*words, *quiet], monkeypatch)
        message = capsys.readouterr().err
        assert code == 0 or (words[0] == "where" and code == 1), f"{shlex.join(words)}: {message}"
        n_run += 1
    assert n_run
