"""What the pages on Autoware and Nav2 say of our topics is so: types, QoS, layouts and remapping rules."""

import re
from dataclasses import dataclass

import numpy as np
import pytest
from guide_tables import ROOT, commands, page, quoted, rows
from made_up_scene import made_up_spec
from rosbags.typesys import Stores, get_typestore

from simbev_ros.config.load import load_scenario
from simbev_ros.config.rig import Rig
from simbev_ros.foundation.types import Table
from simbev_ros.ros.msgs.qos import qos_of
from simbev_ros.ros.msgs.sensor_topics import camera_topics
from simbev_ros.ros.msgs.tables import message_from_table
from simbev_ros.ros.msgs.topic import Topic
from simbev_ros.ros.msgs.topics import manifest
from simbev_ros.ros.relays.autoware_points import AUTOWARE_POINT_DTYPE
from simbev_ros.schema.points import POINT_DTYPE
from simbev_ros.schema.scene.agents import agent_view

COMMON = get_typestore(Stores.ROS2_JAZZY).types
STACKS = {"autoware": "Autoware", "nav2": "Nav2"}
RELAYED = {
    "/sensing/vehicle_velocity_converter/twist_with_covariance",
    "/sensing/lidar/top/pointcloud_raw_ex",
    "/map",
    *(
        f"/vehicle/status/{name}_status"
        for name in ("velocity", "steering", "gear", "turn_indicators", "hazard_lights")
    ),
    "/vehicle/status/control_mode",
    "/perception/object_recognition/objects",
    "/perception/object_recognition/tracking/objects",
    "/perception/traffic_light_recognition/traffic_signals",
    "/initialpose3d",
}
FIELD_TYPES = {1: "INT8", 2: "UINT8", 3: "INT16", 4: "UINT16", 5: "INT32", 6: "UINT32", 7: "FLOAT32", 8: "FLOAT64"}


@dataclass(frozen=True)
class Input:
    """A row of a page's table: their topic, its type, how they subscribe, and ours, "relay" or None."""

    topic: str
    type: str
    subscribes: str
    ours: str | None


def inputs(stack: str) -> list[Input]:
    found = []
    for topic, kind, subscribes, ours, _ in rows(page(stack), f"{STACKS[stack]}'s topic"):
        name, type_name = quoted(topic), quoted(kind)
        assert name is not None and type_name is not None
        found.append(Input(name, type_name, subscribes, "relay" if ours == "relay" else quoted(ours)))
    return found


def outputs(stack: str) -> dict[str | None, str]:
    """Topics that they send and we read: our names and theirs."""
    table = rows(page(stack), f"{STACKS[stack]} sends") if f"| {STACKS[stack]} sends |" in page(stack) else ()
    return {quoted(ours): str(quoted(topic)) for topic, _, ours, _ in table}


INPUTS = [pytest.param(stack, row, id=f"{stack}{row.topic}") for stack in STACKS for row in inputs(stack)]
SERVED = [each for each in INPUTS if str(each.values[1].ours).startswith("/")]


def offered(stack: str) -> dict[str, Topic]:
    """Topics of the stack's configuration by name, raw and compressed."""
    rig: Rig = load_scenario(ROOT / "config" / stack / "simbev.yaml").rig
    spec = made_up_spec([sensor.model_dump() for sensor in rig.sensors])
    topics = [topic for form in (True, False) for topic in manifest(spec, compressed_images=form)]
    return {topic.name: topic for topic in topics}


def rules(stack: str) -> dict[str, str]:
    """Remapping rules of the stack's file and of the page's first command: our names and theirs."""
    first = next(line for line in commands(page(stack)) if line.startswith("./simbev run"))
    text = (ROOT / "config" / stack / "remap.args").read_text() + first
    return dict(re.findall(r"-r (\S+):=(\S+)", text))


