"""What a batch would do, without doing it."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

from pgm_places.batch.batch_folder import names_in_the_way
from pgm_places.batch.far_maps import is_done, lists_to_read
from pgm_places.batch.found_maps import FoundMaps
from pgm_places.batch.label_batch import maps_to_do
from pgm_places.batch.label_options import LabelOptions
from pgm_places.batch.lists import LISTS, Lists
from pgm_places.batch.map_task import MapTask
from pgm_places.batch.ready_model import ready_model
from pgm_places.batch.shard import Shard


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


def plan(
    found: FoundMaps,
    out: Path,
    options: LabelOptions,
    *,
    shard: Shard | None = None,
    only_failed: bool = False,
) -> Plan:
    """What would become of the maps found, or of some of them, wherever they and the results are.

    Raises
    ------
    InputError
        The model is refused.
    """
    sha256 = ready_model(options).sha256
    with lists_to_read(out, LISTS) as lists:
        failed = Lists(lists).failed()
        maps = maps_to_do(found, lists, shard=shard, only_failed=only_failed)
    in_the_way = {failure.name for failure in names_in_the_way(found.maps)}
    done, refused, to_label = [], [], []
    for item in maps:
        if item.name in in_the_way:
            refused.append(item.name)
        elif is_done(MapTask(item.name, item.path, out / item.name, options, sha256)):
            done.append(item.name)
        else:
            to_label.append(item.name)
    again = tuple(name for name in to_label if name in failed)
    return Plan(tuple(to_label), again, tuple(done), tuple(refused))
