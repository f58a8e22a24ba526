"""Which processes a graph has, with which nodes and parameters; nothing is looked up on the machine."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path

import yaml

from simbev_ros.config.camera import Camera
from simbev_ros.config.lidar import Lidar
from simbev_ros.config.positioning import Gnss, Imu
from simbev_ros.config.radar import Radar
from simbev_ros.config.scenario import Scenario
from simbev_ros.config.sensor import Sensor

_Parameters = Mapping[str, object]


@dataclass(frozen=True, slots=True)
class NodePlan:
    """One node: its kind, its name, its parameters."""

    kind: str
    name: str
    parameters: _Parameters


ProcessPlan = tuple[NodePlan, ...]
"""The nodes that share one process."""

_TOGETHER: tuple[Mapping[str, type[Sensor]], ...] = ({"lidar": Lidar, "radar": Radar}, {"gnss": Gnss, "imu": Imu})
"""Kinds of nodes that share a process. Radars take a tenth of a lidar's time, and the same meshes in memory."""


def planned_processes(
    scenario: Scenario, camera_processes: int, *, live: bool, dataset: Path | None
) -> list[ProcessPlan]:
    """Every process of the graph, the world first.

    Args:
        scenario: The configuration.
        camera_processes: How many share the rig's cameras, at most one for each.
        live: Paced by the wall clock.
        dataset: Where scenes are recorded; None: they are not.
    """
    behind = list(_processes_behind_world(scenario, camera_processes, live=live, dataset=dataset))
    names = [node.name for process in behind for node in process]
    state_readers = len([name for name in names if name != "recorder"]) + (dataset is not None)
    parameters = {
        "live": live,
        "recorded": dataset is not None,
        "participants": [*names, *scenario.graph.participants],
        "state_readers": state_readers,
        "window_ticks": scenario.graph.window_ticks,
    }
    return [(NodePlan("world", "world", parameters),), *behind]


def _processes_behind_world(
    scenario: Scenario, camera_processes: int, *, live: bool, dataset: Path | None
) -> Iterator[ProcessPlan]:
    chosen = scenario.recording.topics.model_dump(mode="json")
    patterns = {f"{name}_topics": list(words) for name, words in chosen.items() if words}
    common = {"live": live, "recorded": dataset is not None, "annotated": True, **patterns}
    compressed = scenario.recording.images == "compressed" and dataset is not None
    yield from _camera_processes(scenario, camera_processes, {**common, "compressed": compressed})
    for kinds in _TOGETHER:
        nodes = tuple(NodePlan(kind, kind, common) for kind, sensor in kinds.items() if scenario.rig.of_type(sensor))
        if nodes:
            yield nodes
    yield (NodePlan("annotator", "annotator", {**common, "annotated": False, "compressed": compressed}),)
    if dataset is not None:
        parameters = {
            "live": live,
            "dataset": str(dataset.resolve()),
            "config": yaml.safe_dump(scenario.model_dump(mode="json"), sort_keys=False),
            "recording": scenario.recording.model_dump_json(),
        }
        yield (NodePlan("recorder", "recorder", parameters),)


def _camera_processes(scenario: Scenario, processes: int, common: _Parameters) -> Iterator[ProcessPlan]:
    """The rig's cameras, dealt out to processes, and those to GPUs."""
    cameras = [camera.name for camera in scenario.rig.of_type(Camera)]
    for index in range(processes):
        parameters = {
            "sensors": cameras[index::processes],
            "jpeg_quality": scenario.recording.jpeg_quality,
            "quality": scenario.rendering.quality,
            "device": str(scenario.rendering.device_of(index)),
            "turn": index,
        }
        yield (NodePlan("camera", "camera" if processes == 1 else f"camera_{index}", {**common, **parameters}),)
