"""Section ``hazards``: accidents and work zones, with their cones, warning signs, workers and emergency vehicles."""

from typing import Annotated

from pydantic import Field

from simbev_ros.config.base import Model
from simbev_ros.config.draw import Distribution, Drawn, PaperOrDrawn, within


class Hazards(Model):
    """Accidents and work zones that close some lanes of a street, or all of a road with a single lane."""

    count: Annotated[PaperOrDrawn, within(0, 100)] = Field(
        "paper",
        description="number of hazards per scene; "
        "paper: each free start position of vehicles becomes one with `probability`",
    )
    probability: float = Field(
        0.016, ge=0, le=1, description="probability of a hazard at each free start position, with `count: paper`"
    )
    accident_share: float = Field(0.5, ge=0, le=1, description="share of accidents; the others are work zones")
    emergency_vehicle_probability: float = Field(
        0.5, ge=0, le=1, description="probability that an emergency vehicle is at an accident"
    )
    length_m: Annotated[Drawn, within(24, 200)] = Field(
        Distribution(uniform=(24, 36)), description="length of the closed area, without the tapers at its ends"
    )
    taper_factor: float = Field(
        0.5,
        ge=0.2,
        le=1,
        description="length of the taper relative to the MUTCD's, for which streets are often too short",
    )
    cone_spacing_m: float = Field(4.0, ge=1, le=20, description="distance between cones")
    cone_missing_probability: float = Field(0.32, ge=0, le=1, description="probability that a cone is missing")
    workers: Annotated[Drawn, within(0, 20)] = Field(
        Distribution(uniform=(0.5, 3.5)), description="number of workers in each work zone, if there is space"
    )
    sign_distance_m: Annotated[Drawn, within(5, 500)] = Field(
        Distribution(uniform=(40, 160)), description="distance of the warning sign ahead of the first cone"
    )
