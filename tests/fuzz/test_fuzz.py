"""Some spoiled files for every reader, read and used; ``make fuzz`` tries more of them."""

from pathlib import Path

import pytest

from tests.fuzz.loop import run
from tests.fuzz.readers import READERS
from tests.fuzz.seeds import seeds

COUNT = 12


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    made = tmp_path_factory.mktemp("seeds")
    seeds(made)
    return made


@pytest.mark.parametrize("name", list(READERS))
def test_what_is_spoiled_is_refused_in_one_line(name: str, folder: Path) -> None:
    found = run(READERS[name], folder, seed=1, count=COUNT)
    assert not [problem for problem, _ in found.bad]
    assert found.n_read + found.n_refused == COUNT
