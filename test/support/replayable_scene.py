"""Bags that can be replayed: scenes of three ticks in which little moves, recorded without a graph."""

from functools import cache
from pathlib import Path

import numpy as np
from ros_messages import point_cloud

from simbev_ros.config.load import load_scenario
from simbev_ros.maps.build import load_network
from simbev_ros.recording.bag_writer import SceneBagWriter
from simbev_ros.recording.layout import scene_folder
from simbev_ros.recording.qos import QosProfile
from simbev_ros.scene.drawing.draw_scene import draw_scene, planned_scenes
from simbev_ros.schema.scene.spec import SceneSpec
from simbev_ros.schema.scene.state import ACTOR_DTYPE, SIGNAL_DTYPE

TICKS = 3
_CLOUD = "sensor_msgs/msg/PointCloud2"


def replayable_scene(dataset: Path, number: int = 0, *, split: str = "train", roads: str | None = None) -> Path:
    """Record a scene on the map Blocks into a dataset.

    Args:
        dataset: The dataset's folder.
        number: Number of the scene.
        split: Its split.
        roads: What the bag says about the roads; None: the truth.

    Returns:
        The bag.
    """
    spec, true_roads = _first_of_demo()
    spec = spec.model_copy(update={"ticks": TICKS, "number": number, "split": split})
    with SceneBagWriter(scene_folder(dataset, split, spec.name)) as writer:
        writer.add_attachment("scene.json", "application/json", spec.model_dump_json().encode())
        writer.add_attachment("map.xodr", "application/xml", (roads or true_roads).encode())
        for name in ("/world/actors", "/world/signals"):
            writer.add_topic(name, _CLOUD, QosProfile())
        for stamp_ns in map(spec.stamp_ns, range(TICKS)):
            writer.write("/world/actors", stamp_ns, point_cloud(stamp_ns, np.zeros(2, ACTOR_DTYPE)))
            writer.write("/world/signals", stamp_ns, point_cloud(stamp_ns, np.zeros(1, SIGNAL_DTYPE)))
        writer.finish({"complete": "true"})
    return scene_folder(dataset, split, spec.name)


@cache
def _first_of_demo() -> tuple[SceneSpec, str]:
    """The first scene of the demo, and the roads of its map."""
    scenario = load_scenario("demo")
    planned = next(planned_scenes(scenario))
    network = load_network(planned.map)
    return draw_scene(scenario, planned, network), network.opendrive
