"""What the layouts for RViz, Foxglove and PlotJuggler name exists in recorded scenes, with type, fields and QoS."""

import json
import re
from collections.abc import Iterator
from functools import lru_cache
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np
import pytest
import yaml
from display_topics import display_topics
from made_up_scene import made_up_spec
from rosbags.typesys import Stores, get_typestore
from scene_edits import with_ego

from simbev_ros.config.annotation import VectorMapPatch
from simbev_ros.config.load import load_scenario
from simbev_ros.recording.reader import SceneBag
from simbev_ros.ros.msgs.qos import qos_of
from simbev_ros.ros.msgs.topic import Topic
from simbev_ros.ros.msgs.topics import DIAGNOSTICS, manifest
from simbev_ros.schema.boxes import BOX_DTYPE
from simbev_ros.schema.points import POINT_DTYPE, RADAR_POINT_DTYPE, SEMANTIC_POINT_DTYPE
from simbev_ros.schema.scene.state import ACTOR_DTYPE
from simbev_ros.schema.voxels import VOXEL_DTYPE
from simbev_ros.show.foxglove.derived import derivations

CONFIG = Path(__file__).parents[3] / "config"
RVIZ = yaml.safe_load((CONFIG / "rviz" / "simbev.rviz").read_text(encoding="utf-8"))
FOXGLOVE = json.loads((CONFIG / "foxglove" / "simbev.json").read_text(encoding="utf-8"))
PLOTJUGGLER = ElementTree.parse(CONFIG / "plotjuggler" / "simbev.xml")
TYPES = get_typestore(Stores.ROS2_JAZZY)
RVIZ_TYPES = {
    "RobotModel": {"std_msgs/msg/String"},
    "Odometry": {"nav_msgs/msg/Odometry"},
    "Path": {"nav_msgs/msg/Path"},
    "PointCloud2": {"sensor_msgs/msg/PointCloud2"},
    "MarkerArray": {"visualization_msgs/msg/MarkerArray"},
    "Map": {"nav_msgs/msg/OccupancyGrid"},
    "Image": {"sensor_msgs/msg/Image", "sensor_msgs/msg/CompressedImage"},
}


def with_speed(dtype: Any) -> Any:
    """A table's columns and the one that is added for displays."""
    return np.dtype([*dtype.descr, ("speed", "<f4")])


SHOWN_IN_3D = {
    "sensor_msgs/msg/PointCloud2",
    "visualization_msgs/msg/MarkerArray",
    "nav_msgs/msg/Path",
    "std_msgs/msg/String",
}
COLUMNS = {
    "lidar/points": POINT_DTYPE,
    "lidar/semantic_points": SEMANTIC_POINT_DTYPE,
    "radar_*/points": RADAR_POINT_DTYPE,
    "occupancy/points": VOXEL_DTYPE,
    "boxes/points": BOX_DTYPE,
    "/world/actors/points": with_speed(ACTOR_DTYPE),
}


@lru_cache
def topics() -> dict[str, Topic]:
    """Topics that a graph with the paper's rig, and video, offers, by name."""
    rig = load_scenario("paper").rig
    filmed = [{**each.model_dump(), "video": "h264"} for each in rig.sensors if each.type == "camera"]
    plain = made_up_spec([sensor.model_dump() for sensor in rig.sensors])
    labels = plain.agents[0].annotation.model_copy(update={"vector_map": VectorMapPatch()})
    spec = with_ego(plain, annotation=labels)
    found = [topic for form in (True, False) for topic in manifest(spec, compressed_images=form)]
    found += [*manifest(made_up_spec(filmed), compressed_images=True), *display_topics(spec)]
    found += [Topic(DIAGNOSTICS, "diagnostic_msgs/msg/DiagnosticArray")]
    return {topic.name: topic for topic in found}


def displays() -> list[dict[str, Any]]:
    """RViz's displays that subscribe to a topic."""
    return [each for each in RVIZ["Visualization Manager"]["Displays"] if subscription(each) is not None]


def subscription(display: dict[str, Any]) -> dict[str, Any] | None:
    found: dict[str, Any] | None = display.get("Topic") or display.get("Description Topic")
    return found


def name_of(display: dict[str, Any]) -> str:
    chosen = subscription(display)
    assert chosen is not None
    return str(chosen["Value"])


def panels(kind: str) -> list[dict[str, Any]]:
    """Settings of Foxglove's panels of one kind."""
    return [settings for name, settings in FOXGLOVE["configById"].items() if name.startswith(f"{kind}!")]


def diagnostics() -> list[dict[str, Any]]:
    """Settings of Foxglove's panels for diagnostics."""
    return [*panels("DiagnosticSummary"), *panels("DiagnosticStatusPanel")]


def colored_clouds() -> Iterator[tuple[str, str]]:
    """Topics of clouds and the columns by which the layouts color them."""
    for display in displays():
        if "Channel Name" in display:
            yield name_of(display), display["Channel Name"]
    for panel in panels("3D"):
        yield from ((name, each["colorField"]) for name, each in panel["topics"].items() if "colorField" in each)


