"""Kills commands at steps drawn by chance; asserts that each leaves one run's files.

A script of its own, because it forks: ``python -m tests.faults.killed_commands FOLDER KILLS SEED
COMMAND...``.
Everything is imported before the first fork, so that a kill is cheap.
"""

import contextlib
import io
import json
import random
import sys
from collections.abc import Sequence
from functools import partial
from pathlib import Path

from experiments.paper.__main__ import main as reproduce_paper
from experiments.paper.section import Outcome
from experiments.paper.sections import PaperSection
from pgm_places.cli.entry import main
from pgm_places.io.atomic import tidy
from pgm_places.io.logs.trajectories import write_trajectory
from pgm_places.io.maps.label_image import save_labels
from pgm_places.io.maps.map_server import save_map
from pgm_places.io.places.topology_files import load_topology
from pgm_places.persistence.model_folder import load_folder
from pgm_places.simulation import generate_building
from tests.drives import drive
from tests.faults.sets import check_record
from tests.faults.steps import count_steps, killed_at, leftovers

RUNS = ("old", "new")
ALIKE = ("topology", "export", "simulate-map")
"""Commands whose files do not say what was read: they are compared with those of a quiet run."""
CONFIG = """\
title = "the {name} run"
resolution_m = 0.4

[labels]
names = ["corridor", "room", "doorway"]

[classifier]
n_rounds = 2
n_folds = 2
order = "heuristic"

[space]
n_rounds = 2

[context]
half_widths_m = []

[[train]]
map = "{name}.yaml"
labels = "{name}_labels.png"

[[test]]
map = "{name}.yaml"
labels = "{name}_labels.png"

[[methods]]
name = "independent"
"""


def make_inputs(folder: Path, commands: Sequence[str]) -> None:
    """Two maps, two configurations, two logs, and what some commands need of others."""
    for seed, name in enumerate(RUNS):
        made = generate_building(size="small", seed=seed)
        save_map(made.grid, folder / name)
        save_labels(folder / f"{name}_labels.png", made.labels, made.label_names)
        (folder / f"{name}.toml").write_text(CONFIG.format(name=name))
        write_trajectory(folder / f"{name}.log", drive(seed)[:10])
        if "export" in commands:
            run(folder, "topology", name, folder / f"{name}_places")
    if {"label", "track"} & set(commands):
        run(folder, "train", "old", folder / "model")


def run(folder: Path, command: str, name: str, out: Path) -> None:
    """Run a command on the old or the new inputs."""
    given = folder / f"{name}.yaml", folder / f"{name}_labels.png"
    options: dict[str, list[object]] = {
        "label": [given[0], "--model", folder / "model", "--quiet"],
        "track": [folder / f"{name}.log", "--model", folder / "model", "--quiet"],
        "train": [folder / f"{name}.toml", "--quiet"],
        "compare": [folder / f"{name}.toml", "--quiet"],
        "topology": [given[1], given[0], "--quiet"],
        "export": [folder / f"{name}_places", "--to", "regions"],
        "simulate-map": [
            *(folder / "old.yaml", "--labels", folder / "old_labels.png", "--quiet"),
            *("--bend", "0.0,0.0" if name == "old" else "0.03,0.03"),
        ],
        "reproduce": ["7.1", "--again", "--quiet"],
    }
    words = [*map(str, options[command]), "--out", str(out)]
    PaperSection.run = property(lambda _: lambda _: stand_in(name))  # type: ignore[assignment, method-assign]
    sys.argv = ["pgm-places", command, *words]
    try:
        with contextlib.redirect_stdout(io.StringIO()):
            if command == "reproduce":
                reproduce_paper(words)
            else:
                main()
    except SystemExit as ended:
        if ended.code:
            raise


def stand_in(name: str) -> Outcome:
    """An experiment of no time, whose files tell which run it was."""
    return Outcome(name, files={f"{letter}.png": name.encode() for letter in "abc"})


def run_that_wrote(out: Path, command: str) -> str:
    """Which run the folder is of, after all its files were found to be of one."""
    tidy(out)
    if command != "train":
        check_record(out)
    if command in ALIKE:
        [name] = [name for name in RUNS if written(out) == written(reference(out, name))]
        return name
    if command == "train":
        record = load_folder(out)[0]["record"]  # which checks the SHA-256 of the numbers
        return str(record["config"]["title"]).split()[1]
    if command == "label":
        return Path(json.loads((out / "details" / "summary.json").read_text())["map"]).stem
    if command == "compare":
        return str(json.loads((out / "results.json").read_text())["title"]).split()[1]
    if command == "reproduce":
        [name] = {(out / "7.1" / f"{letter}.png").read_text() for letter in "abc"}
        assert json.loads((out / "7.1" / "section.json").read_text())["setting"] == name
        assert name in (out / "reproduce.md").read_text()
        return name
    [name] = [name for name in RUNS if f"<title>{name}" in (out / "report.html").read_text()]
    return name


def reference(out: Path, name: str) -> Path:
    """Where a run was written that nothing disturbed."""
    return out.with_name(f"{out.name}_{name}")


def written(folder: Path) -> object:
    """What a command writes alike every time: areas of places, which have new ids, or all files."""
    if (folder / "places.json").exists():
        return sorted(region.area_m2 for region in load_topology(folder).regions)
    return {
        path.relative_to(folder).as_posix(): path.read_bytes()
        for path in folder.rglob("*")
        if path.is_file() and path.name[0] != "."
    }


def check_kills(folder: Path, command: str, n_kills: int, seed: int) -> None:
    """Kill a command at random steps while it replaces what an earlier run wrote."""
    out = folder / f"killed_{command}"
    for name in RUNS if command in ALIKE else ():
        run(folder, command, name, reference(out, name))
    run(folder, command, "old", out)
    n_steps = count_steps(partial(run, folder, command, "new", out))
    run(folder, command, "old", out)
    chance = random.Random(f"{command} {seed}")
    for number in sorted(chance.choices(range(1, n_steps + 1), k=n_kills)):
        if run_that_wrote(out, command) == "new":
            run(folder, command, "old", out)
        killed = killed_at(number, partial(run, folder, command, "new", out))
        found = run_that_wrote(out, command)
        end = "killed" if killed else "ended"
        sys.stdout.write(f"{command}: step {number} of {n_steps}, {end}, {found}\n")
        sys.stdout.flush()
    run(folder, command, "new", out)
    assert run_that_wrote(out, command) == "new"
    assert not leftovers(out)


if __name__ == "__main__":
    _, inputs, kills, drawn_by, *names = sys.argv
    make_inputs(Path(inputs), names)
    for name in names:
        check_kills(Path(inputs), name, int(kills), int(drawn_by))
