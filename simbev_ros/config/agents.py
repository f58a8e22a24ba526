"""Agents in one scene: the ego, and the section ``agents`` with the vehicles and roadside units that carry rigs."""

from collections.abc import Collection, Mapping, Sequence
from itertools import chain
from typing import Annotated, Any, Final, Literal, Self

from pydantic import (
    Field,
    SerializerFunctionWrapHandler,
    ValidationInfo,
    field_validator,
    model_serializer,
    model_validator,
)

from simbev_ros.config.annotation import Annotation
from simbev_ros.config.base import FieldError, Keys, Model, dotted_path
from simbev_ros.config.draw import Distribution, Drawn, within
from simbev_ros.config.evaluation import Evaluation, answer_topics_of
from simbev_ros.config.frames import Frames
from simbev_ros.config.names import MAX_TOPIC_NAME_CHARS, TopicName
from simbev_ros.config.odometry import Odometry
from simbev_ros.config.places import Arrangements, DrawnArrangement, Mast, Near, SpawnPose, SpawnPoses, poses_on
from simbev_ros.config.rig import Rig
from simbev_ros.config.sensor import MAX_HEIGHT_ON_VEHICLE_M, MAX_SENSOR_HEIGHT_M
from simbev_ros.foundation.files.limits import MAX_AGENTS

EgoDriverKind = Literal["traffic", "twist", "ackermann", "trajectory", "path"]

RESERVED_NAMES: Final = (
    *("all", "world", "sync", "v2x", "clock", "tf", "tf_static", "robot_description", "prediction", "evaluation"),
    *("map", "diagnostics", "drive", "rosout", "parameter_events"),
    *("bev", "boxes", "cmd_vel", "detections", "hd_map", "occupancy", "odom", "path", "vector_map"),
)
"""Names that no agent of several may have: ``--agent all``, the beginnings of topics and frames of the whole scene,
and those of an agent's own topics, which readers of bags name without the agent."""


def driver_participant(agent: str) -> str:
    """Name on /sync/ready of the node that sends stamped commands to the vehicle of an agent."""
    return f"{agent}_driver"


class Ego(Model):
    """The ego vehicle."""

    blueprint: str = Field("vehicle.sedan", description="name of a vehicle in the catalog")
    driver: EgoDriverKind = Field(
        "traffic",
        description="traffic: the vehicle drives like others; "
        "twist: it follows geometry_msgs/Twist on /<agent>/cmd_vel, linear.x in m/s (negative: in reverse) "
        "and angular.z in rad/s; the others have a dynamic vehicle model, and in lockstep a command acts at its stamp "
        "plus `graph.window_ticks`; ackermann: ackermann_msgs/AckermannDriveStamped on /<agent>/ackermann_cmd; "
        "trajectory: trajectory_msgs/MultiDOFJointTrajectory on /<agent>/trajectory; path: nav_msgs/Path with stamped "
        "poses on /<agent>/planned_path",
    )
    color: int | None = Field(None, ge=0, le=0xFFFFFF, description="color as 0xRRGGBB, sRGB; none: drawn")
    spawn: SpawnPoses = Field(
        (),
        description="start poses, of which one is drawn for each scene, or such lists by the names of maps (of a file "
        "without its suffix); none: anywhere on the map",
    )
    route: SpawnPoses = Field(
        (),
        description="places that the vehicle passes in this order, on shortest paths, before it drives on at random; "
        "lists, or lists by the names of maps, as in `spawn`",
    )
    speed_factor: Annotated[Drawn, within(0.1, 4)] | None = Field(
        None, description="desired speed as a multiple of the speed limit; none: drawn as for other vehicles"
    )
    reckless_probability: float = Field(
        0.01, ge=0, le=1, description="probability that the driver ignores lights, signs and other road users"
    )
    v2x: bool = Field(True, description="whether the agent sends and receives messages, if there is a section `v2x`")

    @property
    def is_commanded(self) -> bool:
        """Whether an outside node drives the vehicle by stamped commands."""
        return self.driver not in ("traffic", "twist")

    def spawn_on(self, map_name: str) -> tuple[Keys, tuple[SpawnPose, ...]]:
        """The field with the start poses on a map, and these poses."""
        keys, poses = poses_on(self.spawn, map_name)
        return ("spawn", *keys), poses

    def route_on(self, map_name: str) -> tuple[Keys, tuple[SpawnPose, ...]]:
        """The field with the places of the route on a map, and these places."""
        keys, poses = poses_on(self.route, map_name)
        return ("route", *keys), poses


