"""Domain numbers of the tests over DDS: no two tests share one, in one process or in two."""

import os

_PURPOSES = ("drive", "lonely", "kills", "interface", "tags")


def dds_domain(purpose: str) -> int:
    """The domain of a test in this process, 100 to 219; processes count from 0 to 23."""
    return 100 + len(_PURPOSES) * (os.getpid() % 24) + _PURPOSES.index(purpose)
