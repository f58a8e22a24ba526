"""Hazard areas of a scene: which lanes they close, what area they cover, and the things that stand around them."""

from enum import StrEnum

from pydantic import Field

from simbev_ros.config.base import Model


class HazardKind(StrEnum):
    """Why there is one."""

    ACCIDENT = "accident"
    WORK_ZONE = "work_zone"


class BlockedStretch(Model):
    """A stretch of a lane where nobody can drive; distances from the lane's start along its centre line."""

    lane: str
    from_s_m: float = Field(ge=0)
    to_s_m: float = Field(gt=0)


class PropSpec(Model):
    """A thing that stands on the ground, map frame."""

    blueprint: str
    x_m: float
    y_m: float
    z_m: float = Field(description="about; tells the levels of roads apart")
    yaw_rad: float = Field(description="in which the traffic goes that comes up to it")


class HazardSpec(Model):
    """One hazard area."""

    kind: HazardKind
    blocked: tuple[BlockedStretch, ...] = ()
    closed_edges: tuple[str, ...] = Field((), description="streets that nobody drives onto; some: nobody can pass")
    outline_m: tuple[tuple[float, float], ...] = Field(
        min_length=3, description="of the area, map frame, counterclockwise, not closed"
    )
    z_m: float = Field(0.0, description="about; tells the levels of roads apart")
    emergency_vehicle: bool | None = Field(None, description="whether one has arrived; none: it is no accident")
    sign_distance_m: float | None = Field(
        None, ge=0, description="along the road from the warning sign to the area; none: there is no place for one"
    )
    cones_missing: int = Field(0, ge=0)
    props: tuple[PropSpec, ...] = ()
