"""Checks of iteration limits; iterating to convergence."""

from collections.abc import Callable

from pgm_places._checks import require_at_least
from pgm_places.errors import InputError


def check_iteration_limits(
    max_iterations: int, tolerance: float = 0.0, damping: float = 0.0, *, fewest: int = 1
) -> None:
    """Raise InputError unless limit and tolerance of an iteration are valid."""
    require_at_least("max_iterations", max_iterations, fewest)
    require_at_least("tolerance", tolerance, 0)
    if not 0 <= damping < 1:
        raise InputError(f"damping must be at least 0 and less than 1, got {damping}")


def until_converged(
    update: Callable[[int], float],
    threshold: float,
    max_iterations: int,
    on_iteration: Callable[[int, float], None] | None,
) -> list[float]:
    """Largest change of each pass, until it is at most ``threshold``; passes count from 0."""
    history: list[float] = []
    while len(history) < max_iterations:
        history.append(update(len(history)))
        if on_iteration is not None:
            on_iteration(len(history), history[-1])
        if history[-1] <= threshold:
            break
    return history
