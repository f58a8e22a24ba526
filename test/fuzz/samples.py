"""Writes the valid samples of the corpus, small ones, from which inputs are mutated.

Run ``python test/fuzz/samples.py`` to write them again after a format has changed; other files of the corpus stay.
"""

import io
import json
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from index_files import write_index

sys.path += [str(Path(__file__).parents[1] / name) for name in ("support", "maps", "evaluation")]

import numpy as np
import prediction_bags
import prediction_data
import pyarrow as pa
import pyarrow.parquet as pq
import ros_messages
import xodr_sample as xodr
from lane_sample import LANE
from lanelet2_sample import LaneletSample, straight_lane
from made_up_scene import made_up_spec
from mcap.writer import CompressionType, Writer
from more_samples import served_samples, stored_samples
from recording_samples import recording_samples
from targets import KEY, MESSAGE_TYPES, STAMPS_NS, TARGETS

from simbev_ros.dataset.index import INDEX_FILE
from simbev_ros.dataset.index_row import index_row
from simbev_ros.dataset.plan import Plan, PlannedEntry
from simbev_ros.foundation.semantics import BEV_CLASSES
from simbev_ros.foundation.types import Table
from simbev_ros.maps.sumo.netconvert import sumo_home
from simbev_ros.recording.bag_metadata import to_yaml
from simbev_ros.recording.bag_writer import SceneBagWriter
from simbev_ros.recording.image_codecs import encode_image
from simbev_ros.recording.layout import METADATA_FILE, scene_folder
from simbev_ros.recording.lead_in import lead_in_attachment
from simbev_ros.recording.qos import QosProfile
from simbev_ros.recording.reader import RawMessage
from simbev_ros.ros.msgs.signing import Signer, signed_json
from simbev_ros.scene.ending import SceneEnd
from simbev_ros.scene.request import SceneRequest
from simbev_ros.schema.boxes import BOX_DTYPE
from simbev_ros.schema.scene.drive_spec import Command, DriveSpec, EventKind, EventSpec, RouteSpec
from simbev_ros.schema.scene.state import ACTOR_DTYPE, SIGNAL_DTYPE
from simbev_ros.schema.trajectories import TrackRecorder, tracks_to_npz
from simbev_ros.schema.views import VIEW_DTYPE
from simbev_ros.simulation.annotation.boxes.boxes import class_of_blueprint

Messages = list[tuple[str, str, int, bytes]]
"""Topic, type, stamp in ns, and content of each message."""

_SENSORS: list[dict[str, Any]] = [
    {"type": "camera", "name": "cam_front", "pose": {"z_m": 1.6}, "width_px": 32, "height_px": 24},
    {"type": "lidar", "name": "lidar"},
    {"type": "imu", "name": "imu"},
]
_SPEC = made_up_spec(_SENSORS, ticks=2)
_SCENE = _SPEC.model_dump_json().encode()
_DRIVE = DriveSpec(
    route=RouteSpec(
        **dict.fromkeys(("x_m", "y_m", "z_m", "distance_m", "limit_mps"), (0.0, 1.0)),
        lane=("a_0", "a_0"),
        command=(Command.FOLLOW, Command.LEFT),
    ),
    goal_radius_m=5.0,
    standstill_s=60.0,
    off_route_m=30.0,
    events=(EventSpec(kind=EventKind.CUT_IN, trigger_m=0.5, vehicles=(0,), parameters={"speed_mps": 3.0}),),
)
_IMAGE = np.arange(12, dtype=np.uint8).reshape(3, 4)
_ENTRY: prediction_bags.Entry = ("car", 0.5, (1, 2, 3), (4, 2, 1.5), (0, 0, 0.1, 0.995))
_EVENT = {"type": "collision", "tick": 2, "ids": [1, 7], "position_m": [1.0, 2.0, 0.5], "relative_speed_mps": 3.0}