def message_paths() -> Iterator[tuple[str, list[str]]]:
    """Topics with the paths of the fields that are plotted or printed."""
    paths = [path["value"] for panel in panels("Plot") for path in panel["paths"]]
    paths += [panel["topicPath"] for panel in panels("RawMessages")]
    for path in paths:
        topic, *fields = path.split(".")
        yield topic, fields
    for curve in PLOTJUGGLER.iter("curve"):
        for path in (
            [curve.get(key) for key in ("curve_x", "curve_y")] if "curve_x" in curve.attrib else [curve.get("name")]
        ):
            assert path is not None
            topic = max((name for name in topics() if path.startswith(f"{name}/")), key=len)
            yield topic, path.removeprefix(f"{topic}/").split("/")


def named_topics() -> set[str]:
    """All topics in the layouts."""
    names = {name_of(display) for display in displays()} | {topic for topic, _ in message_paths()}
    for panel in panels("Image"):
        names |= {panel["imageMode"][key] for key in ("imageTopic", "calibrationTopic") if key in panel["imageMode"]}
        names |= panel["imageMode"].get("annotations", {}).keys()
    for panel in panels("3D"):
        names |= panel["topics"].keys()
    return (
        names | {panel["followTopic"] for panel in panels("map")} | {panel["topicToRender"] for panel in diagnostics()}
    )


def test_every_topic_exists_with_the_rig_of_the_paper() -> None:
    assert len(named_topics()) > 30
    assert named_topics() - topics().keys() == set()


def test_displays_and_panels_get_the_types_that_they_draw() -> None:
    for display in displays():
        assert topics()[name_of(display)].type in RVIZ_TYPES[display["Class"].rpartition("/")[2]], display["Name"]
    for panel in panels("3D"):
        assert {topics()[name].type for name in panel["topics"]} <= SHOWN_IN_3D
    for panel in panels("Image"):
        mode = panel["imageMode"]
        assert topics()[mode["imageTopic"]].type in {*RVIZ_TYPES["Image"], "foxglove_msgs/msg/CompressedVideo"}
        assert topics()[mode.get("calibrationTopic", "/ego/cam_front/camera_info")].type.endswith("CameraInfo")
        assert {topics()[name].type for name in mode.get("annotations", {})} <= {"visualization_msgs/msg/ImageMarker"}
    assert {topics()[panel["topicToRender"]].type for panel in diagnostics()} == {"diagnostic_msgs/msg/DiagnosticArray"}
    assert {topics()[panel["followTopic"]].type for panel in panels("map")} == {"sensor_msgs/msg/NavSatFix"}


def test_clouds_have_the_columns_by_which_they_are_colored() -> None:
    for topic, column in colored_clouds():
        pattern = re.sub(r"radar_\w+/", "radar_*/", topic.removeprefix("/ego/"))
        assert column in (COLUMNS[pattern].names or ()), topic


def test_plotted_and_printed_fields_exist() -> None:
    assert len(list(message_paths())) > 20
    for topic, fields in message_paths():
        kind = topics()[topic].type
        for number, field in enumerate(fields):
            members = dict(TYPES.fielddefs[kind][1])
            assert field in members, (topic, fields)
            kind = members[field][1] if number < len(fields) - 1 else kind


@pytest.mark.parametrize("live", [True, False])
def test_rviz_asks_for_no_more_than_publishers_offer(live: bool) -> None:
    for display in displays():
        asked, offered = subscription(display), qos_of(topics()[name_of(display)], live=live)
        assert asked is not None
        assert asked["Reliability Policy"] == "Best Effort" or offered.reliability == "reliable", display["Name"]
        assert asked["Durability Policy"] == "Volatile" or offered.durability == "transient_local", display["Name"]
        latched = offered.durability == "transient_local"
        assert (asked["Durability Policy"] == "Transient Local") == latched, "a late viewer gets what was sent before"


def test_all_panels_are_placed_once() -> None:
    def leaves(node: Any) -> Iterator[str]:
        if isinstance(node, str):
            yield node
            for tab in FOXGLOVE["configById"][node].get("tabs", []):
                yield from leaves(tab["layout"])
        else:
            yield from leaves(node["first"])
            yield from leaves(node["second"])

    placed = list(leaves(FOXGLOVE["layout"]))
    assert sorted(placed) == sorted(FOXGLOVE["configById"])


def test_a_recorded_scene_has_them_with_these_types_and_columns(recorded: Path) -> None:
    with SceneBag(recorded) as bag:
        found = {name: topic.type_name for name, topic in bag.topics.items()}
        shown = named_topics() & found.keys()
        made = {name: derived.type_name for name, derived in derivations(bag).items()}
        displays = named_topics() & made.keys()
        front = {name for name in named_topics() if "cam_front/" in name or "radar_front/" in name or "/lidar/" in name}
        others = {"/robot_description", "/ego/occupancy/points", "/ego/boxes/markers"}
        live_only = {name for name in front if name.endswith(("/image_raw", "/video"))}  # the bag has other forms
        assert front - live_only <= shown | displays and others <= shown
        assert {name: found[name] for name in shown} == {name: topics()[name].type for name in shown}
        assert {"/ego/path", "/ego/vector_map/markers", "/world/markers", "/ego/cam_front/boxes/markers"} <= displays
        assert {name: made[name] for name in displays} == {name: topics()[name].type for name in displays}
        for topic, column in colored_clouds():
            if topic in found:
                cloud = bag.decode(next(bag.messages([topic])))
                assert column in {field.name for field in cloud.fields}, topic
