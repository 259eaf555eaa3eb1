"""Semantic place labelling: occupancy grids and trajectories in, labelled places out.

``__init__.pyi`` lists the public names. They are imported on first use, so that
``import pgm_places`` is fast.
"""

import logging
from importlib.machinery import PathFinder

import lazy_loader

from pgm_places._version import __version__ as __version__

if PathFinder.find_spec(f"{__name__}._core", __path__) is None:  # as in a checkout
    raise ImportError(
        f"the kernels in {__path__[0]} are not compiled; run "
        "'pip install --editable .' in the checkout, or start Python in another folder"
    )

__getattr__, _, _names = lazy_loader.attach_stub(__name__, __file__)

__all__ = sorted([*_names, "__version__"])

logging.getLogger(__name__).addHandler(logging.NullHandler())


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
