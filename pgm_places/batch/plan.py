"""What a batch would do, without doing it."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

from pgm_places.batch.batch_folder import names_in_the_way
from pgm_places.batch.found_maps import FoundMap, FoundMaps
from pgm_places.batch.label_options import LabelOptions
from pgm_places.batch.lists import Lists
from pgm_places.batch.manifest import done_figures
from pgm_places.batch.ready_model import ready_model

__all__ = ["Plan", "plan"]


@dataclass(frozen=True)
class Plan:
    """Names of maps, by what would become of them.

    Parameters
    ----------
    to_label, again, done, refused : tuple of str
        Maps to label, those of them that failed last, maps that are done, and maps whose names are
        in the way of others.
    """

    to_label: tuple[str, ...]
    again: tuple[str, ...]
    done: tuple[str, ...]
    refused: tuple[str, ...]

    def summary(self) -> str:
        """One line."""
        n_all = len(self.to_label) + len(self.done) + len(self.refused)
        parts = [f"{len(self.to_label):,} to label"]
        parts += [f"{len(self.done):,} done before"] if self.done else []
        parts += [f"{len(self.refused):,} refused"] if self.refused else []
        return f"{n_all:,} map{'' if n_all == 1 else 's'}: {', '.join(parts)}; nothing was written"

    def lists(self) -> Iterator[tuple[str, Sequence[str]]]:
        """What is worth naming, with a title each."""
        titled = {
            "to label": self.to_label,
            "of these, failed last time": self.again,
            "refused for their names": self.refused,
        }
        yield from ((title, names) for title, names in titled.items() if names)


def plan(maps: Sequence[FoundMap], found: FoundMaps, out: Path, options: LabelOptions) -> Plan:
    """What would become of some of the maps found.

    Raises
    ------
    InputError
        The model is refused.
    """
    model = ready_model(options)
    in_the_way = {failure.name for failure in names_in_the_way(found.maps)}
    failed = Lists(out).failed()
    done, refused, to_label = [], [], []
    for item in maps:
        if item.name in in_the_way:
            refused.append(item.name)
        elif done_figures(out / item.name, item.path, model, options) is not None:
            done.append(item.name)
        else:
            to_label.append(item.name)
    again = tuple(name for name in to_label if name in failed)
    return Plan(tuple(to_label), again, tuple(done), tuple(refused))