class Agent(Ego):
    """A vehicle or, with `mast`, a roadside unit that carries a rig, in addition to the first agent."""

    name: TopicName = Field(description="name of the agent, the first part of its topics and frames")
    rig: Rig = Field(description="sensors of the agent, which is called `name`, whatever `agent` the rig has")
    count: Annotated[Drawn, within(0, MAX_AGENTS)] | None = Field(
        None,
        description="number of such agents, called `<name>_1`, `<name>_2`, …; a random value is rounded. "
        "None: one, called `name`",
    )
    spawn: SpawnPoses = Field(
        (),
        description="start poses, of which one that no agent listed earlier occupies is drawn for each scene, or such "
        "lists by the names of maps",
    )
    near: Near | None = Field(
        None,
        description="distance from another agent at which the agent starts; without `near` and `spawn` it starts "
        "within `traffic.spawn_radius_m` of the first agent",
    )
    arrangement: DrawnArrangement | None = Field(
        None,
        exclude_if=lambda value: value is None,
        description="how the `count` agents start; cluster: each at the distance `near` another agent; chain: each at "
        "this distance from the first or the last vehicle of a chain along the road, which begins with that agent and "
        "grows ahead and behind; a `choice` of both: drawn for each scene. `near` has its defaults then",
    )
    mast: Mast | None = Field(
        None,
        description="makes the agent a roadside unit, which has no fields of vehicles: `blueprint`, `driver`, "
        "`reckless_probability`, `spawn`, `near` and `arrangement`; none: the agent is a vehicle",
    )
    carrier: int | None = Field(
        None,
        ge=1,
        description="only in replays: actor id of the recorded vehicle that carries the rig; none: the vehicle that "
        "carried the agent of this name",
    )
    frames: Frames | None = Field(
        None,
        description="coordinate frames of the agent; none: those of the first agent. A roadside unit has the defaults",
    )
    annotation: Annotation | None = Field(None, description="labels of the agent; none: those of the first agent")
    evaluation: Evaluation | None = Field(
        None,
        description="live evaluation of the agent's own stack; its topics are by default `/<name>/prediction/boxes` "
        "and `/<name>/prediction/bev`; none: no evaluation",
    )

    @field_validator("rig")
    @classmethod
    def _rig_has_the_name(cls, rig: Rig, info: ValidationInfo) -> Rig:
        return rig.model_copy(update={"agent": info.data.get("name", rig.agent)})

    @field_validator("evaluation")
    @classmethod
    def _topics_have_the_name(cls, evaluation: Evaluation | None, info: ValidationInfo) -> Evaluation | None:
        if evaluation is None or "name" not in info.data:
            return evaluation
        boxes_topic, grids_topic = answer_topics_of(info.data["name"])
        usual = {"boxes_topic": boxes_topic, "grids_topic": grids_topic}
        unset = {name: topic for name, topic in usual.items() if name not in evaluation.model_fields_set}
        return evaluation.model_copy(update=unset)

    @model_validator(mode="after")
    def _evaluated_agent_is_in_every_scene(self) -> Self:
        if self.evaluation is not None and self.count is not None:
            raise FieldError(["evaluation"], "an agent with count has no stack, as not every scene has it")
        return self

    @model_validator(mode="after")
    def _starts_in_one_way(self) -> Self:
        if self.spawn and self.near is not None:
            raise FieldError(["near"], "spawn and near are set; give one of them")
        return self

    @model_validator(mode="after")
    def _several_are_arranged(self) -> Self:
        if self.arrangement is not None and (self.count is None or self.spawn):
            reason = "spawn says where each agent starts" if self.spawn else "an entry without count is one agent"
            raise FieldError(["arrangement"], f"leave it out; {reason}")
        return self

    @model_validator(mode="after")
    def _one_agent_rides_in_a_vehicle(self) -> Self:
        if self.carrier is not None and self.count is not None:
            raise FieldError(["carrier"], "count and carrier are set; give one of them, as a vehicle carries one agent")
        return self

    @model_validator(mode="after")
    def _carrier_carries_the_rig(self) -> Self:
        if self.mast is None:
            require_heights_of_vehicle(self.rig)
        else:
            self._require_no_vehicle()
            self._require_fitting_mast(self.mast)
        return self

    def _require_no_vehicle(self) -> None:
        """Refuse what only vehicles have."""
        for name in _OF_VEHICLES:
            if name in self.model_fields_set and getattr(self, name) not in (None, ()):
                raise FieldError([name], "leave it out; an agent with a mast is a roadside unit, not a vehicle")
        for index, sensor in enumerate(self.rig.sensors):
            if isinstance(sensor, Odometry):
                raise FieldError(["rig", "sensors", index], f"sensor {sensor.name}: a roadside unit has no wheels")
        if self.frames is not None and self.frames.odom:
            raise FieldError(["frames", "odom"], "a roadside unit has no odometry")
        if self.frames is not None and self.frames.base_link != "footprint":
            raise FieldError(["frames", "base_link"], "a roadside unit has no axles; allowed: footprint")

    def _require_fitting_mast(self, mast: Mast) -> None:
        """Refuse a mast that is too high, or too few poses."""
        for sensor in chain.from_iterable(rig.sensors for rig in self.rig.extremes):
            height_m = mast.height_m + sensor.pose.z_m
            if height_m > MAX_SENSOR_HEIGHT_M:
                raise FieldError(
                    ["mast", "height_m"],
                    f"with it, sensor {sensor.name} is {height_m:g} m above the foot; "
                    f"at most {MAX_SENSOR_HEIGHT_M:g} m is allowed",
                )
        by_map = mast.poses if isinstance(mast.poses, dict) else {None: mast.poses}
        for name, poses in by_map.items() if mast.poses else ():
            if self.max_count > len(poses):
                keys = ["mast", "poses", *([] if name is None else [name])]
                raise FieldError(keys, f"up to {self.max_count} roadside units need a pose each; found {len(poses)}")

    @model_serializer(mode="wrap")
    def _without_fields_of_vehicles(self, handler: SerializerFunctionWrapHandler) -> dict[str, Any]:
        values: dict[str, Any] = handler(self)
        return values if self.mast is None else {key: values[key] for key in values if key not in _OF_VEHICLES}

    @model_validator(mode="after")
    def _names_are_short(self) -> Self:
        for name in self.names(self.max_count):
            if len(name) > MAX_TOPIC_NAME_CHARS:
                raise FieldError(["name"], f"{name} is longer than the allowed {MAX_TOPIC_NAME_CHARS} characters")
        return self

    @property
    def min_count(self) -> int:
        """Minimum number of these agents in a scene."""
        return self._rounded_count(0)

    @property
    def max_count(self) -> int:
        """Maximum number of these agents in a scene."""
        return self._rounded_count(1)

    def _rounded_count(self, end: int) -> int:
        if self.count is None:
            return 1
        return round(self.count.support[end] if isinstance(self.count, Distribution) else self.count)

    def names(self, count: int) -> tuple[str, ...]:
        """Names of the agents in a scene with this number of them."""
        return (self.name,) if self.count is None else tuple(f"{self.name}_{k}" for k in range(1, count + 1))

    @property
    def starts_near(self) -> Near | None:
        """Distance of the agent's start from another one; None: anywhere within ``traffic.spawn_radius_m``."""
        return Near() if self.near is None and self.arrangement is not None else self.near

    @property
    def may_chain(self) -> bool:
        """Whether the agents can be a chain."""
        return "chain" in (
            self.arrangement.choice if isinstance(self.arrangement, Arrangements) else [self.arrangement]
        )

    @property
    def near_of_place(self) -> tuple[Keys, Near | None]:
        """The field that says how far from another agent this one starts or stands, and its value."""
        if self.mast is None:
            return ("near",), self.near
        return ("mast", self.mast.drawn_place or "poses", "near"), self.mast.near


