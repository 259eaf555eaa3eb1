"""Configuration of a map of an experiment: files or a seed, and a window."""

from dataclasses import dataclass
from typing import Annotated, Any, Literal

from pgm_places._option_marks import Ge
from pgm_places.errors import ConfigError
from pgm_places.options import UnknownGrey, check_options
from pgm_places.simulation.map_simulation import MapSimulation
from pgm_places.simulation.style import StyleName
from pgm_places.unary.options import HallsAs

# TOML has no null: the strings ``""`` and ``"end"`` stand for an open end of a window.
OpenEnd = Literal["", "end"] | None

Range = tuple[float | OpenEnd, float | OpenEnd]
IndexRange = tuple[int | OpenEnd, int | OpenEnd]


@dataclass(frozen=True, kw_only=True)
class MapConfig:
    """A map, its labels, and the part of it to use.

    ``map`` is a map_server YAML file, or ``generated`` the seed of a generated building with its
    labels (corridor, room, doorway; see ``pgm_places.simulation``). ``labels`` is a label image on
    the map image's raster, or ``regions`` a GeoJSON file of polygons in map metres with a property
    ``class``. ``classes`` translates the names of either; other names have no label.
    ``corrections``, a label image or GeoJSON of polygons and lines with the configuration's labels,
    overrides these labels; it may also be the only source of labels.
    ``columns`` and ``rows`` are half-open ranges of image columns and rows counted from the left
    and the top; ``x_m`` and ``y_m`` are ranges in map metres; ``half`` is the part of a generated
    building left or right of the border between its wings; ``style``, ``halls``, ``furniture`` and
    ``slam_noise`` are options of :func:`pgm_places.simulation.generate_building`.
    ``simulated`` is a seed: the map is replaced by a simulated robot map with the options
    ``simulation`` (:func:`pgm_places.simulation.simulate_map`). Maps of one ``building`` are held
    out together; by default, so are parts of the same map and maps simulated from it. ``domain``
    names the origin of maps, such as "drawn" or "simulated": with several domains, the list with
    space features is the mean of lists that are each trained without one of them.
    """

    map: str | None = None
    generated: Annotated[int, Ge(0)] | None = None
    labels: str | None = None
    regions: str | None = None
    classes: dict[str, str] | None = None
    corrections: str | None = None
    name: str | None = None
    building: str | None = None
    domain: str | None = None
    half: Literal["left", "right"] | None = None
    style: StyleName | None = None
    halls: HallsAs | None = None
    furniture: bool | None = None
    slam_noise: bool | None = None
    simulated: Annotated[int, Ge(0)] | None = None
    simulation: MapSimulation | None = None
    columns: IndexRange | None = None
    rows: IndexRange | None = None
    x_m: Range | None = None
    y_m: Range | None = None
    unknown_value: UnknownGrey | None = None
    compat: Literal["nav2", "ros1"] = "nav2"

    def __post_init__(self) -> None:
        check_options(self)
        self._check_map()

    def _check_map(self) -> None:
        if (self.map is None) == (self.generated is None):
            raise ConfigError("either map (a YAML file) or generated (a seed) is required")
        if self.generated is not None:
            if not (self.labels is self.regions is self.corrections is None):
                raise ConfigError(
                    "a generated building has its own labels; remove labels, regions and "
                    "corrections"
                )
        elif self.half is not None:
            raise ConfigError("half is for generated buildings; use columns or x_m for a map")
        elif self.drawn:
            raise ConfigError(f"{', '.join(self.drawn)}: for generated buildings only")
        elif None not in (self.labels, self.regions) or (
            self.labels is self.regions is self.corrections is None
        ):
            raise ConfigError(
                "either labels (an image), regions (a GeoJSON file) or corrections is required"
            )
        if self.classes is not None and self.generated is not None:
            raise ConfigError("classes requires labels or regions, whose names it translates")
        if self.simulation is not None and self.simulated is None:
            raise ConfigError("simulation requires simulated (a seed)")

    @property
    def window(self) -> dict[str, tuple[Any, Any]]:
        """The limits of the window by axis; None for an open end."""
        limits = {name: getattr(self, name) for name in ("columns", "rows", "x_m", "y_m")}
        return {
            name: (_end(ends[0]), _end(ends[1]))
            for name, ends in limits.items()
            if ends is not None
        }

    @property
    def drawn(self) -> dict[str, Any]:
        """The options of a generated building that are not at their defaults."""
        named = {
            name: getattr(self, name) for name in ("style", "halls", "furniture", "slam_noise")
        }
        return {key: value for key, value in named.items() if value is not None}


def _end(value: float | OpenEnd) -> float | None:
    return None if isinstance(value, str) else value
