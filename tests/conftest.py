"""Settings that hold for the whole suite."""

import gc
import os
import random
import signal
from collections import defaultdict

import pytest
from hypothesis import settings

from tests import real_data

# BLAS of each process would keep a thread for each core waiting in loops, so that the processes of
# the suite take each other's time: products of small matrices cost up to eight times as much. It
# reads this when NumPy is imported, which nothing above does. Our own kernels keep their threads.
for name in ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS"):
    os.environ.setdefault(name, "1")

# Machines are shared, so no example can be timed; the same examples in every run.
settings.register_profile("pgm_places", deadline=None, derandomize=True)
settings.load_profile("pgm_places")

# As on the command line: importing makes objects that stay.
gc.set_threshold(100_000, 50, 50)

# A shell that starts the suite in the background has it ignore Ctrl-C, and so would every process
# that a test starts and interrupts.
if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
    signal.signal(signal.SIGINT, signal.default_int_handler)

LONGEST = (
    "test_docs.py",
    "test_decoding.py",
    "test_backend_contract.py",
    "test_interactive_labeler.py",
    "test_commands.py",
    "test_halls.py",
)
"""Files that one process begins with while others do the rest, and not one at the end."""


def pytest_runtest_setup(item: pytest.Item) -> None:
    real_data.is_marked = item.get_closest_marker("real_data") is not None


def pytest_addoption(parser: pytest.Parser) -> None:
    parser.addoption("--shuffle", metavar="SEED", help="files, and tests in each, in random order")


def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """Put the tests of the longest files first; all others keep their order or are shuffled."""
    seed = config.getoption("--shuffle")
    if seed is not None:
        items[:] = shuffled(items, seed)
    items.sort(key=lambda item: item.path.name not in LONGEST)


def shuffled(items: list[pytest.Item], seed: str) -> list[pytest.Item]:
    """Tests of one file stay together, for what they share."""
    files = defaultdict(list)
    for item in items:
        files[item.path].append(item)
    rng = random.Random(seed)
    groups = list(files.values())
    rng.shuffle(groups)
    return [item for group in groups for item in rng.sample(group, len(group))]
