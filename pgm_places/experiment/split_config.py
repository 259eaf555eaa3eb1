"""A split as a configuration lists it: the buildings to test on, and those to learn from."""

from dataclasses import dataclass
from typing import Annotated

from pgm_places._option_marks import MinLen
from pgm_places.errors import ConfigError
from pgm_places.options import check_options


@dataclass(frozen=True, kw_only=True)
class SplitConfig:
    """Buildings of ``[[train]]`` to test on, and those to learn from.

    Parameters
    ----------
    test : list of str
        Buildings that are tested on.
    train : list of str, optional
        Buildings that are learned from; by default all others.
    name : str, optional
        Its name in tables; by default the buildings that are tested on.
    """

    test: Annotated[tuple[str, ...], MinLen(1)]
    train: Annotated[tuple[str, ...], MinLen(1)] | None = None
    name: str | None = None

    def __post_init__(self) -> None:
        check_options(self)
        both = [name for name in self.test if name in (self.train or ())]
        if both:
            raise ConfigError(
                f"splits: {both[0]!r} is in both train and test of a split; learn from other "
                "buildings than those that are tested on"
            )