_CONFIGURATION = """\
seed: 7
scenes:
  - {map: Blocks, train: 2, val: 1}
time: {tick_s: 0.05, warm_up_s: 4, duration_s: {uniform: [2, 4]}}
rig:
  defaults: {camera: {width_px: 320, height_px: 240}}
  sensors:
    - {type: camera, name: cam_front, pose: {x_m: 1.2, z_m: 1.6}, modalities: [rgb, depth]}
    - {type: lidar, name: lidar, pose: {z_m: 1.8}}
    - {type: imu, name: imu}
weather:
  cloudiness: {uniform: [10, 40]}
  sun_altitude_deg: 30
traffic: {vehicles: 7, pedestrians: {uniform: [1, 9]}}
annotation: {occupancy: {}, vector_map: {}}
"""
_AGENTS = """scenes: [{map: Blocks, train: 1}]
agents:
  - {name: ego, rig: {sensors: []}, frames: {odom: true}}
  - {name: car, rig: {sensors: [{type: imu, name: imu}]}, count: {integer: [0, 3]}, near: {distance_m: 30}}
  - {name: bus, rig: {sensors: []}, blueprint: vehicle.bus, spawn: [{x_m: 1, y_m: 2}], annotation: {box_radius_m: 9}}
"""

_ROUTES = """scenes: [{map: Blocks, train: 1}]
rig: {sensors: []}
ego: {driver: ackermann}
drive: {route: {Blocks: [{lane: a_0, s_m: 2}, {x_m: 1, y_m: 2}]}, goal_m: [20, 30], timeout_s: 9}
"""

_OSM = """\
<?xml version="1.0"?>
<osm version="0.6">
 <node id="1" lat="52.250" lon="7.500"/><node id="2" lat="52.251" lon="7.500"><tag k="highway" v="crossing"/></node>
 <node id="3" lat="52.252" lon="7.501"/><node id="4" lat="52.251" lon="7.503"><tag k="highway" v="stop"/></node>
 <node id="5" lat="52.2505" lon="7.5005"/><node id="6" lat="52.2505" lon="7.5008"/>
 <node id="7" lat="52.2507" lon="7.5008"/><node id="8" lat="52.2507" lon="7.5005"/>
 <way id="10"><nd ref="1"/><nd ref="2"/><nd ref="3"/><tag k="highway" v="secondary"/><tag k="lanes" v="2"/>
  <tag k="bridge" v="yes"/><tag k="layer" v="1"/><tag k="maxspeed" v="50"/></way>
 <way id="11"><nd ref="2"/><nd ref="4"/><tag k="highway" v="residential"/><tag k="oneway" v="yes"/></way>
 <way id="12"><nd ref="5"/><nd ref="6"/><nd ref="7"/><nd ref="8"/><nd ref="5"/><tag k="building" v="yes"/>
  <tag k="height" v="12.5 m"/></way>
 <way id="13"><nd ref="1"/><nd ref="5"/><nd ref="8"/><nd ref="1"/></way>
 <way id="14"><nd ref="3"/><nd ref="4"/><tag k="waterway" v="river"/><tag k="width" v="8"/></way>
 <relation id="20"><member type="way" ref="13" role="outer"/><member type="way" ref="12" role="inner"/>
  <tag k="type" v="multipolygon"/><tag k="landuse" v="forest"/></relation>
</osm>
"""


def samples() -> Iterator[tuple[str, str, bytes]]:
    """Yield target, name and content of each sample."""
    yield "configuration", "valid", _CONFIGURATION.encode()
    yield "configuration", "valid_agents", _AGENTS.encode()
    yield "configuration", "valid_drive", _ROUTES.encode()
    yield from (("opendrive", name, text.encode()) for name, text in _opendrive().items())
    yield "osm", "valid", _OSM.encode()
    yield "lanelet2", "valid", _lanelets().encode()
    yield "sumo", "valid", _net()
    yield "bag", "valid", _bag(_scene_messages(), CompressionType.NONE)
    yield "bag", "valid_compressed", _bag(_scene_messages(), CompressionType.ZSTD)
    yield "bag", "valid_cut_off", _bag(_scene_messages(), CompressionType.NONE)[:-1000]
    yield "prediction_bag", "valid", _bag(_prediction_messages(), CompressionType.NONE)
    yield "scene", "valid", _SCENE
    yield "scene", "valid_drive", _SPEC.model_copy(update={"drive": _DRIVE}).model_dump_json().encode()
    yield (
        "plan",
        "valid",
        Plan(scenes=(PlannedEntry(number=0, map="Blocks", split="train"),)).model_dump_json().encode(),
    )
    yield from _recorded()
    yield "trajectories", "valid", _tracks()
    yield "lead_in", "valid", lead_in_attachment([RawMessage("/clock", 5, "rosgraph_msgs/msg/Clock", bytes(12))])
    yield "jpeg", "valid", encode_image("rgb8", np.zeros((16, 16, 3), np.uint8))
    yield "png", "valid", encode_image("mono16", _IMAGE.astype(np.uint16))
    yield "depth", "valid", encode_image("32FC1", _IMAGE.astype(np.float32) + 1)
    yield "depth_rvl", "valid", encode_image("32FC1", _IMAGE.astype(np.float32) + 1, depth="rvl")
    yield "flow", "valid", encode_image("32FC2", np.stack([_IMAGE, _IMAGE], axis=2).astype(np.float32))
    yield from _predictions()
    yield from _messages()
    yield from served_samples(_SPEC)
    yield from stored_samples(_OSM)
    yield from recording_samples()