@pytest.mark.parametrize(("stack", "row"), SERVED)
def test_served_topics_have_the_type_that_is_read(stack: str, row: Input) -> None:
    assert offered(stack)[str(row.ours)].type == row.type


@pytest.mark.parametrize(("stack", "row"), SERVED)
def test_their_subscriptions_hear_our_publishers(stack: str, row: Input) -> None:
    reliable = load_scenario(ROOT / "config" / stack / "simbev.yaml").graph.live_reliability == "reliable"
    profile = qos_of(offered(stack)[str(row.ours)], live=True, reliable=reliable)
    assert profile.reliability == "reliable" or not row.subscribes.startswith("reliable")
    assert profile.durability == "transient_local" or "latched" not in row.subscribes


@pytest.mark.parametrize(("stack", "row"), INPUTS)
def test_what_is_not_served_is_explained(stack: str, row: Input) -> None:
    (remark,) = [cells[4] for cells in rows(page(stack), f"{STACKS[stack]}'s topic") if quoted(cells[0]) == row.topic]
    assert row.ours is not None or remark
    if "not in common_interfaces" in remark:
        assert row.type not in COMMON


@pytest.mark.parametrize("stack", STACKS)
def test_relayed_topics_are_those_of_the_relays(stack: str) -> None:
    relayed = {row.topic for row in inputs(stack) if row.ours == "relay"}
    assert relayed and relayed <= RELAYED


@pytest.mark.parametrize("stack", STACKS)
def test_inputs_with_another_name_are_remapped_and_nothing_else_is(stack: str) -> None:
    pairs = {row.ours: row.topic for row in inputs(stack)} | outputs(stack)
    assert rules(stack) == {ours: theirs for ours, theirs in pairs.items() if ours not in (None, "relay", theirs)}


def test_images_are_remapped_with_the_camera_info_beside_them() -> None:
    mapped = rules("autoware")
    spec = made_up_spec(
        [sensor.model_dump() for sensor in load_scenario(ROOT / "config/autoware/simbev.yaml").rig.sensors]
    )
    (camera,) = (sensor for sensor in spec.agents[0].rig.sensors if sensor.type == "camera")
    image = mapped[camera_topics(agent_view(spec), camera)["rgb"].raw.name]
    assert mapped[f"/ego/{camera.name}/camera_info"] == f"{image.rpartition('/')[0]}/camera_info"


def layouts() -> dict[str, tuple[int, list[tuple[str, int, str]]]]:
    """Point step and fields of each layout on the page."""
    found = {}
    for name, step, fields in rows(page("autoware"), "layout"):
        parsed = re.findall(r"`(\w+)` (\d+) (\w+)", fields)
        found[name] = int(step), [(field, int(offset), kind) for field, offset, kind in parsed]
    return found


def layout_of(table: Table) -> tuple[int, list[tuple[str, int, str]]]:
    message = message_from_table(table, 0, "lidar")
    return message.point_step, [(field.name, field.offset, FIELD_TYPES[field.datatype]) for field in message.fields]


def test_the_layouts_on_the_page_are_those_of_our_messages() -> None:
    assert layouts()["ours"] == layout_of(np.zeros(1, POINT_DTYPE))
    assert layouts()["PointXYZIRCAEDT"] == layout_of(np.zeros(1, AUTOWARE_POINT_DTYPE))


@pytest.mark.parametrize(("long", "short"), [("ours", "PointXYZI"), ("PointXYZIRCAEDT", "PointXYZIRC")])
def test_longer_layouts_begin_with_the_shorter_ones(long: str, short: str) -> None:
    fields = layouts()[short][1]
    assert layouts()[long][1][: len(fields)] == fields


def test_our_layout_is_not_one_that_autoware_asks_for() -> None:
    ours = layouts()["ours"][1]
    assert all(ours[: len(layouts()[name][1])] != layouts()[name][1] for name in ("PointXYZIRC", "PointXYZIRCAEDT"))
