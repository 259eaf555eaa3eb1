"""``python -m pgm_places`` is the same as ``pgm-places``."""

import sys

if __name__ == "__main__":
    if not sys.flags.safe_path:
        del sys.path[0]  # the current folder: no file in it may stand in for a library
    from pgm_places.cli.entry import main

    main()