def _lanelets() -> str:
    """A road with a traffic light, a walkway, a crosswalk and a fork."""
    sample = LaneletSample()
    first, second = straight_lane(sample, [0.0, 40.0, 80.0], 0.0, 3.5)
    curb, edge = sample.line([(0.0, 0.0), (40.0, 0.0)]), sample.line([(0.0, -2.0), (40.0, -2.0)], "curbstone", "high")
    sample.lanelet(curb, edge, subtype="walkway")
    sample.lanelet(
        *(sample.line([(x, -1.0), (x, 5.0)], "pedestrian_marking", "") for x in (34.0, 37.0)), subtype="crosswalk"
    )
    fork = [[(40.0, y), (60.0, y - 1.0), (80.0, y - 6.0)] for y in (3.5, 0.0)]
    sample.lanelet(*(sample.line(points, "virtual", "") for points in fork))
    stop_line = sample.line([(39.0, 0.2), (39.0, 3.3)], "stop_line", "")
    light = sample.line([(42.0, 2.5, 5.0), (42.0, 1.5, 5.0)], "traffic_light", "red_yellow_green", height="0.8")
    rule = sample.rule("traffic_light", ("way", "refers", light), ("way", "ref_line", stop_line))
    sample.add_rule(first, rule)
    sample.add_rule(second, rule)
    return sample.text()


def _opendrive() -> dict[str, str]:
    turn = '<link><successor elementType="road" elementId="2" contactPoint="start"/></link>'
    objects = (
        '<objects><object id="1" type="crosswalk" s="50" t="0" zOffset="0" hdg="1.57" length="7" width="3"><outline>'
        '<cornerLocal u="-1.5" v="-3.5" z="0"/><cornerLocal u="1.5" v="-3.5" z="0"/>'
        '<cornerLocal u="1.5" v="3.5" z="0"/><cornerLocal u="-1.5" v="3.5" z="0"/></outline></object></objects>'
        '<signals><signal id="1" type="206" s="79" t="-5" orientation="+" dynamic="no"/>'
        '<signal id="2" type="1000001" s="95" t="-4" orientation="+" dynamic="yes" zOffset="3"/></signals>'
    )
    marks = '<roadMark sOffset="0" type="broken" color="white" width="0.15"/><speed sOffset="0" max="50" unit="km/h"/>'
    lanes = xodr.section(xodr.lane(1, inner=marks), xodr.lane(-1, inner=marks), xodr.lane(-2, "sidewalk"))
    heights = '<elevationProfile><elevation s="0" a="1" b="0.01" c="0" d="0"/></elevationProfile>'
    first = xodr.road(xodr.geometry(xodr.LINE, 100.0), 100.0, lanes, links=turn[6:-7], more=heights + objects)
    arc = xodr.geometry('<arc curvature="0.02"/>', 50.0, x=100.0)
    second = xodr.road(arc, 50.0, lanes, number="2")
    spiral = xodr.geometry('<spiral curvStart="0" curvEnd="0.05"/>', 40.0)
    cubic = xodr.geometry(
        '<paramPoly3 pRange="normalized" aU="0" bU="30" cU="0" dU="0" aV="0" bV="0" cV="3" dV="1"/>',
        31.0,
        s=40.0,
        x=38.0,
    )
    return {"valid": xodr.xodr(first, second), "valid_curves": xodr.xodr(xodr.road(spiral + cubic, 71.0, lanes))}


def _net() -> bytes:
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder, "a.net.xml")
        options = ["--grid", "--grid.number=2", "--no-internal-links", "-jtraffic_light", "--output-file", str(path)]
        command = [str(sumo_home() / "bin" / "netgenerate"), *options]
        subprocess.run(command, check=True, capture_output=True, env={"SUMO_HOME": str(sumo_home())})
        text = path.read_text()
    return text[text.index("<net ") :].encode()


