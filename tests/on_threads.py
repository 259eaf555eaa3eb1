"""Work on some number of threads."""

from collections.abc import Callable
from typing import Any

from pgm_places.kernels.threads import thread_limit


def on(n_threads: int, work: Callable[..., Any], *arguments: Any, **options: Any) -> Any:
    """What ``work`` returns on so many threads."""
    with thread_limit(n_threads):
        return work(*arguments, **options)
