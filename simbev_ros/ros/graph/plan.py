"""Plans the processes of a graph: which nodes run in which process, and with which parameters.

The plan follows from the configuration and from numbers of cores and camera processes; the machine is not inspected.
What is recorded does not depend on it.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from simbev_ros.config.camera import Camera
from simbev_ros.config.evaluation import EvaluatedAgent
from simbev_ros.config.lidar import Lidar
from simbev_ros.config.radar import Radar
from simbev_ros.config.rendering import Rendering
from simbev_ros.config.rig import SENSOR_KINDS
from simbev_ros.config.scenario import Scenario
from simbev_ros.config.sensor import Sensor
from simbev_ros.ros.conventions.names import NodeName
from simbev_ros.ros.graph.evaluated_stack import input_topic
from simbev_ros.ros.msgs.annotation_topics import Label, bev_labels_name, boxes_name, viewing_cameras
from simbev_ros.ros.msgs.joint_topics import JOINT_BOXES

_Parameters = Mapping[str, object]


@dataclass(frozen=True, slots=True)
class NodePlan:
    """A node of the graph: its kind, its name, its ROS parameters, and the agent that it belongs to, if any.

    Nodes that can serve several agents belong to the graph if the configuration has several.
    """

    kind: str
    name: str
    parameters: _Parameters
    agent: str = ""

    def ros_name(self, namespace: str) -> NodeName:
        """Its name in a graph with this namespace."""
        return NodeName(self.name, self.agent, namespace)


ProcessPlan = tuple[NodePlan, ...]
"""The nodes that share one process."""

_STACK_PATIENCE_FRACTION = 0.8
"""Fraction of the silence timeout for which an evaluator waits for a stack, so that it can report what is missing."""

WRITERS = ("recorder", "evaluator")
"""Kinds of nodes that report one tick more than a scene has, when their files are closed."""
_RAY_CASTING = (Lidar, Radar)
"""Sensors whose nodes can share a process: radars need a tenth of a lidar's time and the same meshes in memory. For
this reason, one node serves the radars of all agents, however many lidar nodes there are."""
_MANY_CORES = 8
"""Number of cores from which on time counts more than memory; with a multiple of it, nodes share several agents."""
_ANNOTATORS: tuple[tuple[int, tuple[tuple[Label, ...], ...]], ...] = (
    (16, ((Label.BOXES,), (Label.VIEWS,), (Label.SURROUNDINGS,))),
    (_MANY_CORES, ((Label.BOXES, Label.VIEWS), (Label.SURROUNDINGS,))),
    (0, (tuple(Label),)),
)
"""Minimum number of cores, and what each annotator labels: Python's lock is what keeps one of them from doing more."""


def plan_processes(
    scenario: Scenario,
    camera_processes: int,
    *,
    live: bool,
    dataset: Path | None,
    figures: Path | None = None,
    rendering: Rendering | None = None,
    cores: int = 1,
    serves: bool = False,
) -> list[ProcessPlan]:
    """Plan every process of the graph, the world first.

    Args:
        scenario: The configuration.
        camera_processes: Number of processes that share the cameras of all agents, at most one for each camera.
        live: Whether the world is paced by the wall clock.
        dataset: Folder into which scenes are recorded; None: they are not recorded.
        figures: Folder for the figures of evaluators; None: only those that are asked for are written.
        rendering: How cameras render; None: as configured.
        cores: Number of CPU cores; with few of them, more nodes share a process.
        serves: Whether the world answers to simulation_interfaces.
    """
    drawing = {"rendering": (rendering or scenario.rendering).model_dump_json()}
    behind = list(_processes_behind_world(scenario, camera_processes, drawing, live=live, dataset=dataset, cores=cores))
    state_readers = sum(map(len, behind))
    for agent in scenario.evaluated_agents:
        behind.append((_evaluator(scenario, agent, live=live, figures=figures),))
    names = [node.name for process in behind for node in process]
    parameters = {
        "live": live,
        "recorded": dataset is not None,
        "participants": [*names, *scenario.participants],
        "outside_participants": list(scenario.participants),
        "state_readers": state_readers,
        "window_ticks": _window_ticks(scenario, cores),
        "max_real_time_factor": scenario.graph.real_time_factor(live=live),
        **({"serves": True} if serves else {}),
    }
    return [(NodePlan("world", "world", parameters),), *behind]


