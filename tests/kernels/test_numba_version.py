"""The version of numba, told without importing it."""

import importlib.metadata
import subprocess
import sys
from pathlib import Path

import pytest

from pgm_places.kernels.numba_version import numba_version


def test_it_is_the_one_that_is_installed() -> None:
    code = (
        "import sys\n"
        "from pgm_places.kernels.numba_version import numba_version\n"
        "print(numba_version(), *{'numba', 'importlib.metadata'} & set(sys.modules))"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.split() == [importlib.metadata.version("numba")]


@pytest.mark.parametrize("content", [None, "", "version = get_versions()"])
def test_without_a_word_in_its_own_file_the_package_is_asked(
    content: str | None, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "numba").mkdir()
    (tmp_path / "numba" / "__init__.py").touch()
    if content is not None:
        (tmp_path / "numba" / "_version.py").write_text(content)
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.delitem(sys.modules, "numba", raising=False)
    monkeypatch.setattr("importlib.metadata.version", lambda name: f"{name} 9")
    numba_version.cache_clear()
    try:
        assert numba_version() == "numba 9"
    finally:
        numba_version.cache_clear()
