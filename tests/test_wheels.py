"""The configuration by which wheels are built for all platforms."""

import re
import runpy
import tomllib
from pathlib import Path
from typing import Any

import pytest
import yaml

ROOT = Path(__file__).resolve().parent.parent


def configuration() -> dict[str, Any]:
    return tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))


def test_each_python_finds_a_wheel() -> None:
    settings = configuration()
    oldest = settings["project"]["requires-python"].removeprefix(">=").replace(".", "")
    stable = settings["tool"]["scikit-build"]["wheel"]["py-api"]
    before = [f"cp{minor}" for minor in range(int(oldest), int(stable.removeprefix("cp")))]
    built = settings["tool"]["cibuildwheel"]["build"]
    assert built == [f"{python}-*" for python in [*before, stable]]


def test_five_platforms_are_built_and_what_tries_them_is_there() -> None:
    wheels = configuration()["tool"]["cibuildwheel"]
    assert sum(len(wheels[system]["archs"]) for system in ("linux", "macos", "windows")) == 5
    words = " ".join(wheels["test-command"]).split()
    paths = [*wheels["test-sources"], *(word for word in words if word.startswith("tests/"))]
    assert [path for path in paths if not (ROOT / path).exists()] == []


def test_a_checkout_without_symbolic_links_is_refused_in_one_line(tmp_path: Path) -> None:
    check_links = runpy.run_path(str(ROOT / "tools" / "core.py"))["check_links"]
    check_links(ROOT)
    for name in ("solvers", "simulation", "training", "studio", "live"):
        (tmp_path / "pgm_places" / name).mkdir(parents=True)
    (tmp_path / "pgm_places" / "models").write_text("../models")  # as git writes it on Windows
    with pytest.raises(SystemExit, match="pgm_places/models must be a symbolic link") as ended:
        check_links(tmp_path)
    assert "git checkout -- pgm_places/models'" in str(ended.value)
    assert len(str(ended.value).splitlines()) == 1


def test_the_address_of_the_repository_reaches_links_and_metadata() -> None:
    address = runpy.run_path(str(ROOT / "tools" / "address.py"))
    text = "git clone ADDRESS [a](docs/a.md#b) ![c](d.png) [e](https://f) [g](#h)"
    wanted = (
        "git clone https://h/o/n [a](https://h/o/n/blob/v1/docs/a.md#b) "
        "![c](https://h/o/n/raw/v1/d.png) [e](https://f) [g](#h)"
    )
    assert address["with_absolute_links"](text, "https://h/o/n", "v1") == wanted
    table = tomllib.loads(address["urls"]("https://h/o/n"))["project"]["urls"]
    assert table["Repository"] == "https://h/o/n"


def test_every_workflow_and_hook_runs_what_is_there() -> None:
    files = [*(ROOT / ".github").rglob("*.yml"), ROOT / ".readthedocs.yaml"]
    texts = {path.name: path.read_text(encoding="utf-8") for path in files}
    assert all(isinstance(yaml.safe_load(text), dict) for text in texts.values())
    makefile = (ROOT / "Makefile").read_text(encoding="utf-8")
    targets = re.findall(r"run: make (\w+)", "".join(texts.values()))
    assert targets
    assert all(f"\n{target}:" in makefile for target in targets)
    scripts = re.findall(r"(?:bash|python3) ([.\w/]+)", "".join(texts.values()))
    assert [path for path in scripts if not (ROOT / path).is_file()] == []
