"""The perception stacks that run with a graph: the topics that they answer to, their commands, and what they need."""

import sys
from collections.abc import Iterator, Sequence
from importlib import import_module
from pathlib import Path

from simbev_ros.config.camera import Camera
from simbev_ros.config.evaluation import BOXES_TOPIC, GRIDS_TOPIC, EvaluatedAgent, Evaluation
from simbev_ros.config.included_stacks import INCLUDED_STACKS, TRACK_OPTION, IncludedStack
from simbev_ros.config.lidar import Lidar
from simbev_ros.config.rig import Rig
from simbev_ros.config.scenario import Scenario
from simbev_ros.foundation.errors import InputError
from simbev_ros.ros.conventions.arguments import PLAIN, RosArguments
from simbev_ros.ros.msgs.sensor_topics import camera_info_name, points_name
from simbev_ros.ros.msgs.topics import odometry_name

_AT_EVERY_TICK_HZ = float("inf")


def stack_commands(scenario: Scenario, ros: RosArguments = PLAIN, *, live: bool = False) -> dict[str, tuple[str, ...]]:
    """Commands of the perception stacks to run with the graph, by the label of their processes.

    Args:
        scenario: The configuration.
        ros: ROS arguments of all nodes of the graph; an included stack gets them too, others do not.
        live: Whether the world is paced by the wall clock.

    Raises:
        InputError: The weights do not exist.
    """
    agents = scenario.evaluated_agents
    commands = {agent.label("stack"): _command(agent, _partners(agent, agents), ros, live=live) for agent in agents}
    return {label: command for label, command in commands.items() if command}


def boxes_command(scenario: Scenario, ros: RosArguments = PLAIN, *, live: bool = False) -> tuple[str, ...]:
    """Command of the included stack of which the driver needs the boxes; empty: it needs none.

    Raises:
        InputError: The rig lacks sensors, or the weights do not exist.
    """
    if (boxes := scenario.driver_boxes) is None:
        return ()
    agent = EvaluatedAgent("", scenario.rig, Evaluation(stack=(boxes, TRACK_OPTION)))
    _require_sensors(agent, INCLUDED_STACKS[boxes], "drive.stack")
    return _command(agent, (), ros, live=live)


def _partners(agent: EvaluatedAgent, agents: Sequence[EvaluatedAgent]) -> list[EvaluatedAgent]:
    """The agents whose boxes the included stack of an agent merges into its own: those that do not wait for others."""
    if agent.evaluation.included is None or not agent.evaluation.included.merges:
        return []
    others = (each for each in agents if each.name != agent.name)
    return [each for each in others if each.evaluation.included is None or not each.evaluation.included.merges]


def _command(
    agent: EvaluatedAgent, partners: Sequence[EvaluatedAgent], ros: RosArguments, *, live: bool
) -> tuple[str, ...]:
    """Command of an agent's stack; empty: none runs with the graph."""
    included = agent.evaluation.included
    if included is None:
        return agent.evaluation.stack or ()
    settings = [f"lidar_topic:={_lidar_topic(agent)}"] if "lidar" in included.sees else []
    settings += [f"agent:={agent.name}"] if agent.name and included.modality is not None else []
    settings += [f"partners:=[{','.join(map(input_topic, partners))}]"] if partners else []
    settings += ["live:=true"] if live else []
    parameters = [word for setting in settings for word in ("-p", setting)]
    remapping = [word for rule in _remapping(agent, included, partners) for word in ("--remap", rule)]
    words = _model_words(included, agent.evaluation)
    return (sys.executable, "-m", included.module, *words, *ros.command(*parameters, *remapping))


def require_stacks(scenario: Scenario) -> None:
    """Check that the included stacks have what they need.

    Raises:
        InputError: A rig lacks sensors, or packages or weights are missing.
    """
    for agent in scenario.evaluated_agents:
        if (included := agent.evaluation.included) is not None:
            _require_sensors(agent, included)
            if included.merges:
                _require_partners(included, _partners(agent, scenario.evaluated_agents))
            _model_words(included, agent.evaluation)


