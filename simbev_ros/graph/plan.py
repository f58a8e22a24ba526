"""Plans the processes of a graph: which nodes run in which process, and with which parameters.

The plan follows from the configuration and from numbers of cores and camera processes; the machine is not inspected.
What is recorded does not depend on it.
"""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path

from simbev_ros.config.camera import Camera
from simbev_ros.config.evaluation import Evaluation
from simbev_ros.config.lidar import Lidar
from simbev_ros.config.radar import Radar
from simbev_ros.config.rendering import Rendering
from simbev_ros.config.rig import SENSOR_KINDS, Rig
from simbev_ros.config.scenario import Scenario
from simbev_ros.graph.evaluated_stack import input_topic
from simbev_ros.msgs.annotation_topics import Label, bev_labels_name, boxes_name, viewing_cameras
from simbev_ros.nodes.ros.names import NodeName

_Parameters = Mapping[str, object]


@dataclass(frozen=True, slots=True)
class NodePlan:
    """A node of the graph: its kind, its name, its ROS parameters, and the agent that it belongs to, if any."""

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

_RAY_CASTING = (Lidar, Radar)
"""Sensors whose nodes can share a process: radars need a tenth of a lidar's time and the same meshes in memory."""
_MANY_CORES = 8
"""Number of cores from which on time counts more than memory."""
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
) -> list[ProcessPlan]:
    """Plan every process of the graph, the world first.

    Args:
        scenario: The configuration.
        camera_processes: Number of processes that share the rig's cameras, at most one for each camera.
        live: Whether the world is paced by the wall clock.
        dataset: Folder into which scenes are recorded; None: they are not recorded.
        figures: File for the evaluator's figures, if there is an evaluator.
        rendering: How cameras render; None: as configured.
        cores: Number of CPU cores; with few of them, more nodes share a process.
    """
    drawing = {"rendering": (rendering or scenario.rendering).model_dump_json()}
    behind = list(_processes_behind_world(scenario, camera_processes, drawing, live=live, dataset=dataset, cores=cores))
    state_readers = sum(map(len, behind))
    if scenario.evaluation is not None:
        behind.append((_evaluator(scenario, scenario.evaluation, live=live, figures=figures),))
    names = [node.name for process in behind for node in process]
    parameters = {
        "live": live,
        "recorded": dataset is not None,
        "participants": [*names, *scenario.participants],
        "outside_participants": list(scenario.participants),
        "state_readers": state_readers,
        "window_ticks": _window_ticks(scenario, cores),
    }
    return [(NodePlan("world", "world", parameters),), *behind]


def _window_ticks(scenario: Scenario, cores: int) -> int:
    """Maximum lead of the world over the slowest node: a long one keeps many cores busy, a short one reacts soon."""
    if scenario.graph.window_ticks != "auto":
        return scenario.graph.window_ticks
    is_closed = not scenario.participants and scenario.ego.driver != "twist"
    return 8 if is_closed and cores >= _MANY_CORES else 3


def _processes_behind_world(
    scenario: Scenario, camera_processes: int, drawing: _Parameters, *, live: bool, dataset: Path | None, cores: int
) -> Iterator[ProcessPlan]:
    chosen = scenario.recording.topics.model_dump(mode="json")
    patterns = {f"{name}_topics": list(words) for name, words in chosen.items() if words}
    pace = {"live": live, "reliable": live and scenario.graph.live_reliability == "reliable"}
    common: dict[str, object] = {**pace, "recorded": dataset is not None, "annotated": True, **patterns}
    if scenario.evaluation is not None:
        agent, read = scenario.rig.agent, input_topic(scenario.rig, scenario.evaluation)
        common["evaluated_topics"] = [boxes_name(agent), bev_labels_name(agent), read]
    compressed = scenario.recording.images == "compressed" and dataset is not None
    yield from _camera_processes(scenario, camera_processes, {**common, **drawing, "compressed": compressed})
    yield from _sensor_processes(scenario.rig, common, cores)
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
    """Distribute the rig's cameras among processes, and the processes among GPUs."""
    cameras = [camera.name for camera in scenario.rig.of_type(Camera)]
    for index in range(processes):
        parameters = {
            "sensors": cameras[index::processes],
            "recording": scenario.recording.model_dump_json(),
            "process": index,
        }
        name = "camera" if processes == 1 else f"camera_{index}"
        yield (NodePlan("camera", name, {**common, **parameters}, scenario.rig.agent),)


def _sensor_processes(rig: Rig, common: _Parameters, cores: int) -> Iterator[ProcessPlan]:
    """Plan the nodes of all other sensors: light-weight ones share a process; with few cores ray casting ones, too."""
    kinds = {kind: model for kind, model in SENSOR_KINDS.items() if model is not Camera and rig.of_type(model)}
    casting = [kind for kind, model in kinds.items() if model in _RAY_CASTING]
    light = [kind for kind in kinds if kind not in casting]
    apart = [casting] if cores < _MANY_CORES else [[kind] for kind in casting]
    for together in (*apart, light):
        if together:
            yield tuple(NodePlan(kind, kind, common, rig.agent) for kind in together)


def _annotator_processes(scenario: Scenario, parameters: _Parameters, cores: int) -> Iterator[ProcessPlan]:
    """Plan one annotator, or with many cores several that share the labels."""
    shares = next(shares for least, shares in _ANNOTATORS if cores >= least)
    for labels in shares:
        if labels == (Label.VIEWS,) and not viewing_cameras(scenario.rig, scenario.annotation):
            continue
        name = "annotator" if len(shares) == 1 else f"annotator_{labels[0]}"
        is_read = Label.VIEWS in labels and Label.BOXES not in labels
        own = {"scope": [label.value for label in labels], "annotated": is_read}
        yield (NodePlan("annotator", name, {**parameters, **own}, scenario.rig.agent),)


def _evaluator(scenario: Scenario, evaluation: Evaluation, *, live: bool, figures: Path | None) -> NodePlan:
    asked = evaluation.figures
    parameters = {
        "live": live,
        "evaluation": evaluation.model_dump_json(),
        "figures": "" if figures is None else str(figures),
        "asked_figures": "" if asked is None else str(Path(asked).resolve()),
        "input_topic": input_topic(scenario.rig, evaluation),
        "patience_s": _STACK_PATIENCE_FRACTION * scenario.graph.silence_timeout_s,
    }
    return NodePlan("evaluator", "evaluator", parameters)