def _window_ticks(scenario: Scenario, cores: int) -> int:
    """Maximum lead of the world over the slowest node: a long one keeps many cores busy, a short one reacts soon."""
    if scenario.graph.window_ticks != "auto":
        return scenario.graph.window_ticks
    is_closed = not scenario.participants and scenario.is_driven_by_traffic
    return 8 if is_closed and cores >= _MANY_CORES else 3


def _processes_behind_world(
    scenario: Scenario, camera_processes: int, drawing: _Parameters, *, live: bool, dataset: Path | None, cores: int
) -> Iterator[ProcessPlan]:
    chosen = scenario.recording.topics.model_dump(mode="json")
    patterns = {f"{name}_topics": list(words) for name, words in chosen.items() if words}
    pace = {"live": live, "reliable": live and scenario.graph.live_reliability == "reliable"}
    common: dict[str, object] = {**pace, "recorded": dataset is not None, "annotated": True, **patterns}
    if scenario.agents:
        common["box_readers"] = len(_box_readers(scenario))
    if scenario.evaluated_agents:
        common["evaluated_topics"] = [
            topic for agent in scenario.evaluated_agents for topic in _evaluated_topics(agent)
        ]
    compressed = scenario.recording.images == "compressed" and dataset is not None
    yield from _camera_processes(scenario, camera_processes, {**common, **drawing, "compressed": compressed})
    yield from _sensor_processes(scenario, common, cores)
    yield from _annotator_processes(scenario, {**common, "compressed": compressed}, cores)
    if dataset is not None:
        parameters = {
            **pace,
            "dataset": str(dataset.resolve()),
            "config": scenario.as_yaml(),
            "recording": scenario.recording.model_dump_json(),
        }
        yield (NodePlan("recorder", "recorder", parameters),)


def _camera_processes(scenario: Scenario, processes: int, common: _Parameters) -> Iterator[ProcessPlan]:
    """Distribute the cameras among processes, and the processes among GPUs."""
    for index in range(processes):
        parameters = {
            "sensors": _cameras_of_process(scenario, index, processes),
            "recording": scenario.recording.model_dump_json(),
            "process": index,
        }
        name = "camera" if processes == 1 else f"camera_{index}"
        yield (NodePlan("camera", name, {**common, **parameters}, _agent(scenario)),)


