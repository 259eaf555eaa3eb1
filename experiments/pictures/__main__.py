"""Draw pictures of the documentation: ``python -m experiments.pictures [NAME ...]``.

``cards`` are parts of the other pictures, so they come last. docs/notes/studies.md names the
programs of the other pictures.
"""

import argparse
from collections.abc import Callable

from experiments.pictures import landing, layers

PICTURES: dict[str, Callable[[], None]] = {
    "hero": landing.hero,
    "readme": landing.readme,
    "layers": layers.write_layers,
    "cards": landing.cards,
}


def main() -> None:
    """Draw the named pictures, or all of them."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("names", nargs="*", choices=[[], *PICTURES], help="which; all by default")
    for name in parser.parse_args().names or PICTURES:
        PICTURES[name]()


if __name__ == "__main__":
    main()
