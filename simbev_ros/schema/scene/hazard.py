"""Specification of a scene's hazard areas: the lanes they close, their outline, and the props around them."""

from enum import StrEnum

from pydantic import Field

from simbev_ros.config.base import Model


class HazardKind(StrEnum):
    """Cause of a hazard area."""

    ACCIDENT = "accident"
    WORK_ZONE = "work_zone"


class BlockedStretch(Model):
    """A stretch of a lane that cannot be driven on; distances are from the lane's start along its center line."""

    lane: str
    from_s_m: float = Field(ge=0)
    to_s_m: float = Field(gt=0)


class PropSpec(Model):
    """An object that stands on the ground, map frame."""

    blueprint: str
    x_m: float
    y_m: float
    z_m: float = Field(description="approximate height; identifies the road level")
    yaw_rad: float = Field(description="heading of the approaching traffic")


class HazardSpec(Model):
    """One hazard area."""

    kind: HazardKind
    blocked: tuple[BlockedStretch, ...] = ()
    closed_edges: tuple[str, ...] = Field(
        (), description="edges closed to all traffic; not empty: the whole road is closed"
    )
    outline_m: tuple[tuple[float, float], ...] = Field(
        min_length=3, description="outline of the area, map frame, counterclockwise, first corner not repeated"
    )
    z_m: float = Field(0.0, description="approximate height; identifies the road level")
    emergency_vehicle: bool | None = Field(
        None, description="whether an emergency vehicle has arrived; none: not an accident"
    )
    sign_distance_m: float | None = Field(
        None, ge=0, description="distance along the road from the warning sign to the area; none: no room for a sign"
    )
    cones_missing: int = Field(0, ge=0)
    props: tuple[PropSpec, ...] = ()
