"""Draw the pictures of the documentation: ``python -m experiments.pictures [NAME ...]``.

Everything is drawn from generated maps, or from data that ships with the libraries. ``cards`` are
parts of the other pictures, so they come last.
"""

import argparse
from collections.abc import Callable

from experiments.pictures import (
    batch,
    chains,
    chart,
    energies,
    floors,
    frames,
    guides,
    hidden,
    kills,
    landing,
    layers,
    learning,
    maps,
    methods,
    mutants,
    report_page,
    training,
    ways,
)

PICTURES: dict[str, Callable[[], None]] = {
    "hero": landing.hero,
    "readme": landing.readme,
    "which_method": chart.which_method,
    "guide": ways.ways,
    "how_it_works": ways.map_to_labels,
    "layers": layers.write_layers,
    "independent": methods.independent,
    "potts": methods.potts,
    "relaxation": methods.relaxation,
    "amn": methods.amn,
    "inference": methods.decoders,
    "hmm": chains.hmm,
    "semi_markov": chains.semi_markov,
    "own_map": maps.own_map,
    "painted": maps.painted,
    "topology": maps.topology,
    "gates": maps.gates,
    "spaces": maps.spaces,
    "features": maps.features,
    "floor": floors.floor,
    "concepts": maps.concepts,
    "unknown_as_free": maps.unknown_as_free,
    "growing_map": maps.growing_map,
    "explain": maps.explain,
    "overview": learning.overview,
    "theory": energies.energies,
    "boosting": learning.boosting,
    "vision": learning.vision,
    "own_problem": learning.own_problem,
    "kinds_of_buildings": training.kinds_of_buildings,
    "simulated_maps": training.simulated_maps,
    "robot_effects": training.robot_effects,
    "conventions": frames.conventions,
    "configuration": guides.configuration,
    "extending": guides.extending,
    "faq": guides.faq,
    "reliability": kills.reliability,
    "mutation_testing": mutants.mutation_testing,
    "comparison": report_page.comparison_page,
    "hidden_rooms": hidden.hidden,
    "many_maps": batch.many_maps,
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
