"""``python -m pgm_places`` is the same as ``pgm-places``."""

from pgm_places.cli.main import main

if __name__ == "__main__":
    main()
