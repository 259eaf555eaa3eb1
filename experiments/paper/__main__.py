"""The paper's experiments from a checkout: python -m experiments.paper 7.1 7.5."""

import sys

from pgm_places.cli.entry import main

if __name__ == "__main__":
    sys.argv[1:1] = ["reproduce"]
    main()
