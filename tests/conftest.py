"""Settings that hold for the whole suite."""

from hypothesis import settings

# A first call compiles, so no example can be timed; the same examples in every run.
settings.register_profile("pgm_places", deadline=None, derandomize=True)
settings.load_profile("pgm_places")