def _cameras_of_process(scenario: Scenario, index: int, processes: int) -> list[str]:
    """Names of the cameras that one of the processes serves, with the name of the agent if there are several.

    The cameras of an agent are then served by few processes, as each process that has one prepares the agent's light.
    """
    if not scenario.agents:
        return [camera.name for camera in scenario.rig.of_type(Camera)][index::processes]
    names = [f"{rig.agent}/{camera.name}" for rig in scenario.rigs for camera in rig.of_type(Camera)]
    return names[index * len(names) // processes : (index + 1) * len(names) // processes]


def _sensor_processes(scenario: Scenario, common: _Parameters, cores: int) -> Iterator[ProcessPlan]:
    """Plan the nodes of all other sensors: light-weight ones share a process; with few cores ray casting ones, too."""
    casting, light = list[NodePlan](), list[NodePlan]()
    for kind, model in SENSOR_KINDS.items():
        if model is not Camera and scenario.sensors_of_type(model):
            shares = _shares(scenario, cores, model) if model is Lidar else 1
            alike = casting if model in _RAY_CASTING else light
            alike += _nodes_of_agents(scenario, kind, kind, common, shares)
    light += [NodePlan(kind, kind, common) for kind in _box_readers(scenario)]
    if scenario.drive is not None:
        light.append(NodePlan("referee", "referee", common))
    apart = [casting] if cores < _MANY_CORES else [[node] for node in casting]
    for together in (*apart, light):
        if together:
            yield tuple(together)


def _box_readers(scenario: Scenario) -> list[str]:
    """Kinds of nodes that read the boxes of all agents; they exist if there can be several."""
    readers = {"joint": bool(scenario.agents), "v2x": scenario.v2x is not None}
    return [kind for kind, exists in readers.items() if exists]


def _annotator_processes(scenario: Scenario, parameters: _Parameters, cores: int) -> Iterator[ProcessPlan]:
    """Plan one annotator, or with many cores several that share the agents, and then the labels."""
    agent_shares = _shares(scenario, cores)
    label_shares = next(shares for least, shares in _ANNOTATORS if cores // agent_shares >= least)
    for labels in label_shares:
        if labels == (Label.VIEWS,) and not _has_views(scenario):
            continue
        name = "annotator" if len(label_shares) == 1 else f"annotator_{labels[0]}"
        is_read = Label.VIEWS in labels and Label.BOXES not in labels
        own = {"scope": [label.value for label in labels], "annotated": is_read}
        for node in _nodes_of_agents(scenario, "annotator", name, {**parameters, **own}, agent_shares):
            yield (node,)


def _has_views(scenario: Scenario) -> bool:
    """Whether an agent has cameras whose views of the boxes are published."""
    others = ((agent.rig, agent.annotation or scenario.annotation) for agent in scenario.agents)
    return any(viewing_cameras(*each) for each in ((scenario.rig, scenario.annotation), *others))


def _agent(scenario: Scenario) -> str:
    """The agent that sensor and annotation nodes belong to; empty: they serve several."""
    return "" if scenario.agents else scenario.rig.agent


def _shares(scenario: Scenario, cores: int, kind: type[Sensor] | None = None) -> int:
    """Number of nodes that share the agents with sensors of a kind (None: all agents)."""
    agents = sum(kind is None or bool(rig.of_type(kind)) for rig in scenario.rigs)
    return max(min(agents, cores // _MANY_CORES), 1)


def _nodes_of_agents(
    scenario: Scenario, kind: str, name: str, parameters: _Parameters, shares: int = 1
) -> Sequence[NodePlan]:
    """Nodes of one kind that share the agents; a single one has the plain name."""
    if shares == 1:
        return [NodePlan(kind, name, parameters, _agent(scenario))]
    return [
        NodePlan(kind, f"{name}_{share}", {**parameters, "agent_share": share, "agent_shares": shares})
        for share in range(shares)
    ]


def _evaluated_topics(agent: EvaluatedAgent) -> tuple[str, ...]:
    """Topics that the evaluator of an agent's stack reads from nodes that wait for it."""
    name = agent.rig.agent
    boxes = JOINT_BOXES if agent.evaluation.truth == "joint" else boxes_name(name)
    return boxes, bev_labels_name(name), input_topic(agent)


def figures_file(folder: Path, agent: EvaluatedAgent) -> Path:
    """File with the figures of an agent's stack."""
    return folder / f"{agent.label('figures')}.json"


def _evaluator(scenario: Scenario, agent: EvaluatedAgent, *, live: bool, figures: Path | None) -> NodePlan:
    asked = agent.evaluation.figures
    parameters = {
        "live": live,
        "evaluation": agent.evaluation.model_dump_json(),
        "figures": "" if figures is None else str(figures_file(figures, agent)),
        "asked_figures": "" if asked is None else str(Path(asked).resolve()),
        "input_topic": input_topic(agent),
        "outside_participants": list(scenario.participants),
        "patience_s": _STACK_PATIENCE_FRACTION * scenario.graph.silence_timeout_s,
    }
    of_agent = {"agent": agent.name} if agent.name else {}
    return NodePlan("evaluator", agent.label("evaluator"), {**parameters, **of_agent})
