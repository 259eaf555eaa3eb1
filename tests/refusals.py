"""That a call is refused, in one line."""

from collections.abc import Callable

import pytest


def refused(
    error: type[Exception] | tuple[type[Exception], ...],
    message: str,
    call: Callable[..., object],
    /,
    *arguments: object,
    **options: object,
) -> None:
    """The call raises the error, with a message in which the pattern is found."""
    with pytest.raises(error, match=message):
        call(*arguments, **options)
