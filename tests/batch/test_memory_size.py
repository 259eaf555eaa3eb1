"""Sizes of memory are read as people write them; what is none is refused in one line."""

import pytest

from pgm_places.batch.limits import memory_bytes
from pgm_places.errors import InputError


@pytest.mark.parametrize(
    ("text", "n_bytes"),
    [
        ("2GB", 2_000_000_000),
        (" 2 gib ", 2 << 30),
        ("0.5T", 500_000_000_000),
        ("512M", 512_000_000),
        ("1000000000", 1_000_000_000),
    ],
)
def test_sizes(text: str, n_bytes: int) -> None:
    assert memory_bytes(text) == n_bytes


@pytest.mark.parametrize("text", ["", "GB", "-1GB", "4 XB", "4iB", "nan", "1e9", "٤GB", "4MB"])
def test_what_is_no_size(text: str) -> None:
    least = "a worker needs at least 256MB"  # else a slip of the unit
    message = least if text == "4MB" else "--memory expects a size such as 4GB or 500MiB"
    with pytest.raises(InputError, match=message):
        memory_bytes(text)
