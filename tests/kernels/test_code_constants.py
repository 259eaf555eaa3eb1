"""Python objects in machine code: plain data there and back, and nothing else."""

import hashlib
import json
from typing import Any

import numpy as np
import pytest
from numba.core.serialize import dumps, loads

from pgm_places.errors import InputError
from pgm_places.kernels.code_constants import as_object, as_plain, pickles_in

OBJECTS = [
    np.ndarray,
    (ValueError, ("negative", 2, 0.5, True, None), ("kernel", "kernels.py", 12)),
    (MemoryError, (), None),
    (StopIteration, None, ("kernel", "kernels.py", 3)),
]


@pytest.mark.parametrize("item", OBJECTS)
def test_plain_data_says_all_of_an_object(item: Any) -> None:
    assert as_object(json.loads(json.dumps(as_plain(item)))) == item


@pytest.mark.parametrize(
    "item",
    [
        np.zeros,
        5,
        (SystemExit, (), None),
        (InputError, (), None),
        (type("ValueError", (Exception,), {}), (), None),
        (ValueError, (np.float64,), None),
        (ValueError, (("nested",),), None),
        (ValueError, ()),
    ],
)
def test_nothing_else_is_plain(item: Any) -> None:
    with pytest.raises(ValueError, match=r"is not a built-in exception|is not plain"):
        as_plain(item)


def test_pickles_are_known_by_their_hash() -> None:
    first, second, alone = (dumps(item) for item in ((ValueError, (), None), np.ndarray, "alone"))
    hashes = {text: hashlib.sha1(text, usedforsecurity=False).digest() for text in (first, second)}
    content = b"code" + first + b"more" + second + alone + b"".join(hashes.values())
    assert dict(pickles_in(content)) == {digest: text for text, digest in hashes.items()}
    assert [loads(text) for _, text in pickles_in(content)] == [(ValueError, (), None), np.ndarray]
