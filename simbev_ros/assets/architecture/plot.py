"""Room for a building."""

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Plot:
    """What a building has to fit.

    Attributes:
        width_m: Along the street.
        depth_m: Away from it.
        height_m: Wanted height of the eaves.
        foundation_m: How far its foot reaches below the floor of the ground story.
        garage: Side of a detached house that its garage is on, seen from the street: -1 left, 1 right, 0 none.
    """

    width_m: float
    depth_m: float
    height_m: float
    foundation_m: float = 0.4
    garage: int = 0
