"""Where agents start or stand: poses of vehicles and masts, places for masts, and distances between agents."""

from typing import Annotated, Literal, Self, TypeVar

import numpy as np
from pydantic import Discriminator, Field, Tag, model_validator

from simbev_ros.config.base import Keys, Model
from simbev_ros.config.draw import Drawn, within
from simbev_ros.config.names import TopicName
from simbev_ros.config.sensor import MAX_SENSOR_HEIGHT_M

_X_M = Field(ge=-1e6, le=1e6, description="x in the map frame")
_Y_M = Field(ge=-1e6, le=1e6, description="y in the map frame")


class SpawnPose(Model):
    """Start pose of an agent: the center of its vehicle's footprint, map frame; it is moved to the nearest lane."""

    x_m: float = _X_M
    y_m: float = _Y_M
    z_m: float | None = Field(
        None, ge=-1e4, le=1e4, description="height of the road, which selects one of several levels"
    )
    yaw_deg: float | None = Field(
        None, ge=-360, le=360, description="approximate heading, which selects the driving direction"
    )


_Form = Discriminator(lambda value: "poses_by_map" if isinstance(value, dict) else "poses")

SpawnPoses = Annotated[
    Annotated[tuple[SpawnPose, ...], Tag("poses")] | Annotated[dict[str, tuple[SpawnPose, ...]], Tag("poses_by_map")],
    _Form,
]
"""Start poses for all maps, or by the names of maps."""


class Near(Model):
    """Distance from another agent at which an agent starts."""

    agent: TopicName | None = Field(None, description="name of an agent listed earlier; none: the first agent")
    distance_m: Annotated[Drawn, within(5, 1000)] = Field(
        40.0, description="horizontal distance between the two starts; it is drawn for each scene and agent"
    )
    tolerance_m: float = Field(20.0, gt=0, le=1000, description="permitted deviation from the distance")


Arrangement = Literal["cluster", "chain"]
"""How the agents of an entry stand: each near the same agent, or one behind another along the road."""


class Arrangements(Model):
    """Arrangements of which one is drawn."""

    choice: Annotated[tuple[Arrangement, ...], Field(min_length=1)] = Field(description="equally likely arrangements")

    def sample(self, rng: np.random.Generator) -> Arrangement:
        """Draw an arrangement."""
        return self.choice[int(rng.integers(len(self.choice)))]


DrawnArrangement = Annotated[
    Annotated[Arrangement, Tag("arrangement")] | Annotated[Arrangements, Tag("arrangements")],
    Discriminator(lambda value: "arrangements" if isinstance(value, (dict, Arrangements)) else "arrangement"),
]
"""An arrangement, or several of which one is drawn for each scene."""


class MastPose(Model):
    """Pose of a roadside unit: the foot of its mast, map frame. It is not moved, and must be off the driving lanes."""

    x_m: float = _X_M
    y_m: float = _Y_M
    z_m: float | None = Field(None, ge=-1e4, le=1e4, description="height of the foot; none: that of the ground")
    yaw_deg: float = Field(0.0, ge=-360, le=360, description="direction of the x axis of the unit's sensors")


MastPoses = Annotated[
    Annotated[tuple[MastPose, ...], Tag("poses")] | Annotated[dict[str, tuple[MastPose, ...]], Tag("poses_by_map")],
    _Form,
]
"""Poses of masts for all maps, or by the names of maps."""

P = TypeVar("P", SpawnPose, MastPose)


def poses_on(poses: tuple[P, ...] | dict[str, tuple[P, ...]], map_name: str) -> tuple[Keys, tuple[P, ...]]:
    """The poses on a map, and the keys that lead to them from the field that has them."""
    return ((map_name,), poses.get(map_name, ())) if isinstance(poses, dict) else ((), poses)


class JunctionPlace(Model):
    """A position next to a random junction, at a pole of its traffic lights if it has any; x points to its center."""

    signalised: bool | None = Field(None, description="whether the junction has traffic lights; none: it may")
    near: Near | None = Field(
        None,
        description="distance of the junction's center from another agent's start; none: up to "
        "`traffic.spawn_radius_m` from that of the first agent",
    )


class RoadPlace(Model):
    """A point above a random driving lane under the open sky; x points in driving direction."""

    near: Near | None = Field(
        None,
        description="distance of the point from another agent's start; none: up to `traffic.spawn_radius_m` from that "
        "of the first agent",
    )


class Mast(Model):
    """The mast of a roadside unit, without a body. One of `poses`, `junction` and `above_road` says where it stands."""

    poses: MastPoses = Field(
        (),
        description="poses of which one that no other unit of the entry has is drawn for each scene, or such lists "
        "by the names of maps",
    )
    junction: JunctionPlace | None = None
    above_road: RoadPlace | None = None
    height_m: float = Field(
        0.0,
        ge=0,
        le=150,
        description="height that is added to `z_m` of every sensor of the rig; each sum is at most "
        f"{MAX_SENSOR_HEIGHT_M:g} m",
    )

    @model_validator(mode="after")
    def _stands_in_one_place(self) -> Self:
        found = [name for name in ("poses", "junction", "above_road") if getattr(self, name) not in ((), {}, None)]
        if len(found) != 1:
            raise ValueError(
                f"needs exactly one of poses, junction, above_road; found {' and '.join(found) if found else 'none'}"
            )
        return self

    @property
    def drawn_place(self) -> Literal["junction", "above_road"] | None:
        """The field that says where the mast stands; None: poses do."""
        return "junction" if self.junction is not None else "above_road" if self.above_road is not None else None

    @property
    def near(self) -> Near | None:
        """Distance of a drawn place from another agent."""
        place = self.junction or self.above_road
        return None if place is None else place.near
