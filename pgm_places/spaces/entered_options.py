"""Options of unreachable free space, in a module that commands import quickly."""

from dataclasses import dataclass

from pgm_places.options import AtLeastZero, Options


@dataclass(frozen=True)
class EnteredOptions(Options):
    """Detection and labelling of unreachable free space.

    Parameters
    ----------
    disc_radius_m : float
        The robot's radius (m): free space that a disc of this radius cannot reach from the largest
        part is unreachable; 0 makes all free space reachable.
    unentered : bool
        Label unreachable free space as well.
    """

    disc_radius_m: AtLeastZero = 0.2
    unentered: bool = False
