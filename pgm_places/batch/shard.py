"""A share of the maps, for job arrays: the same share whatever other maps there are."""

import hashlib
import re
from dataclasses import dataclass
from typing import Self

from pgm_places.errors import InputError


@dataclass(frozen=True)
class Shard:
    """One of several parts into which names fall by chance, but always alike.

    Parameters
    ----------
    number, of : int
        The first is 1.
    """

    number: int
    of: int

    @classmethod
    def named(cls, text: str) -> Self:
        """The part that ``i/n`` names.

        Raises
        ------
        InputError
            It is not written like that, or there is no such part.

        Examples
        --------
        >>> Shard.named("3/16")
        Shard(number=3, of=16)
        """
        found = re.fullmatch(r"([0-9]{1,9})/([0-9]{1,9})", text.strip())
        if found is None or not 1 <= int(found[1]) <= int(found[2]):
            raise InputError(
                f"--shard expects i/n, such as 3/16, the first being 1/16 and the last 16/16; "
                f"got {text!r}"
            )
        return cls(int(found[1]), int(found[2]))

    def has(self, name: str) -> bool:
        """Whether a name is in this part."""
        digest = hashlib.sha256(name.encode("utf-8", "surrogateescape")).digest()
        return int.from_bytes(digest[:8], "big") % self.of == self.number - 1
