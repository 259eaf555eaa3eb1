"""The source layout: links, one list of packages, nothing heavy on import."""

import ast
import subprocess
import sys
from pathlib import Path

import pytest

import pgm_places

ROOT = Path(__file__).resolve().parent.parent


@pytest.mark.parametrize("name", ["models", "solvers", "simulation", "training", "studio", "live"])
def test_links_lead_to_the_real_folders(name: str) -> None:
    link = ROOT / "pgm_places" / name
    if not link.is_symlink():
        pytest.skip("this checkout has no symbolic links; builds work through the mapping")
    assert link.resolve() == ROOT / name


def test_every_package_has_a_layer_and_no_imports_go_round_or_up() -> None:
    # In a process of its own: it reconfigures logging.
    code = (
        "import sys; from importlinter.cli import lint_imports;"
        f"sys.exit(lint_imports(config_filename={str(ROOT / 'pyproject.toml')!r}, no_cache=True))"
    )
    found = subprocess.run([sys.executable, "-c", code], check=False, capture_output=True, cwd=ROOT)
    assert found.returncode == 0, found.stdout.decode()


def test_public_names_are_sorted_and_exist() -> None:
    assert sorted(pgm_places.__all__) == pgm_places.__all__
    for name in pgm_places.__all__:
        assert hasattr(pgm_places, name)


def test_a_checkout_without_compiled_kernels_says_how_to_compile_them(tmp_path: Path) -> None:
    (tmp_path / "pgm_places").mkdir()
    for path in (ROOT / "pgm_places").iterdir():
        if not path.name.startswith("_core."):
            (tmp_path / "pgm_places" / path.name).symlink_to(path.resolve())
    code = "from pgm_places import LabelGraph"
    done = subprocess.run(
        [sys.executable, "-c", code], check=False, capture_output=True, text=True, cwd=tmp_path
    )
    told = done.stderr.splitlines()[-1]
    assert told.startswith(
        f"ImportError: the kernels in {tmp_path / 'pgm_places'} are not compiled"
    )
    assert "pip install --editable ." in told


def test_help_needs_nothing_heavy() -> None:
    heavy = "cvxpy, sklearn, matplotlib, jinja2, numpy, rich"
    code = (
        "import sys\n"
        "from pgm_places.cli.app import run\n"
        "run(['--help'])\n"
        f"sys.exit(any(name in sys.modules for name in '{heavy}'.split(', ')))"
    )
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0


SILENT = {"KeyboardInterrupt", "SystemExit", "ZeroDivisionError"}
"""Exceptions that say nothing, or nothing of ours."""


def test_every_expected_error_has_its_message_looked_at() -> None:
    careless = []
    for path in sorted((ROOT / "tests").rglob("*.py")):
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            for item in node.items if isinstance(node, ast.With) else ():
                call = item.context_expr
                if not (isinstance(call, ast.Call) and ast.unparse(call.func) == "pytest.raises"):
                    continue
                is_matched = any(keyword.arg == "match" for keyword in call.keywords)
                if not (is_matched or item.optional_vars or ast.unparse(call.args[0]) in SILENT):
                    careless.append(f"{path.relative_to(ROOT)}:{call.lineno}")
    assert not careless
