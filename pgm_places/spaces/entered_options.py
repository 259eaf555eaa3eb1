"""Options of unreachable free space, in a module that commands import quickly."""

from dataclasses import dataclass

from pgm_places.options import AtLeastZero, Options


@dataclass(frozen=True)
class EnteredOptions(Options):
    """Detection and labelling of unreachable free space.

    Parameters
    ----------
    disc_radius_m : float
        Free space that a disc of this radius cannot reach from the largest part was never entered
        (m); 0 takes all free space as entered.
    unentered : bool
        Label free space that was never entered as well.
    """

    disc_radius_m: AtLeastZero = 0.2
    unentered: bool = False
