"""The model that learned from generated buildings alone, on every real map.

``PGM_PLACES_DATA=DATA python -m experiments.generated_model`` prints a Markdown table by kind of
building and kind of map. No map of the data was trained on, so nothing has to be left out.
"""

import os
from collections import defaultdict
from pathlib import Path

import numpy as np

from experiments.buildings.maps import NAMES, real_maps
from pgm_places import evaluate, trained_labeler


def main() -> None:
    """Label every map and print the means of each kind."""
    labeler = trained_labeler("generated")
    figures = defaultdict(list)
    for known in real_maps(Path(os.environ["PGM_PLACES_DATA"])):
        graph = known.item.graph()
        found = evaluate(known.item.truth(graph), labeler.label(known.item.grid).labels, NAMES)
        row = (found.accuracy, found.balanced_accuracy, found.f1["doorway"] or 0.0)
        figures[known.group].append(row)
    print("| kind | maps | accuracy | balanced | doorway F1 | worst accuracy |")
    print("|---|---|---|---|---|---|")
    for kind, rows in sorted(figures.items()):
        mean, worst = 100 * np.mean(rows, axis=0), 100 * min(row[0] for row in rows)
        cells = " | ".join(f"{value:.1f}" for value in (*mean, worst))
        print(f"| {kind} | {len(rows)} | {cells} |")


if __name__ == "__main__":
    main()
