"""Agents in one scene: the ego, and the section ``agents`` with the vehicles that carry further rigs."""

from collections.abc import Mapping, Sequence
from typing import Annotated, Final, Literal, Self

from pydantic import Field, ValidationInfo, field_validator, model_validator

from simbev_ros.config.annotation import Annotation
from simbev_ros.config.base import FieldError, Keys, Model, dotted_path
from simbev_ros.config.draw import Distribution, Drawn, within
from simbev_ros.config.evaluation import Evaluation, answer_topics_of
from simbev_ros.config.frames import Frames
from simbev_ros.config.names import MAX_TOPIC_NAME_CHARS, TopicName
from simbev_ros.config.rig import Rig
from simbev_ros.limits import MAX_AGENTS

EgoDriverKind = Literal["traffic", "twist"]

RESERVED_NAMES: Final = (
    *("world", "sync", "v2x", "clock", "tf", "tf_static", "robot_description", "prediction", "evaluation"),
    *("map", "diagnostics", "rosout", "parameter_events"),
    *("bev", "boxes", "cmd_vel", "detections", "hd_map", "occupancy", "odom", "path", "vector_map"),
)
"""Names that no agent beside others may have: topics and frames of the whole scene begin with the former ones, and an
agent's own topics, which readers of bags name without the agent, with the latter ones."""


class SpawnPose(Model):
    """Start pose of an agent: the center of its vehicle's footprint, map frame; it is moved to the nearest lane."""

    x_m: float = Field(ge=-1e6, le=1e6, description="x in the map frame")
    y_m: float = Field(ge=-1e6, le=1e6, description="y in the map frame")
    z_m: float | None = Field(
        None, ge=-1e4, le=1e4, description="height of the road, which selects one of several levels"
    )
    yaw_deg: float | None = Field(
        None, ge=-360, le=360, description="approximate heading, which selects the driving direction"
    )


class Ego(Model):
    """The ego vehicle."""

    blueprint: str = Field("vehicle.sedan", description="name of a vehicle in the catalog")
    driver: EgoDriverKind = Field(
        "traffic",
        description="traffic: the vehicle drives like others; "
        "twist: it follows geometry_msgs/Twist on /<agent>/cmd_vel, linear.x in m/s and angular.z in rad/s",
    )
    spawn: tuple[SpawnPose, ...] = Field(
        (), description="start poses, of which one is drawn for each scene; none: anywhere on the map"
    )
    reckless_probability: float = Field(
        0.01, ge=0, le=1, description="probability that the driver ignores lights, signs and other road users"
    )


class Near(Model):
    """Distance from another agent at which an agent starts."""

    agent: TopicName | None = Field(None, description="name of an agent listed earlier; none: the first agent")
    distance_m: Annotated[Drawn, within(5, 1000)] = Field(
        40.0, description="horizontal distance between the two starts; it is drawn for each scene and agent"
    )
    tolerance_m: float = Field(20.0, gt=0, le=1000, description="permitted deviation from the distance")


class Agent(Ego):
    """A vehicle that carries a rig, beside the first agent."""

    name: TopicName = Field(description="name of the agent, the first part of its topics and frames")
    rig: Rig = Field(description="sensors of the agent, which is called `name`, whatever `agent` the rig has")
    count: Annotated[Drawn, within(0, MAX_AGENTS)] | None = Field(
        None,
        description="number of such agents, called `<name>_1`, `<name>_2`, …; a drawn value is rounded. "
        "None: one, called `name`",
    )
    spawn: tuple[SpawnPose, ...] = Field(
        (), description="start poses, of which one that no agent listed earlier occupies is drawn for each scene"
    )
    near: Near | None = Field(
        None,
        description="distance from another agent at which the agent starts; without `near` and `spawn` it starts "
        "within `traffic.spawn_radius_m` of the first agent",
    )
    frames: Frames | None = Field(None, description="coordinate frames of the agent; none: those of the first agent")
    annotation: Annotation | None = Field(None, description="labels of the agent; none: those of the first agent")
    evaluation: Evaluation | None = Field(
        None,
        exclude_if=lambda evaluation: evaluation is None,
        description="live evaluation of the agent's own stack, whose topics are by default `/<name>/prediction/boxes` "
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


def require_consistent_agents(rig: Rig, agents: Sequence[Agent]) -> None:
    """Check the names and the number of a configuration's agents against each other.

    Args:
        rig: The first agent's rig.
        agents: The other agents.

    Raises:
        FieldError: A name is not unique or not allowed, ``near`` names no earlier agent, or there are too many agents.
    """
    keys_by_name: dict[str, Keys] = {rig.agent: ("rig", "agent")}
    certain = [rig.agent]
    for index, agent in enumerate(agents):
        keys = ("agents", index)
        if agent.near is not None and agent.near.agent not in (None, *certain):
            raise FieldError(
                (*keys, "near", "agent"),
                f"no agent {agent.near.agent!r} is listed earlier and in every scene; allowed: {', '.join(certain)}",
            )
        for name in agent.names(agent.max_count):
            if name in keys_by_name:
                raise FieldError((*keys, "name"), f"two agents are called {name}; names must be unique")
            keys_by_name[name] = (*keys, "name")
        certain += agent.names(agent.min_count)
    if len(keys_by_name) > MAX_AGENTS:
        raise FieldError(["agents"], f"up to {len(keys_by_name)} agents in a scene; at most {MAX_AGENTS} are allowed")
    _require_free_names(keys_by_name, (rig, *(agent.rig for agent in agents)))


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
            raise FieldError(keys, f"a sensor is called {name}, too; agents beside others need names of their own")
        if name in RESERVED_NAMES:
            raise FieldError(keys, f"{name!r} is taken; not allowed: {', '.join(RESERVED_NAMES)}")
