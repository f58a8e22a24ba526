"""Typed topics: each message says what the table or the JSON of its source says, with angles in radians."""

import json
import math
from typing import Any

import numpy as np
import pytest
from lane_sample import LANE
from made_up_scene import SENSORS, made_up_spec, noise
from ros_messages import point_cloud, string

from simbev_ros.config.weather import WEATHER_PARAMETERS
from simbev_ros.foundation.types import Table
from simbev_ros.ros.msgs import topics
from simbev_ros.ros.msgs.annotation_topics import annotation_topics
from simbev_ros.ros.msgs.typed_records import serialize_event
from simbev_ros.ros.msgs.typed_topics import TypedTopic, radar_scans, typed_topics
from simbev_ros.ros.msgs.world import event_record
from simbev_ros.schema.boxes import BOX_DTYPE
from simbev_ros.schema.messages.message_types import types_with
from simbev_ros.schema.messages.table_messages import RADAR_SCAN, table_of
from simbev_ros.schema.points import RADAR_TARGET_DTYPE
from simbev_ros.schema.scene.agents import agent_view
from simbev_ros.schema.scene.hazard import HazardKind, HazardSpec
from simbev_ros.schema.scene.spec import SceneSpec
from simbev_ros.schema.scene.state import ACTOR_DTYPE, SIGNAL_DTYPE, Event, WorldState
from simbev_ros.schema.views import VIEW_DTYPE

STAMP_NS = 3_604_050_000_000
FRONT = "/ego/cam_front/boxes"
TABLES = {"/world/actors": ACTOR_DTYPE, "/world/signals": SIGNAL_DTYPE, "/ego/boxes": BOX_DTYPE, FRONT: VIEW_DTYPE}
EVENT = Event("collision", (1, 70_000), (3.0, 4.0, 0.5), 2.25)


@pytest.fixture
def spec() -> SceneSpec:
    return made_up_spec(SENSORS)


def typed(spec: SceneSpec, source: str) -> TypedTopic:
    (found,) = (each for each in typed_topics(spec) if each.source.name == source)
    return found


def decoded(topic: TypedTopic, payload: bytes, stamp_ns: int = STAMP_NS) -> Any:
    """The message that a topic makes of one of its source, as rosbags reads it."""
    type_name = topic.topic.type
    made = topic.convert(payload, stamp_ns)
    message = types_with(type_name).deserialize_cdr(made, type_name)
    assert bytes(types_with(type_name).serialize_cdr(message, type_name)) == made
    assert message.header.stamp.sec * 10**9 + message.header.stamp.nanosec == stamp_ns
    return message


def test_a_typed_topic_has_the_rate_and_quality_of_its_source(spec: SceneSpec) -> None:
    known = {topic.name: topic for topic in topics.manifest(spec, compressed_images=True)}
    for each in typed_topics(spec):
        assert known[each.source.name] == each.source
        assert each.topic.name == f"{each.source.name}/typed"
        same = ("period_ticks", "sensor", "sporadic", "messages_per_tick")
        assert [getattr(each.topic, name) for name in same] == [getattr(each.source, name) for name in same]


def test_every_table_and_record_of_the_world_and_of_the_labels_has_one(spec: SceneSpec) -> None:
    world = {topics.SCENE, topics.ACTORS, topics.SIGNALS, topics.WEATHER, topics.EVENTS}
    labels = annotation_topics(agent_view(spec))
    wanted = world | {labels.boxes.name, labels.hd_map.name, *(topic.name for topic in labels.views.values())}
    assert {each.source.name for each in typed_topics(spec)} == wanted
    assert len(labels.views) == 2


@pytest.mark.parametrize("name", TABLES)
def test_rows_are_those_of_the_table_to_the_bit(spec: SceneSpec, name: str) -> None:
    table, topic = noise(np.random.default_rng(1), TABLES[name], 5), typed(spec, name)
    message = decoded(topic, point_cloud(STAMP_NS, table))
    assert table_of(topic.topic.type, message).tobytes() == table.tobytes()
    assert message.header.frame_id == ("ego/cam_front_optical" if name == FRONT else "map")


