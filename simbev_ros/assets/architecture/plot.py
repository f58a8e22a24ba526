"""Plot of land that a building has to fit."""

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Plot:
    """Size that a building has to fit.

    Attributes:
        width_m: Width along the street.
        depth_m: Depth away from the street.
        height_m: Desired height of the eaves.
        foundation_m: Depth of the foundation below the ground floor.
        garage: Side of a detached house where its garage is, seen from the street: -1 left, 1 right, 0 none.
    """

    width_m: float
    depth_m: float
    height_m: float
    foundation_m: float = 0.4
    garage: int = 0
