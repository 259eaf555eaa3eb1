"""Halls: lobbies, foyers and waiting areas, as a label apart from corridors."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Self

import numpy as np
from numpy.typing import NDArray

from pgm_places.inference.labeling import Labeling
from pgm_places.maps.labelled_map import LabelledMap
from pgm_places.unary.options import HallsAs

HALL, CORRIDOR, ROOM = "hall", "corridor", "room"


@dataclass(frozen=True)
class HallNames:
    """The labels of a training set with halls, and the labels with halls folded into corridors.

    A list distinguishes circulation from rooms, and a further one halls from corridors: labels
    without halls are as accurate as if trained without.
    """

    names: tuple[str, ...]  # all labels, the hall among them

    @classmethod
    def among(cls, names: Sequence[str]) -> Self | None:
        """Those of a set of labels with a hall, a corridor and a room; None for any other set."""
        return cls(tuple(names)) if {HALL, CORRIDOR, ROOM} <= set(names) else None

    @property
    def folded(self) -> tuple[str, ...]:
        """The labels without hall."""
        return tuple(name for name in self.names if name != HALL)

    def shown(self, halls: HallsAs) -> tuple[str, ...]:
        """The labels of a result: the folded ones, followed by hall if it is shown."""
        return (*self.folded, HALL) if halls == "hall" else self.folded

    def fold(self, item: LabelledMap, halls: HallsAs = "corridor") -> LabelledMap:
        """The map with relabelled halls, and the labels numbered as in ``shown``."""
        names = [halls if name == HALL else name for name in self.names]
        number = [self.shown(halls).index(name) for name in names]
        # The entry after the last is looked up by -1, "no label".
        return replace(item, labels=np.array([*number, -1], np.int16)[item.labels])

    def are_halls(self, item: LabelledMap) -> NDArray[np.bool_]:
        """(N,) mask of a map's labelled cells that are halls."""
        mask = item.labelled_cells
        return np.asarray(item.labels[mask] == self.names.index(HALL))

    def split(self, labeling: Labeling, share: NDArray[np.float32], halls: HallsAs) -> Labeling:
        """A labelling with halls labelled as chosen, from one by the folded labels.

        ``share`` (N,): the probability that each node lies in a hall if it is circulation.
        """
        if halls == "corridor":
            return labeling
        corridor, to = self.folded.index(CORRIDOR), self.shown(halls).index(halls)
        labels, beliefs = labeling.labels.copy(), labeling.beliefs
        labels[(labels == corridor) & (share > 0.5)] = to
        if beliefs is not None:
            folded, beliefs = (
                beliefs,
                np.zeros((len(labels), len(self.shown(halls))), beliefs.dtype),
            )
            beliefs[:, : folded.shape[1]] = folded
            moved = folded[:, corridor] * share
            beliefs[:, corridor] -= moved
            beliefs[:, to] += moved
        return replace(labeling, labels=labels, beliefs=beliefs)
