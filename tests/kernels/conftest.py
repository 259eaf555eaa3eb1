from collections.abc import Iterator

import pytest

from pgm_places import _core


@pytest.fixture
def any_registers() -> Iterator[None]:
    """What a test takes away from the processor's registers is given back."""
    yield
    _core.limit_registers(64)
