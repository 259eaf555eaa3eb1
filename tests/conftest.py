"""Settings that hold for the whole suite."""

import gc
import signal

from hypothesis import settings

# A first call compiles, so no example can be timed; the same examples in every run.
settings.register_profile("pgm_places", deadline=None, derandomize=True)
settings.load_profile("pgm_places")

# As on the command line: compiling and importing make millions of objects that stay.
gc.set_threshold(100_000, 50, 50)

# A shell that starts the suite in the background has it ignore Ctrl-C, and so would every process
# that a test starts and interrupts.
if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
    signal.signal(signal.SIGINT, signal.default_int_handler)