def _bag(messages: Messages, compression: CompressionType) -> bytes:
    """An MCAP file without checksums, so that mutations are not refused because of them."""
    stream = io.BytesIO()
    writer = Writer(stream, chunk_size=1500, compression=compression, enable_crcs=False, enable_data_crcs=False)
    writer.start()
    writer.add_attachment(0, 0, "scene.json", "application/json", _SCENE)
    channels: dict[str, int] = {}
    for topic, kind, stamp_ns, data in messages:
        if topic not in channels:
            schema = writer.register_schema(kind, "ros2msg", b"")
            qos = "- reliability: reliable\n  durability: volatile\n  history: keep_last\n  depth: 7\n"
            channels[topic] = writer.register_channel(topic, "cdr", schema, {"offered_qos_profiles": qos})
        writer.add_message(channels[topic], stamp_ns, data, stamp_ns)
    counts = json.dumps({topic: sum(each[0] == topic for each in messages) for topic in channels})
    facts = {"complete": "true", "ended": "duration", "expected": counts, "recorded": counts, "ticks": "2"}
    writer.add_metadata("rosbag2", {"serialized_metadata": to_yaml({"version": 9, "custom_data": facts})})
    writer.finish()
    return stream.getvalue()


def _actors() -> Table:
    actors = np.zeros(2, ACTOR_DTYPE)
    actors["id"], actors["x"] = [1, 2], 3.5
    return actors


def _scene_messages() -> Messages:
    messages: Messages = []
    for tick in range(_SPEC.ticks):
        stamp_ns = _SPEC.stamp_ns(tick)
        event = {
            "type": "collision",
            "stamp_ns": stamp_ns,
            "tick": tick,
            "ids": [1, 2],
            "position_m": [1, 2, 3],
            "relative_speed_mps": 4.5,
        }
        turn = np.array([0, 0, 0.1])
        contents = {
            "/world/actors": ("sensor_msgs/msg/PointCloud2", ros_messages.point_cloud(stamp_ns, _actors())),
            "/world/signals": (
                "sensor_msgs/msg/PointCloud2",
                ros_messages.point_cloud(stamp_ns, np.zeros(1, SIGNAL_DTYPE)),
            ),
            "/world/events": ("std_msgs/msg/String", ros_messages.string(json.dumps(event))),
            "/ego/odom": ("nav_msgs/msg/Odometry", ros_messages.odometry(stamp_ns, np.array([tick, 2, 0.5]), turn)),
            "/ego/cam_front/rgb/image_raw": ("sensor_msgs/msg/Image", ros_messages.image(stamp_ns, "mono8", _IMAGE)),
        }
        messages += [(topic, kind, stamp_ns, data) for topic, (kind, data) in contents.items()]
    return messages


def _prediction_messages() -> Messages:
    types, messages = prediction_bags.TYPES, list[tuple[str, int, Any]]()
    for stamp_ns in STAMPS_NS[:2].tolist():
        head = prediction_bags.header(stamp_ns)
        messages.append(("/prediction/boxes", stamp_ns, prediction_bags.markers([_ENTRY], head)))
        grid = prediction_bags.occupancy(np.zeros((2, 3), np.int8), stamp_ns)
        messages.append((f"/prediction/bev/{BEV_CLASSES[0]}", stamp_ns, grid))
    return [
        (topic, each.__msgtype__, stamp_ns, bytes(types.serialize_cdr(each, each.__msgtype__)))
        for topic, stamp_ns, each in messages
    ]


def _recorded() -> Iterator[tuple[str, str, bytes]]:
    """Yield the description of a recorded bag, and the index of its dataset."""
    with tempfile.TemporaryDirectory() as folder:
        path = scene_folder(Path(folder), _SPEC.split, _SPEC.name)
        with SceneBagWriter(path) as writer:
            writer.add_attachment("scene.json", "application/json", _SCENE)
            for topic, kind, stamp_ns, data in _scene_messages():
                if stamp_ns == _SPEC.start_ns:
                    writer.add_topic(topic, kind, QosProfile())
                writer.write(topic, stamp_ns, data)
            writer.finish({"complete": "true", "ticks": "2", "expected": '{"/ego/odom": 2}'})
        yield "bag_description", "valid", (path / METADATA_FILE).read_bytes()
        write_index(Path(folder), [index_row(path, Path(folder))])
        yield "index", "valid", (Path(folder) / INDEX_FILE).read_bytes()


