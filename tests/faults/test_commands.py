"""Commands that are killed while they replace what an earlier run wrote."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
KILLS = int(os.environ.get("PGM_PLACES_KILLS", "0"))
COMMANDS = (
    "topology",  # the quickest, which is always run
    *("label", "track", "train", "compare", "simulate-map", "export", "reproduce"),
)
SEED = int(os.environ.get("PGM_PLACES_SEED", "0"))


@pytest.mark.skipif(os.name != "posix", reason="needs fork and signals")
@pytest.mark.parametrize("name", COMMANDS)
def test_a_killed_command_leaves_the_files_of_one_run(tmp_path: Path, name: str) -> None:
    if name != COMMANDS[0] and not KILLS:
        pytest.skip("PGM_PLACES_KILLS, the kills of each command, is not set; 'make faults' does")
    n_kills = KILLS or 3
    command = [sys.executable, "-m", "tests.faults.killed_commands"]
    done = subprocess.run(
        [*command, str(tmp_path), str(n_kills), str(SEED), name],
        cwd=ROOT,
        env={**os.environ, "PGM_PLACES_NUM_THREADS": "1"},
        check=False,
        capture_output=True,
        text=True,
    )
    assert done.returncode == 0, done.stderr
    print(done.stdout)  # noqa: T201  pytest -s shows where each was killed
    assert done.stdout.count("killed") == n_kills
