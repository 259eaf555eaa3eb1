"""Settings that hold for the whole suite."""

import gc
import signal

import pytest
from hypothesis import settings

# A first call compiles, so no example can be timed; the same examples in every run.
settings.register_profile("pgm_places", deadline=None, derandomize=True)
settings.load_profile("pgm_places")

# As on the command line: compiling and importing make millions of objects that stay.
gc.set_threshold(100_000, 50, 50)

# A shell that starts the suite in the background has it ignore Ctrl-C, and so would every process
# that a test starts and interrupts.
if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
    signal.signal(signal.SIGINT, signal.default_int_handler)

LONGEST = (
    "test_docs.py",
    "test_decoding.py",
    "test_backend_contract.py",
    "test_teacher.py",
    "test_machine_code.py",
    "test_commands.py",
    "test_halls.py",
)
"""Files that one process begins with while others do the rest, and not one at the end."""


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Put the tests of the longest files first; all others keep their order."""
    items.sort(key=lambda item: item.path.name not in LONGEST)