def test_weather_is_that_of_the_record_with_the_sun_in_radians(spec: SceneSpec) -> None:
    weather = spec.weather.model_copy(update={"sun_altitude_deg": -30.0, "fog_distance_m": 7.5, "wetness": 12.0})
    payload = string(json.dumps({"stamp_ns": STAMP_NS, **weather.model_dump()}))
    message = decoded(typed(spec, "/world/weather"), payload)
    assert message.sun_azimuth == math.radians(weather.sun_azimuth_deg)
    assert message.sun_altitude == pytest.approx(-math.pi / 6)
    assert (message.fog_distance, message.wetness, message.header.frame_id) == (7.5, 12.0, "map")
    same = {name for name, row in WEATHER_PARAMETERS.items() if row.typed and row.unit in ("", "%")}
    assert {name: getattr(message, name) for name in same} == {name: getattr(weather, name) for name in same}


def test_an_event_is_that_of_the_record(spec: SceneSpec) -> None:
    nothing: Table = np.zeros(0, ACTOR_DTYPE)
    state = WorldState(STAMP_NS, 1, 1, nothing, np.zeros(0, SIGNAL_DTYPE), spec.weather, (EVENT,))
    record = event_record(EVENT, state)
    topic = typed(spec, "/world/events")
    message = decoded(topic, string(json.dumps(record)))
    position = message.position
    assert (message.type, message.tick, message.ids.tolist()) == ("collision", 1, [1, 70_000])
    assert (position.x, position.y, position.z, message.relative_speed) == (3.0, 4.0, 0.5, 2.25)
    assert topic.serialize(record, STAMP_NS) == serialize_event(record, STAMP_NS)


def test_a_lane_is_that_of_the_record_with_angles_in_radians(spec: SceneSpec) -> None:
    message = decoded(typed(spec, "/ego/hd_map"), string(json.dumps(LANE)))
    same = ("id", "s", "road_id", "section_id", "lane_id", "lane_type", "lane_width", "is_junction", "junction_id")
    assert {name: getattr(message, name) for name in same} == {name: LANE[name] for name in same}
    assert (message.x, message.y, message.z) == (1.0, -2.0, 0.5)
    assert (message.roll, message.pitch, message.yaw) == tuple(map(math.radians, (1.0, -2.0, 90.0)))
    assert (message.lane_change_left, message.lane_change_right) == (False, True)
    left, right = message.left_lane_marking, message.right_lane_marking
    assert (left.type, left.color, left.width, left.lane_change_left) == ("Solid", "Yellow", 0.12, False)
    assert (right.type, right.lane_change_left, right.lane_change_right) == ("SolidBroken", True, False)
    assert message.left_lane.id == ""
    assert (message.right_lane.id, message.right_lane.lane_id) == ("7/0/-2", -2)
    assert message.right_lane.lane_type == "Shoulder"


def test_a_lane_outside_junctions_has_an_empty_junction(spec: SceneSpec) -> None:
    record = {**LANE, "is_junction": False, "junction_id": None, "lane_change": "Both"}
    message = decoded(typed(spec, "/ego/hd_map"), string(json.dumps(record)))
    assert (message.junction_id, message.lane_change_left, message.lane_change_right) == ("", True, True)


