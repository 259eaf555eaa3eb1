"""Semantic place labelling: occupancy grids and trajectories in, labelled places out.

``__init__.pyi`` lists the public names. They are imported on first use, so that
``import pgm_places`` is fast.
"""

import logging

import lazy_loader

from pgm_places._version import __version__ as __version__

__getattr__, _, _names = lazy_loader.attach_stub(__name__, __file__)

__all__ = sorted([*_names, "__version__"])

logging.getLogger(__name__).addHandler(logging.NullHandler())


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
