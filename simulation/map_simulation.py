"""Options of robot-like maps: the ranges from which each map draws its values."""

from dataclasses import dataclass
from typing import Annotated

from pgm_places._arguments import public_options
from pgm_places.options import OptionError, Probability, check_options, option_values
from pgm_places.options.marks import Ge, Le

Share = Annotated[float, Ge(0), Le(1)]
Amount = Annotated[float, Ge(0), Le(10)]
Degrees = Annotated[float, Ge(-45), Le(45)]
Metres = Annotated[float, Ge(0), Le(1)]
Reach = Annotated[float, Ge(1), Le(100)]
Slope = Annotated[float, Ge(0), Le(0.1)]
Factor = Annotated[float, Ge(0.5), Le(2)]
Count = Annotated[int, Ge(1), Le(20)]


@public_options
@dataclass(frozen=True)
class MapSimulation:
    """How the robot-like maps of a plan may differ: for each map, a value is drawn from each range.

    Parameters
    ----------
    furniture : (float, float)
        Amount of furniture in rooms (1 = a typical office).
    corridor_furniture : (float, float)
        Amount of furniture in corridors and halls (1 = a cupboard every 9 m).
    empty_rooms : (float, float)
        Share of the rooms without furniture.
    routes : (int, int)
        Number of routes that the robot drives, each with its own pose errors.
    coverage : (float, float)
        Share of the places visited; those farthest from the start are left out.
    entered_rooms : (float, float)
        Share of the rooms entered; others are seen through their doors.
    reach_m : (float, float)
        Maximum range of the laser (m).
    range_noise_m : (float, float)
        Standard deviation of the range noise (m).
    pose_noise_m : (float, float)
        Maximum pose error (m).
    glass : (float, float)
        Share of the rooms with glass panes in their walls, which some rays pass through.
    bend : (float, float)
        Steepest drift (metres sideways per metre ahead).
    turn_degrees : (float, float)
        Rotation of the map (degrees, -45 to 45).
    oblique : float
        Share of the maps that are rotated by an arbitrary angle instead.
    specks : (float, float)
        Share of the free cells with a speck that is unknown or occupied.
    scale : (float, float)
        Scale factor of the building's size.
    cell : (float, float)
        Scale factor of the cell size.
    windows : (float, float)
        Share of the rooms, corridors and halls with windows or glass doors in their outer walls,
        through which rays leave the building.
    glass_fronts : (float, float)
        Share of the rooms whose walls to corridors and halls are of glass, seen in pieces.
    closed_doors : (float, float)
        Share of the doors that are closed.
    large_furniture : (float, float)
        Amount of furniture that looks like walls: wardrobes, beds, counters, benches (1 = usual).
    slip_m : (float, float)
        Displacement of a part of the drive, which doubles walls (m).
    least_seen : float
        Share of a room that must be seen for the room to be labelled.
    passages : tuple of str
        Labels of corridors and halls.
    doorways : tuple of str
        Labels of doorways; all labels other than these and the passages are kinds of rooms.

    Raises
    ------
    ConfigError
        A value out of range, or a range that ends before it begins.

    Examples
    --------
    >>> MapSimulation(scale=(1.0, 1.0)).scale
    (1.0, 1.0)
    """

    furniture: tuple[Amount, Amount] = (0.3, 1.3)
    corridor_furniture: tuple[Amount, Amount] = (0.0, 2.5)
    empty_rooms: tuple[Share, Share] = (0.1, 0.5)
    routes: tuple[Count, Count] = (1, 4)
    coverage: tuple[Share, Share] = (0.85, 1.0)
    entered_rooms: tuple[Share, Share] = (0.8, 1.0)
    reach_m: tuple[Reach, Reach] = (6.0, 16.0)
    range_noise_m: tuple[Metres, Metres] = (0.0, 0.04)
    pose_noise_m: tuple[Metres, Metres] = (0.0, 0.1)
    glass: tuple[Share, Share] = (0.0, 0.4)
    bend: tuple[Slope, Slope] = (0.0, 0.03)
    turn_degrees: tuple[Degrees, Degrees] = (-3.0, 3.0)
    oblique: Probability = 0.25
    specks: tuple[Share, Share] = (0.0, 0.001)
    scale: tuple[Factor, Factor] = (0.85, 1.18)
    cell: tuple[Factor, Factor] = (0.8, 1.25)
    windows: tuple[Share, Share] = (0.0, 0.0)
    glass_fronts: tuple[Share, Share] = (0.0, 0.0)
    closed_doors: tuple[Share, Share] = (0.0, 0.0)
    large_furniture: tuple[Amount, Amount] = (0.0, 0.0)
    slip_m: tuple[Metres, Metres] = (0.0, 0.0)
    least_seen: Probability = 0.0
    passages: tuple[str, ...] = ("corridor", "hall")
    doorways: tuple[str, ...] = ("doorway",)

    def __post_init__(self) -> None:
        check_options(self)
        for name, value in option_values(self).items():
            if isinstance(value, tuple) and not isinstance(value[0], str) and value[0] > value[1]:
                raise OptionError(name, f"must not end before it begins, got {list(value)}")