def test_a_scene_names_the_facts_and_holds_the_whole_specification(spec: SceneSpec) -> None:
    later = spec.weather.model_copy(update={"cloudiness": 90.0})
    accident = HazardSpec(kind=HazardKind.ACCIDENT, outline_m=((0, 0), (1, 0), (0, 1)))
    changes = {"number": 5, "final_weather": later, "ticks": 21, "seed": 2**40, "hazards": (accident,)}
    spec = spec.model_copy(update=changes)
    text = spec.model_dump_json()
    message = decoded(typed(spec, "/world/scene"), string(text), spec.start_ns)
    assert (message.name, message.number, message.seed, message.map) == ("Blocks-0005", 5, 2**40, "Blocks")
    assert (message.tick_ns, message.ticks, message.warm_up_ticks) == (50_000_000, 21, 1)
    assert (message.duration.sec, message.duration.nanosec) == (1, 50_000_000)
    assert message.start == message.header.stamp
    assert (message.agent, message.ego_blueprint, message.ego_driver) == ("ego", "vehicle.sedan", "traffic")
    assert (message.vehicles, message.pedestrians, message.accidents, message.work_zones) == (2, 0, 1, 0)
    assert message.sensors == [sensor["name"] for sensor in SENSORS]
    assert (message.weather.cloudiness, message.final_weather.cloudiness) == (spec.weather.cloudiness, 90.0)
    assert message.final_weather.header.stamp.sec == message.start.sec + 1
    assert message.json == text


@pytest.mark.parametrize(
    ("name", "payload"),
    [
        ("/world/actors", point_cloud(STAMP_NS, np.zeros(2, SIGNAL_DTYPE))),
        ("/world/actors", point_cloud(STAMP_NS, np.zeros(2, ACTOR_DTYPE))[:40]),
        ("/ego/boxes", string("{}")[:6]),
        ("/world/weather", string("{}")),
        ("/world/weather", string("[]")),
        ("/world/weather", string("no JSON")),
        ("/world/events", string('{"type": "collision", "tick": 1, "ids": [-1], "position_m": [1, 2, 3]}')),
        ("/world/events", string('{"type": 7, "tick": 1, "ids": [1], "position_m": [1], "relative_speed_mps": 1}')),
        ("/ego/hd_map", string(json.dumps({**LANE, "lane_change": "Up"}))),
        ("/ego/hd_map", string(json.dumps({**LANE, "lane_id": "a"}))),
        ("/ego/hd_map", string(json.dumps({**LANE, "lane_id": 2**40}))),
        ("/ego/hd_map", string(json.dumps({**LANE, "left_lane": {"more": 1}}))),
        ("/world/scene", string("{}")),
    ],
    ids=range(13),
)
def test_malformed_content_raises_value_errors(spec: SceneSpec, name: str, payload: bytes) -> None:
    with pytest.raises(ValueError):
        typed(spec, name).convert(payload, STAMP_NS)


def test_a_radar_that_asks_for_it_has_its_detections_as_a_radar_scan() -> None:
    spec = made_up_spec(
        [{"type": "radar", "name": "front", "rate_hz": 10, "scan": True}, {"type": "radar", "name": "rear"}]
    )
    [scan] = radar_scans(spec)
    assert scan.topic in [each.topic for each in typed_topics(spec)]
    topic = scan.topic
    assert (topic.name, topic.type, topic.period_ticks, topic.sensor) == ("/ego/front/scan", RADAR_SCAN, 2, True)
    cloud = noise(np.random.default_rng(1), RADAR_TARGET_DTYPE, 5)
    message = decoded(scan, point_cloud(STAMP_NS, cloud))
    assert message.header.frame_id == "ego/front"
    rows = table_of(RADAR_SCAN, message)
    assert rows.dtype.names == ("range", "azimuth", "elevation", "doppler_velocity", "amplitude")
    for name in rows.dtype.names:
        assert np.array_equal(rows[name], cloud[name])


def test_a_cloud_without_detections_is_a_scan_without_returns() -> None:
    [scan] = radar_scans(made_up_spec([{"type": "radar", "name": "front", "scan": True}]))
    assert len(decoded(scan, point_cloud(STAMP_NS, np.zeros(0, RADAR_TARGET_DTYPE))).returns) == 0