def _tracks() -> bytes:
    recorder = TrackRecorder(_SPEC.tick_ns, class_of_blueprint())
    for tick in range(3):
        recorder.add_frame(_SPEC.stamp_ns(tick), _actors())
    return tracks_to_npz(recorder.tracks())


def _predictions() -> Iterator[tuple[str, str, bytes]]:
    columns = prediction_data.some_columns()
    stream = io.BytesIO()
    np.savez(stream, **columns)  # type: ignore[arg-type]
    yield "boxes_npz", "valid", stream.getvalue()
    stream = io.BytesIO()
    numbered = {**columns, "class": np.array([1, 0, -1]), "score": np.array([0.5, 1, np.nan]), "id": np.arange(3) - 1}
    numbered["stamp_ns"] = STAMPS_NS[numbered.pop("tick")]
    del numbered["scene"]
    np.savez(stream, frame_id=np.array("ego/lidar"), **numbered)  # type: ignore[arg-type]
    yield "boxes_npz", "valid_numbers", stream.getvalue()
    table = pa.table({**{name: pa.array(values.tolist()) for name, values in columns.items()}, "id": [5, None, 7]})
    for name, options in {"valid": {}, "valid_plain": {"use_dictionary": False, "compression": "none"}}.items():
        stream = io.BytesIO()
        pq.write_table(table, stream, row_group_size=2, **options)
        yield "boxes_parquet", name, stream.getvalue()
    stream = io.BytesIO()
    np.savez(stream, scores=np.full((2, 3, 4), 0.5, np.float32), classes=np.array(BEV_CLASSES[:2]))
    yield "grid_npz", "valid", stream.getvalue()


def _messages() -> Iterator[tuple[str, str, bytes]]:
    stamp_ns, types = int(STAMPS_NS[2]), prediction_bags.TYPES
    head = prediction_bags.header(stamp_ns)
    signer = Signer(KEY)
    weather = {"stamp_ns": stamp_ns, **_SPEC.weather.model_dump()}
    end = SceneEnd(scene=_SPEC.name, tick=1, reason="duration", events=2)
    report_text = f"camera:{_SPEC.name}"
    report = prediction_bags.header(stamp_ns, f"{report_text}:{signer.sign(f'{report_text}:{stamp_ns}')}")
    boxes = np.zeros(1, [*prediction_bags.TABLE_DTYPE.descr, ("id", "<i4")])
    messages = {
        "boxes_cloud": prediction_bags.table_message(boxes, stamp_ns),
        "boxes_markers": prediction_bags.markers([_ENTRY], head),
        "scores_image": prediction_bags.image(np.zeros((2, 3, len(BEV_CLASSES)), np.float32), stamp_ns),
        "scores_occupancy": prediction_bags.occupancy(np.zeros((2, 3), np.int8), stamp_ns),
        "report": report,
    }
    serialized = {name: bytes(types.serialize_cdr(each, each.__msgtype__)) for name, each in messages.items()}
    serialized |= {
        "actors": ros_messages.point_cloud(stamp_ns, _actors()),
        "signals": ros_messages.point_cloud(stamp_ns, np.zeros(2, SIGNAL_DTYPE)),
        "weather": ros_messages.string(json.dumps(weather)),
        "request": ros_messages.string(signed_json(SceneRequest(spec=_SPEC, number=1), signer)),
        "end": ros_messages.string(signed_json(end, signer)),
        "drawn_boxes": ros_messages.point_cloud(stamp_ns, np.zeros(2, BOX_DTYPE)),
        "typed_views": ros_messages.point_cloud(stamp_ns, np.zeros(2, VIEW_DTYPE)),
        "typed_lane": json.dumps(LANE).encode(),
        "typed_event": json.dumps(_EVENT).encode(),
    }
    yield from ((name, "valid", data) for name, data in serialized.items())
    by_type = {each.__msgtype__: serialized[name] for name, each in messages.items()}
    by_type |= {"std_msgs/msg/String": serialized["weather"], "nav_msgs/msg/Odometry": _scene_messages()[3][3]}
    for number, type_name in enumerate(MESSAGE_TYPES):
        if type_name in by_type:
            yield "canonical_cdr", f"valid_{type_name.rpartition('/')[2]}", bytes([number]) + by_type[type_name]


if __name__ == "__main__":
    for target, name, data in samples():
        file = TARGETS[target].folder / name
        file.parent.mkdir(parents=True, exist_ok=True)
        file.write_bytes(data)
