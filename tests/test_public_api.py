"""The public API changes on purpose only."""

import ast
import inspect
import subprocess
import sys
from pathlib import Path

import pgm_places
from tests.public_api import RECORD, public_api


def test_public_names_and_signatures_are_those_on_record() -> None:
    """If this is meant, run ``python -m tests.public_api`` and tell users in the changelog."""
    assert public_api() == RECORD.read_text(encoding="utf-8")


def test_type_checkers_and_the_package_see_the_same_names() -> None:
    stub = Path(pgm_places.__file__).with_suffix(".pyi").read_text(encoding="utf-8")
    aliases = [
        alias
        for node in ast.walk(ast.parse(stub))
        if isinstance(node, ast.ImportFrom)
        for alias in node.names
    ]
    assert all(alias.asname == alias.name for alias in aliases)  # else no re-export
    assert {*(alias.name for alias in aliases), "__version__"} == set(pgm_places.__all__)
    assert set(pgm_places.__all__) <= set(dir(pgm_places))


def test_public_things_are_documented() -> None:
    for name in set(pgm_places.__all__) - {"__version__"}:
        assert inspect.getdoc(getattr(pgm_places, name)), name


def test_importing_the_package_imports_nothing_heavy() -> None:
    heavy = "numpy, scipy, sklearn, cvxpy, matplotlib, networkx, jinja2, rich"
    code = f"import sys, pgm_places; print([n for n in '{heavy}'.split(', ') if n in sys.modules])"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"


def test_importing_the_package_takes_little_beside_numpy() -> None:
    code = (
        "import numpy, time; start = time.process_time(); import pgm_places; "
        "print(time.process_time() - start)"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert float(done.stdout) < 0.15
