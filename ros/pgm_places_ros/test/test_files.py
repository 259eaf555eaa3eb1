"""The files of both packages agree with each other."""

import ast
import re
import sys
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import pytest
from stand_in import PACKAGE

from pgm_places._version import __version__
from pgm_places.live.ros_codec import MESSAGES, TYPES, RosCodec

RELEASE = __version__.partition(".dev")[0]
"""Manifests of ROS allow three numbers only."""
MESSAGES_PACKAGE = PACKAGE.parent / "pgm_places_msgs"


def modules_of(path: Path) -> set[str]:
    """The packages that a file imports."""
    tree = ast.parse(path.read_text(encoding="utf-8"))
    names = [node.module or "" for node in ast.walk(tree) if isinstance(node, ast.ImportFrom)]
    plain = [node for node in ast.walk(tree) if isinstance(node, ast.Import)]
    names += [alias.name for node in plain for alias in node.names]
    return {name.partition(".")[0] for name in names} - set(sys.stdlib_module_names)


def test_the_package_installs_what_it_has(monkeypatch: pytest.MonkeyPatch) -> None:
    manifest = ElementTree.parse(PACKAGE / "package.xml").getroot()
    name = manifest.findtext("name")
    depends = {item.text for item in manifest.findall("exec_depend")}
    assert manifest.findtext("export/build_type") == "ament_python"
    given: dict[str, Any] = {}
    pytest.importorskip("setuptools")  # from Python 3.12 on, virtual environments have none
    monkeypatch.setattr("setuptools.setup", lambda **values: given.update(values))
    setup = PACKAGE / "setup.py"
    exec(compile(setup.read_text(), str(setup), "exec"), {"__file__": str(setup)})
    assert given["name"] == name == PACKAGE.name
    assert given["version"] == manifest.findtext("version") == RELEASE
    assert given["description"] == manifest.findtext("description")
    assert given["packages"] == [name]
    installed = dict(given["data_files"])
    assert installed["share/ament_index/resource_index/packages"] == [f"resource/{name}"]
    for files in installed.values():
        assert all((PACKAGE / file).is_file() for file in files)
    assert given["extras_require"]["test"] == given["tests_require"]
    systems = {"pytest": "python3-pytest", "pyyaml": "python3-yaml"}
    assert {systems[item] for item in given["tests_require"]} == {
        item.text for item in manifest.findall("test_depend")
    }
    assert f"[install]\ninstall_scripts=$base/lib/{name}" in (PACKAGE / "setup.cfg").read_text()
    imported: set[str] = set()
    for file in (PACKAGE / "pgm_places_ros" / "node.py", *(PACKAGE / "launch").iterdir()):
        imported |= modules_of(file)
    assert imported - {"pgm_places"} == depends
    [script] = given["entry_points"]["console_scripts"]
    assert script == f"places = {name}.node:main"
    launch = (PACKAGE / "launch" / "places.launch.py").read_text()
    assert f'package="{name}"' in launch
    assert 'executable="places"' in launch


def test_its_tests_name_what_they_need() -> None:
    manifest = ElementTree.parse(PACKAGE / "package.xml").getroot()
    named = {item.text for item in manifest.findall("test_depend")}
    imported: set[str] = set()
    for file in (PACKAGE / "test").glob("*.py"):
        imported |= modules_of(file)
    needed = imported - {"pgm_places", "stand_in"}
    assert {f"python3-{name}" for name in needed} == named


def fields_of(text: str) -> list[str]:
    """The lines of a definition that count."""
    plain = (re.sub(r"\s+", " ", line.partition("#")[0]).strip() for line in text.splitlines())
    return [line for line in plain if line]


def test_messages_are_those_that_pgm_places_writes() -> None:
    files = {path.stem: path for path in (MESSAGES_PACKAGE / "msg").glob("*.msg")}
    known = {kind.rpartition("/")[2]: text for kind, text in MESSAGES.items()}
    assert files.keys() == known.keys()
    for name, path in files.items():
        assert fields_of(path.read_text()) == fields_of(known[name])
    codec = RosCodec()
    assert all(kind in codec.store.fielddefs for kind in TYPES.values())


def test_the_package_of_messages_builds_all_of_them() -> None:
    manifest = ElementTree.parse(MESSAGES_PACKAGE / "package.xml").getroot()
    build = (MESSAGES_PACKAGE / "CMakeLists.txt").read_text()
    assert manifest.findtext("name") == MESSAGES_PACKAGE.name
    assert manifest.findtext("version") == RELEASE
    assert f"project({MESSAGES_PACKAGE.name})" in build
    folder = MESSAGES_PACKAGE
    there = {path.relative_to(folder).as_posix() for path in folder.glob("*/*.*")}
    assert set(re.findall(r'"(\w+/\w+\.\w+)"', build)) == there
    used = {name for kind in TYPES.values() for name in [kind.partition("/")[0]]}
    text = "".join(path.read_text() for path in folder.glob("*/*.msg"))
    needed = {name for name in (*used, "geometry_msgs") if f"{name}/" in text}
    assert {item.text for item in manifest.findall("depend")} == needed
    assert all(f"find_package({name} REQUIRED)" in build for name in needed)
    assert "rosidl_interface_packages" in {e.text for e in manifest.findall("member_of_group")}
