"""Where the real maps and logs lie, for tests that use them and skip where they are absent."""

import os
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parent.parent
is_marked = True
"""Whether the running test has the marker ``real_data``; tests/conftest.py sets it."""


def real_data_folder(name: str) -> Path:
    """The folder of that name in the real data; skips the running test where it is absent."""
    assert is_marked, "mark it with pytest.mark.real_data: .ci/run chooses these tests by it"
    base = Path(os.environ.get("PGM_PLACES_DATA") or ROOT.parent / "shared" / "data")
    folder = base / name
    if not folder.is_dir():
        pytest.skip(f"real data absent: {name} (set PGM_PLACES_DATA to the folder that holds it)")
    return folder