_OF_VEHICLES = (*(name for name in Ego.model_fields if name != "v2x"), "near", "arrangement", "carrier")
"""Fields of an agent that a roadside unit does not have."""


def require_heights_of_vehicle(rig: Rig) -> None:
    """Check that a vehicle can carry a rig.

    Raises:
        FieldError: A sensor is too high.
    """
    for index, sensor in chain.from_iterable(enumerate(each.sensors) for each in rig.extremes):
        if sensor.pose.z_m > MAX_HEIGHT_ON_VEHICLE_M:
            raise FieldError(
                ["rig", "sensors", index, "pose", "z_m"],
                f"is {sensor.pose.z_m:g}, but at most {MAX_HEIGHT_ON_VEHICLE_M:g} is allowed on a vehicle",
            )


def require_consistent_agents(rig: Rig, agents: Sequence[Agent]) -> None:
    """Check the names and the number of a configuration's agents against each other.

    Args:
        rig: The first agent's rig.
        agents: The other agents.

    Raises:
        FieldError: A name is not unique or not allowed, ``near`` names no earlier agent, or there are too many agents.
    """
    keys_by_name: dict[str, Keys] = {rig.agent: ("rig", "agent")}
    certain, stations = [rig.agent], list[str]()
    for index, agent in enumerate(agents):
        keys = ("agents", index)
        near_keys, near = agent.near_of_place
        if agent.may_chain and near is not None and near.agent in stations:
            raise FieldError((*keys, *near_keys, "agent"), f"{near.agent} is a roadside unit; a chain needs a vehicle")
        if near is not None and near.agent not in (None, *certain):
            raise FieldError(
                (*keys, *near_keys, "agent"),
                f"no agent {near.agent!r} is listed earlier and in every scene; allowed: {', '.join(certain)}",
            )
        for name in agent.names(agent.max_count):
            if name in keys_by_name:
                raise FieldError((*keys, "name"), f"two agents are called {name}; names must be unique")
            keys_by_name[name] = (*keys, "name")
        certain += agent.names(agent.min_count)
        stations += agent.names(agent.max_count) if agent.mast is not None else ()
    if len(keys_by_name) > MAX_AGENTS:
        raise FieldError(["agents"], f"up to {len(keys_by_name)} agents in a scene; at most {MAX_AGENTS} are allowed")
    _require_free_names(keys_by_name, (rig, *(agent.rig for agent in agents)))