def _require_sensors(agent: EvaluatedAgent, included: IncludedStack, field: str = "evaluation.stack") -> None:
    rig = agent.rig
    found = {"lidar": (list(_lidar_topics(rig)), "points"), "camera": (_color_cameras(rig), "rgb images")}
    for sensor in included.sees:
        sensors, data = found[sensor]
        if not sensors:
            raise InputError(f"{field}: {included.name}: the rig of {rig.agent} has no {sensor} with {data}")


def _require_partners(included: IncludedStack, partners: Sequence[EvaluatedAgent]) -> None:
    if not partners:
        raise InputError(f"evaluation.stack: {included.name}: no other agent has a stack of its own that is evaluated")
    for each in partners:
        if (topic := input_topic(each)) not in [name for name, _ in _lidar_topics(each.rig)]:
            raise InputError(
                f"evaluation.stack: {included.name}: the stack of {each.rig.agent} answers to {topic}; it must answer "
                "to points of a lidar"
            )


def input_topic(agent: EvaluatedAgent) -> str:
    """Topic that an agent's stack answers to.

    It is the configured one. Else it is that of the slowest sensor that an included stack sees, as it answers when all
    of them are due; for other stacks that of the rig's first lidar, else first camera.
    """
    rig, evaluation = agent.rig, agent.evaluation
    if evaluation.answers_to is not None:
        return evaluation.answers_to
    sees = ("lidar",) if evaluation.included is None else evaluation.included.sees
    topics = [*_camera_topics(rig)] if "camera" in sees else []
    topics += [*_lidar_topics(rig)][:1] if "lidar" in sees else []
    if topics:
        return min(topics, key=lambda topic: topic[1])[0]
    for camera in rig.of_type(Camera):
        return camera_info_name(rig.agent, camera.name, camera.modalities[0])
    return odometry_name(rig.agent)


def _model_words(included: IncludedStack, evaluation: Evaluation) -> tuple[str, ...]:
    """Words of the command that say which model runs. The stack's package knows them, and what the model needs."""
    if included.modality is None:
        return ()
    weights = None if evaluation.weights is None else Path(evaluation.weights)
    words = import_module(f"{included.module}.command").model_words(included.modality, weights)
    return (*words, *([TRACK_OPTION] if evaluation.tracks else []))


def _remapping(agent: EvaluatedAgent, included: IncludedStack, partners: Sequence[EvaluatedAgent]) -> Iterator[str]:
    """Rules that give a stack's node and topics their names in this graph, relative to its namespace."""
    boxes = agent.evaluation.boxes_topic
    topics = {
        "/ego/odom": odometry_name(agent.rig.agent),
        BOXES_TOPIC: boxes,
        f"{BOXES_TOPIC}/markers": f"{boxes}/markers",
        GRIDS_TOPIC: agent.evaluation.grids_topic,
        **{f"/{each.rig.agent}{BOXES_TOPIC}": each.evaluation.boxes_topic for each in partners},
    }
    if agent.name:
        yield f"__node:={included.participant_of(agent.name)}"
    for old, new in topics.items():
        if new != old:
            yield f"{old.removeprefix('/')}:={new.removeprefix('/')}"


def _lidar_topic(agent: EvaluatedAgent) -> str:
    """Topic of the clouds that an included stack sees: that which it answers to, else that of the first lidar."""
    topics, answered = [name for name, _ in _lidar_topics(agent.rig)], agent.evaluation.answers_to
    return answered if answered in topics else topics[0]


def _lidar_topics(rig: Rig) -> Iterator[tuple[str, float]]:
    """Topic and rate of the points of each lidar."""
    for lidar in rig.of_type(Lidar):
        if lidar.points:
            yield points_name(rig.agent, lidar.name), _rate_hz(lidar.rate_hz)


def _camera_topics(rig: Rig) -> Iterator[tuple[str, float]]:
    """Topic and rate of the camera_info of the color images of each camera."""
    for camera in _color_cameras(rig):
        yield camera_info_name(rig.agent, camera.name, "rgb"), _rate_hz(camera.rate_hz)


def _color_cameras(rig: Rig) -> list[Camera]:
    return [camera for camera in rig.of_type(Camera) if "rgb" in camera.modalities]


def _rate_hz(rate_hz: float | None) -> float:
    """Rate of a sensor, to compare it with others."""
    return _AT_EVERY_TICK_HZ if rate_hz is None else rate_hz
