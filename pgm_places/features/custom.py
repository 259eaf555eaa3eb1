"""Custom features: columns in addition to the 321 of the laser, by name, with options.

A feature is a frozen dataclass. Its fields are its options, ``column_names`` names its columns,
and one of two methods computes them: ``of_scans`` from full-circle scans, simulated or real, or
``of_cells`` from the map itself. The columns of the laser come first, then the columns of custom
features in their order.
"""

from collections import Counter
from collections.abc import Mapping, Sequence
from typing import Any, Protocol, TypeAlias, runtime_checkable

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pgm_places._checks import finite_array
from pgm_places.errors import ConfigError, quoted
from pgm_places.features.extraction import extract
from pgm_places.features.laser import LASER_FEATURES, laser_feature_names
from pgm_places.maps.occupancy_grid import OccupancyGrid
from pgm_places.plugins import Registry

FEATURES = Registry("feature", "pgm_places.features")
"""The registry of features; packages add theirs as entry points of this group."""

N_LASER = len(LASER_FEATURES)


@runtime_checkable
class ScanFeature(Protocol):
    """A feature of scans, for trajectories and for maps, whose scans are simulated."""

    @property
    def column_names(self) -> Sequence[str]:
        """The names of its D columns."""
        ...

    def of_scans(self, ranges_m: NDArray[np.float32], max_range_m: float) -> ArrayLike:
        """(n, D) columns of scans (n, M): beam ``i`` in metres at the angle ``2 pi i / M``.

        Each row must depend only on its own scan, because scans are passed in blocks. The ranges
        are read-only and are overwritten after the call.
        """
        ...


@runtime_checkable
class MapFeature(Protocol):
    """A feature of a map's cells, for maps only; computed once per map."""

    @property
    def column_names(self) -> Sequence[str]:
        """The names of its D columns."""
        ...

    def of_cells(self, grid: OccupancyGrid, cells_rc: NDArray[np.int64]) -> ArrayLike:
        """(N, D) columns of cells (N, 2), given as row and column."""
        ...


Feature: TypeAlias = ScanFeature | MapFeature


def as_features(features: Sequence[str | Feature]) -> tuple[Feature, ...]:
    """The features, with names replaced by instances, after checking that they fit together.

    Raises
    ------
    ConfigError
        An item is not a feature, or two columns have the same name.
    """
    if isinstance(features, str):
        raise ConfigError(f"features must be a list, got the text {quoted(features)}; write [it]")
    built = tuple(
        FEATURES.build(feature) if isinstance(feature, str) else feature for feature in features
    )
    for feature in built:
        if isinstance(feature, ScanFeature) == isinstance(feature, MapFeature):
            raise ConfigError(
                "a feature must have column_names and either of_scans or of_cells, got "
                f"{quoted(feature)}"
            )
        if isinstance(feature.column_names, str) or not feature.column_names:
            raise ConfigError(
                f"column_names of {_kind(feature)} must be a list of names, got "
                f"{quoted(feature.column_names)}"
            )
    counts = Counter(column_names(built))
    if twice := sorted(name for name, count in counts.items() if count > 1):
        raise ConfigError(
            f"two feature columns are called {twice[0]!r}; each column needs its own name"
        )
    return built


def n_columns(own: Sequence[Feature]) -> int:
    """The number of columns: of the laser and of custom features."""
    return N_LASER + sum(len(feature.column_names) for feature in own)


def column_names(own: Sequence[Feature]) -> tuple[str, ...]:
    """The names of all columns, in order."""
    return (
        *laser_feature_names(),
        *(str(name) for feature in own for name in feature.column_names),
    )


def values_on_map(
    own: Sequence[Feature],
    grid: OccupancyGrid,
    cells_rc: NDArray[np.integer[Any]],
    columns: NDArray[np.int64] | None = None,
) -> dict[int, NDArray[np.float32]]:
    """(N, D) values of each map feature with a requested column, by its index in ``own``.

    InputError: A feature returned another shape, or a value that is not finite.
    """
    by_index = {}
    for place, (item, chosen) in enumerate(_wanted(own, columns)):
        if len(chosen) and isinstance(item, MapFeature):
            cells = np.asarray(cells_rc, np.int64)  # 16 bytes a cell: only if needed
            by_index[place] = _checked(item, "of_cells", item.of_cells(grid, cells), len(cells))
    return by_index


def feature_values(
    ranges_m: NDArray[np.float32],
    own: Sequence[Feature] = (),
    columns: NDArray[np.int64] | None = None,
    *,
    max_range_m: float,
    from_map: Mapping[int, NDArray[np.float32]] | None = None,
) -> NDArray[np.float32]:
    """(n, F) columns of n scans, or of the n cells that they were simulated in.

    ``ranges_m`` (n, M): scans all around. ``own``: from :func:`as_features`. ``columns`` (F,): the
    requested columns, ascending; all by default. Only these are computed. ``max_range_m``: the
    sensor's reach. ``from_map``: the result of :func:`values_on_map` for these n cells.

    InputError: A feature returned another shape, or a value that is not finite.
    """
    wanted = np.arange(n_columns(own)) if columns is None else columns
    laser = extract(ranges_m, max_range_m=max_range_m, columns=wanted[wanted < N_LASER])
    if laser.shape[1] == len(wanted):
        return laser
    scans = ranges_m.view()
    scans.setflags(write=False)
    parts = [laser]
    for place, (item, chosen) in enumerate(_wanted(own, wanted)):
        if not len(chosen):
            continue
        if from_map is not None and place in from_map:
            values = from_map[place]
        else:
            assert isinstance(item, ScanFeature)  # of_cells is computed once for each map
            values = _checked(item, "of_scans", item.of_scans(scans, max_range_m), len(scans))
        parts.append(values[:, chosen])
    return np.concatenate(parts, axis=1)


def _wanted(
    own: Sequence[Feature], columns: NDArray[np.int64] | None
) -> list[tuple[Feature, NDArray[np.int64]]]:
    """Each feature with the numbers of its requested columns."""
    pairs, first = [], N_LASER
    for feature in own:
        numbers = np.arange(len(feature.column_names))
        if columns is not None:
            numbers = numbers[np.isin(numbers + first, columns)]
        pairs.append((feature, numbers))
        first += len(feature.column_names)
    return pairs


def _checked(item: Feature, method: str, values: ArrayLike, n: int) -> NDArray[np.float32]:
    what = f"{_kind(item)}.{method}(...)"
    shape = (n, len(item.column_names))
    checked: NDArray[np.float32] = finite_array(what, values, shape, dtype=np.float32)
    return checked


def _kind(item: object) -> str:
    return type(item).__name__