def require_maps_of_poses(ego: Ego, agents: Sequence[Agent], maps: Collection[str]) -> None:
    """Check that poses are given for maps (by name) that the configuration has, and those of masts for all of them.

    Raises:
        FieldError: There is no such map, or a mast has no pose on a map.
    """
    fields: list[tuple[Keys, Any]] = [(("ego", "spawn"), ego.spawn)]
    for index, agent in enumerate(agents):
        poses = agent.spawn if agent.mast is None else agent.mast.poses
        fields.append((("agents", index, *(["spawn"] if agent.mast is None else ["mast", "poses"])), poses))
    for keys, poses in fields:
        if not isinstance(poses, dict):
            continue
        for name in poses:
            if name not in maps:
                allowed = ", ".join(sorted(maps))
                raise FieldError((*keys, name), f"no scene is on a map of this name; allowed: {allowed}")
        if "mast" in keys and (missing := sorted({*maps} - {*poses})):
            raise FieldError(keys, f"has no poses on {', '.join(missing)}, where scenes are, too")


def require_consistent_evaluations(first: Evaluation | None, agents: Sequence[Agent]) -> None:
    """Check the evaluated stacks of a configuration's agents against each other.

    Args:
        first: Evaluation of the first agent's stack.
        agents: The other agents.

    Raises:
        FieldError: Two stacks answer on one topic, two have the same file of figures, or there is no joint truth.
    """
    evaluations: dict[Keys, Evaluation | None] = {("evaluation",): first}
    evaluations |= {("agents", index, "evaluation"): agent.evaluation for index, agent in enumerate(agents)}
    owners: dict[str, Keys] = {}
    for keys, evaluation in evaluations.items():
        if evaluation is None:
            continue
        if evaluation.truth == "joint" and not agents:
            raise FieldError((*keys, "truth"), "a scene with one agent has no joint truth; it must be own")
        for name in ("boxes_topic", "grids_topic", "figures"):
            value = getattr(evaluation, name)
            if value is not None and (owner := owners.setdefault(value, keys)) != keys:
                raise FieldError((*keys, name), f"{value} is in {dotted_path(owner)}, too; each agent needs its own")


def _require_free_names(keys_by_name: Mapping[str, Keys], rigs: Sequence[Rig]) -> None:
    """Refuse names of agents that topics, frames or sensors have."""
    sensors = {sensor.name for rig in rigs for sensor in rig.sensors}
    for name, keys in keys_by_name.items():
        if name in sensors:
            raise FieldError(keys, f"a sensor is called {name}, too; each agent of several needs a name of its own")
        if name in RESERVED_NAMES:
            raise FieldError(keys, f"{name!r} is taken; not allowed: {', '.join(RESERVED_NAMES)}")
