"""The former name of :mod:`pgm_places.simulation`, for one release."""

import warnings

from pgm_places.simulation import *  # noqa: F403

warnings.warn("pgm_places.datasets is pgm_places.simulation now", DeprecationWarning, stacklevel=2)
