"""Draw pictures of the documentation: ``python -m experiments.pictures [NAME ...]``.

Everything is drawn from generated maps. ``cards`` are parts of the other pictures, so they come
last. Other pictures of the documentation were drawn once; docs/notes/studies.md says how.
"""

import argparse
from collections.abc import Callable

from experiments.pictures import chart, landing, layers, maps, report_page, training, ways

PICTURES: dict[str, Callable[[], None]] = {
    "hero": landing.hero,
    "readme": landing.readme,
    "which_method": chart.which_method,
    "guide": ways.ways,
    "how_it_works": ways.map_to_labels,
    "layers": layers.write_layers,
    "own_map": maps.own_map,
    "painted": maps.painted,
    "topology": maps.topology,
    "floor": maps.networks,
    "kinds_of_buildings": training.kinds_of_buildings,
    "simulated_maps": training.simulated_maps,
    "robot_effects": training.robot_effects,
    "comparison": report_page.comparison_page,
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
