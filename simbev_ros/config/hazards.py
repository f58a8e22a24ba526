"""Hazard areas: accidents and work zones, with what guards them."""

from typing import Annotated

from pydantic import Field

from simbev_ros.config.base import Model
from simbev_ros.config.draw import Distribution, Drawn, PaperOrDrawn, within


class Hazards(Model):
    """Accidents and work zones that close some lanes of a street, or all of a road with one."""

    count: Annotated[PaperOrDrawn, within(0, 100)] = Field(
        "paper", description="in each scene; paper: each free place where vehicles can start becomes one by chance"
    )
    probability: float = Field(0.016, ge=0, le=1, description="of each such place; only `count: paper` heeds it")
    accident_share: float = Field(0.5, ge=0, le=1, description="the others are work zones")
    emergency_vehicle_probability: float = Field(0.5, ge=0, le=1, description="of accidents: one has arrived")
    length_m: Annotated[Drawn, within(24, 200)] = Field(
        Distribution(uniform=(24, 36)), description="without the tapers before and behind"
    )
    taper_factor: float = Field(
        0.5, ge=0.2, le=1, description="length of the taper over that of the MUTCD, for which streets have little room"
    )
    cone_spacing_m: float = Field(4.0, ge=1, le=20, description="distance between cones")
    cone_missing_probability: float = Field(0.32, ge=0, le=1, description="of each cone")
    workers: Annotated[Drawn, within(0, 20)] = Field(
        Distribution(uniform=(0.5, 3.5)), description="who stand in each work zone, as far as there is room"
    )
    sign_distance_m: Annotated[Drawn, within(5, 500)] = Field(
        Distribution(uniform=(40, 160)), description="of the warning sign ahead of the first cone"
    )
