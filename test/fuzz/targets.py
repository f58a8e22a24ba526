"""All readers of foreign bytes, each as a function that takes bytes and raises only what its reader documents.

A target writes the bytes to where its reader expects them, reads everything, and checks what was read against the
promises of the reader. Anything else than the documented errors is a fault.
"""

import tempfile
from collections.abc import Callable
from functools import cache, partial
from pathlib import Path
from random import Random
from typing import Any
from unittest import mock

import mutation
import numpy as np
from made_up_scene import SENSORS, made_up_spec
from rclpy.serialization import deserialize_message
from recording_targets import RECORDING_TARGETS
from ros_messages import string
from scenario_targets import SCENARIO_TARGETS
from served_targets import SERVED_TARGETS
from stored_targets import STORED_TARGETS
from target import CORPUS, Target, folder, write_file

from simbev_ros.config.evaluation import BOXES_TOPIC, GRIDS_TOPIC
from simbev_ros.config.load import load_scenario
from simbev_ros.dataset.content import Content, SceneBags, sources_by_topic
from simbev_ros.dataset.index import INDEX_FILE, read_index
from simbev_ros.dataset.plan import PLAN_FILE, Plan
from simbev_ros.evaluation.predictions.prediction_bag import PredictionBag
from simbev_ros.evaluation.predictions.prediction_files import NpzBoxes, ParquetBoxes
from simbev_ros.evaluation.predictions.prediction_messages import image_scores, message_boxes, occupancy_scores
from simbev_ros.evaluation.predictions.score_grid import ScoreGrid, read_grid
from simbev_ros.foundation.errors import BagError, InputError, SimulationError
from simbev_ros.foundation.files.limits import MAX_SCENE_TICKS
from simbev_ros.foundation.semantics import BEV_CLASSES, BOX_CLASSES
from simbev_ros.maps.lanelet2.importer import import_lanelet2
from simbev_ros.maps.opendrive.importer import import_opendrive
from simbev_ros.maps.osm.importer import import_osm
from simbev_ros.maps.sumo.importer import import_sumo
from simbev_ros.recording.canonical import canonical_cdr
from simbev_ros.recording.description import describe_bag
from simbev_ros.recording.image_codecs import decode_image
from simbev_ros.recording.indexed_bag import IndexedBag
from simbev_ros.recording.layout import SCENE_ATTACHMENT
from simbev_ros.recording.lead_in import lead_in_messages
from simbev_ros.recording.mcap.chunk_cache import ChunkCache
from simbev_ros.recording.reader import SceneBag, attached_spec
from simbev_ros.recording.repair import repair_bag
from simbev_ros.recording.verify import verify_bag
from simbev_ros.ros.msgs.message_types import message_class
from simbev_ros.ros.msgs.signing import Signer, content_of, signed_json
from simbev_ros.ros.msgs.stamps import serialized_stamp_ns
from simbev_ros.ros.msgs.typed_topics import TypedTopic, typed_topics
from simbev_ros.ros.msgs.world import actors_from_message, signals_from_message, weather_from_message
from simbev_ros.ros.nodes.reports import read_report
from simbev_ros.scene.ending import SceneEnd
from simbev_ros.scene.request import SceneRequest
from simbev_ros.schema.messages.message_types import types_with
from simbev_ros.schema.scene.agents import agent_view
from simbev_ros.schema.scene.spec import SceneSpec
from simbev_ros.schema.trajectories import futures, tracks_from_npz
from simbev_ros.simulation.replay.replay import Replay, recorded_spec

STAMPS_NS = 3_600_050_000_000 + 50_000_000 * np.arange(4)
"""Stamps of the frames that predictions are for."""
KEY = "key"
"""Key of the signed samples."""

_BAG = "Blocks-0000_0.mcap"
_CACHE_BYTES = 1 << 20


def _read_configuration(data: bytes) -> None:
    scenario = load_scenario(write_file("configuration.yaml", data))
    assert type(scenario).model_validate(scenario.model_dump()) == scenario


def _import_map(suffix: str, read: Callable[[Path, Path], Any], data: bytes) -> None:
    """Import a map up to the point where netconvert, another process, would take over."""
    stop = SimulationError("netconvert is not run")
    with (
        tempfile.TemporaryDirectory(dir=folder()) as work,
        mock.patch("simbev_ros.maps.sumo.netconvert.run_netconvert", side_effect=stop) as netconvert,
    ):
        try:
            read(write_file(f"map{suffix}", data), Path(work))
        except InputError:
            if not netconvert.called:
                raise


def _read_bag(data: bytes) -> None:
    path = write_file(f"bag/{_BAG}", data)
    describe_bag(path, digest=True)
    with SceneBag(path) as bag:
        for message in bag.messages():
            bag.decode(message)


def _read_bag_by_index(data: bytes) -> None:
    bag = IndexedBag(write_file(f"bag/{_BAG}", data), ChunkCache(_CACHE_BYTES))
    for topic in bag.topics.values():
        assert (np.diff(topic.stamps_ns) >= 0).all()
    for source in sources_by_topic(bag, None).values():
        for location in source.topic.locations:
            source.value(location[None])
    bags = SceneBags.open(bag.file, {}, ChunkCache(_CACHE_BYTES), may_be_cut_off=True)
    content = Content.from_bags(bags, agent_view(bags.spec))
    assert len(content.stamps_ns) <= MAX_SCENE_TICKS


def _verify_bag(data: bytes) -> None:
    path = write_file(f"bag/{_BAG}", data)
    if not verify_bag(path):
        with SceneBag(path) as bag:  # a bag without faults can be read
            assert all(bag.decode(message) is not None for message in bag.messages())


def _repair_bag(data: bytes) -> None:
    path = write_file(f"bag/{_BAG}", data)
    with tempfile.TemporaryDirectory(dir=folder()) as work:
        repaired = repair_bag(path, Path(work, "repaired"))
        with SceneBag(repaired.path) as bag:
            assert sum(repaired.counts.values()) == sum(1 for _ in bag.messages()) > 0


def _replay_bag(data: bytes) -> None:
    path = write_file(f"bag/{_BAG}", data)
    with SceneBag(path) as bag:
        spec = recorded_spec(bag)
    replay = Replay(spec, path)
    try:
        for tick in range(min(spec.warm_up_ticks + replay.available[0], 10)):
            assert replay.step().tick == tick - spec.warm_up_ticks
    finally:
        replay.close()


def _read_prediction_bag(data: bytes) -> None:
    bag = PredictionBag(write_file(f"predictions/{_BAG}", data), ChunkCache(_CACHE_BYTES), BOXES_TOPIC, GRIDS_TOPIC)
    for scene in bag.scenes:
        boxes, ticks = bag.boxes(scene, STAMPS_NS)
        assert set(boxes.predictions.boxes.frame.tolist()) <= ticks <= set(range(len(STAMPS_NS)))
        for tick in bag.grid_ticks(scene, STAMPS_NS):
            bag.grid(scene, tick, STAMPS_NS)


def _read_description(data: bytes) -> None:
    """Read the description beside an intact bag."""
    bag = write_file(f"described/{_BAG}", _intact_bag()).parent
    write_file("described/metadata.yaml", data)
    verify_bag(bag)
    with tempfile.TemporaryDirectory(dir=folder()) as work:
        repair_bag(bag, Path(work, "repaired"))


@cache
def _intact_bag() -> bytes:
    return (CORPUS / "bag" / "valid").read_bytes()


def _read_index(data: bytes) -> None:
    for row in read_index(write_file(f"dataset/{INDEX_FILE}", data).parent):
        assert 0 <= row["recorded_ticks"] <= MAX_SCENE_TICKS


def _read_plan(data: bytes) -> None:
    plan = Plan.load(write_file(f"dataset/{PLAN_FILE}", data).parent)
    assert Plan.model_validate_json(plan.model_dump_json()) == plan
    numbers = [entry.number for entry in plan.scenes]
    assert numbers == sorted(numbers)


def _read_scene(data: bytes) -> None:
    spec = attached_spec({SCENE_ATTACHMENT: data}, Path("bag"))
    assert spec is not None
    assert SceneSpec.model_validate_json(spec.model_dump_json()) == spec
    assert spec.tick_of(spec.stamp_ns(spec.loaded_tick)) == spec.loaded_tick
    assert spec.weather_at(spec.ticks) == (spec.final_weather or spec.weather)


def _read_tracks(data: bytes) -> None:
    tracks = tracks_from_npz(data)
    ids = tracks.id[:2]
    found = futures(tracks, ids, np.full(len(ids), tracks.stamp_ns[0] if len(tracks.stamp_ns) else 0), step_s=None)
    assert found.position_m.shape == (len(ids), len(found.after_s), 3)


def _read_lead_in(data: bytes) -> None:
    for message in lead_in_messages(data):
        assert (type(message.topic), type(message.type_name)) == (str, str)


def _decode_image(image_format: str, data: bytes) -> None:
    assert decode_image(image_format, data).size > 0


def _read_boxes(kind: type[NpzBoxes] | type[ParquetBoxes], suffix: str, data: bytes) -> None:
    source = kind(write_file(f"boxes{suffix}", data))
    for scene in source.scenes:
        boxes, ticks = source.boxes(scene, STAMPS_NS)
        own = boxes.predictions.boxes
        assert len(own.frame) == len(own.label) == len(own.center_m) == len(own.velocity_mps) == len(boxes)
        assert np.isfinite(own.center_m).all() and (own.label < len(BOX_CLASSES)).all()
        assert set(own.frame.tolist()) <= ticks <= set(range(len(STAMPS_NS)))


def _read_grid(data: bytes) -> None:
    grid = read_grid(write_file("grid.npz", data))
    assert grid.scores.shape[0] == len(grid.classes)


def _message(type_name: str, data: bytes) -> Any | None:
    """The message in CDR, as a node gets it; None if the middleware would drop it."""
    try:
        payload = canonical_cdr(data, type_name)
        return deserialize_message(bytes(payload), message_class(type_name))
    except (ValueError, RuntimeError):  # the target "canonical_cdr" looks into these
        return None


def _on_message(type_name: str, read: Callable[[Any], None]) -> Callable[[bytes], None]:
    """A target that reads a serialized message."""

    def read_message(data: bytes) -> None:
        message = _message(type_name, data)
        if message is None:
            raise ValueError("no message")
        read(message)

    return read_message


def _read_actors(message: Any) -> None:
    actors = actors_from_message(message)
    assert np.isfinite(actors["x"]).all() and (np.diff(actors["id"].astype(np.int64)) > 0).all()


def _read_signed(kind: type[SceneRequest] | type[SceneEnd], message: Any) -> None:
    content = content_of(kind, message.data, Signer(KEY))
    assert content_of(kind, signed_json(content, Signer(KEY)), Signer(KEY)) == content


def _read_report(message: Any) -> None:
    report = read_report(message, Signer(KEY), ["outside"])
    assert report.node and report.scene


def _read_predicted_boxes(type_name: str, message: Any) -> None:
    boxes = message_boxes(type_name, message, 2, "topic").predictions.boxes
    assert np.isfinite(boxes.center_m).all() and (boxes.frame == 2).all()


def _read_image_scores(message: Any) -> None:
    assert ScoreGrid(BEV_CLASSES, image_scores(message, "topic"), "topic").scores.ndim == 3


def _read_occupancy_scores(message: Any) -> None:
    assert ScoreGrid(BEV_CLASSES[:1], occupancy_scores(message, "topic")[None], "topic").scores.ndim == 3


def _canonicalize(data: bytes) -> None:
    """The first byte chooses the type of the message, whose bytes follow."""
    type_name = MESSAGE_TYPES[data[0] % len(MESSAGE_TYPES)] if data else MESSAGE_TYPES[0]
    payload = bytes(canonical_cdr(data[1:], type_name))
    assert bytes(canonical_cdr(payload, type_name)) == payload
    stamp_ns = serialized_stamp_ns(payload, type_name)
    assert stamp_ns is None or type(stamp_ns) is int


@cache
def _typed_topics() -> dict[str, TypedTopic]:
    """Typed topics by the names of their sources."""
    return {each.source.name: each for each in typed_topics(made_up_spec(SENSORS))}


def _convert(source: str, data: bytes) -> None:
    """Make a typed message of the bytes of a table, or of the text of a record."""
    topic = _typed_topics()[source]
    if topic.source.type == _STRING:
        data = string(data.decode(errors="replace"))
    made, types = topic.convert(data, int(STAMPS_NS[0])), types_with(topic.topic.type)
    message = types.deserialize_cdr(made, topic.topic.type)
    assert bytes(types.serialize_cdr(message, topic.topic.type)) == made


MESSAGE_TYPES = (
    "sensor_msgs/msg/Image",
    "sensor_msgs/msg/PointCloud2",
    "std_msgs/msg/String",
    "nav_msgs/msg/Odometry",
    "visualization_msgs/msg/MarkerArray",
    "nav_msgs/msg/OccupancyGrid",
)


def _mutate_canonical(sample: bytes, rng: Random) -> bytes:
    return sample[:1] + mutation.mutate_bytes(sample[1:], rng)


_INPUT, _BAG_ERROR, _VALUE = (InputError,), (BagError,), (ValueError,)
_CLOUD, _STRING = "sensor_msgs/msg/PointCloud2", "std_msgs/msg/String"
_MARKERS = "visualization_msgs/msg/MarkerArray"
_MESSAGE = (InputError, ValueError)
_TARGETS = (
    Target("configuration", _read_configuration, _INPUT, mutation.mutate_yaml, examples=15),
    Target("opendrive", partial(_import_map, ".xodr", import_opendrive), _INPUT, mutation.mutate_xml, examples=40),
    Target("osm", partial(_import_map, ".osm", import_osm), _INPUT, mutation.mutate_xml, examples=40),
    Target("lanelet2", partial(_import_map, ".osm", import_lanelet2), _INPUT, mutation.mutate_xml, examples=15),
    Target("sumo", partial(_import_map, ".net.xml", import_sumo), _INPUT, mutation.mutate_xml, examples=80),
    Target("bag", _read_bag, _BAG_ERROR),
    Target("bag_by_index", _read_bag_by_index, _BAG_ERROR, corpus="bag"),
    Target("bag_verify", _verify_bag, (), corpus="bag"),
    Target("bag_repair", _repair_bag, _BAG_ERROR, corpus="bag", examples=40),
    Target("bag_replay", _replay_bag, _BAG_ERROR, corpus="bag"),
    Target("bag_description", _read_description, (), mutation.mutate_yaml, examples=12),
    Target("prediction_bag", _read_prediction_bag, _INPUT),
    Target("index", _read_index, _INPUT),
    Target("plan", _read_plan, _INPUT, mutation.mutate_json),
    Target("scene", _read_scene, _BAG_ERROR, mutation.mutate_json),
    Target("trajectories", _read_tracks, _BAG_ERROR, mutation.mutate_npz),
    Target("lead_in", _read_lead_in, _BAG_ERROR, mutation.mutate_json),
    Target("jpeg", partial(_decode_image, "rgb8; jpeg compressed bgr8"), _BAG_ERROR),
    Target("png", partial(_decode_image, "mono16; png compressed"), _BAG_ERROR, mutation.mutate_png),
    Target("depth", partial(_decode_image, "32FC1; compressedDepth png"), _BAG_ERROR, mutation.mutate_png),
    Target("depth_rvl", partial(_decode_image, "32FC1; compressedDepth rvl"), _BAG_ERROR),
    Target("flow", partial(_decode_image, "rgb16; png compressed bgr16"), _BAG_ERROR, mutation.mutate_png),
    Target("boxes_npz", partial(_read_boxes, NpzBoxes, ".npz"), _INPUT, mutation.mutate_npz, examples=100),
    Target("boxes_parquet", partial(_read_boxes, ParquetBoxes, ".parquet"), _INPUT),
    Target("grid_npz", _read_grid, _INPUT, mutation.mutate_npz),
    Target("actors", _on_message(_CLOUD, _read_actors), _VALUE),
    Target("signals", _on_message(_CLOUD, lambda message: signals_from_message(message)), _VALUE),
    Target("weather", _on_message(_STRING, lambda message: weather_from_message(message)), _VALUE),
    Target("request", _on_message(_STRING, partial(_read_signed, SceneRequest)), _VALUE),
    Target("end", _on_message(_STRING, partial(_read_signed, SceneEnd)), _VALUE),
    Target("report", _on_message("std_msgs/msg/Header", _read_report), _VALUE),
    Target("boxes_cloud", _on_message(_CLOUD, partial(_read_predicted_boxes, _CLOUD)), _MESSAGE),
    Target("boxes_markers", _on_message(_MARKERS, partial(_read_predicted_boxes, _MARKERS)), _MESSAGE),
    Target("scores_image", _on_message("sensor_msgs/msg/Image", _read_image_scores), _MESSAGE),
    Target("scores_occupancy", _on_message("nav_msgs/msg/OccupancyGrid", _read_occupancy_scores), _MESSAGE),
    Target("typed_views", partial(_convert, "/ego/cam_front/boxes"), _VALUE),
    Target("typed_lane", partial(_convert, "/ego/hd_map"), _VALUE, mutation.mutate_json),
    Target("typed_event", partial(_convert, "/world/events"), _VALUE, mutation.mutate_json),
    Target("canonical_cdr", _canonicalize, _VALUE, _mutate_canonical),
)
_OTHERS = (*SERVED_TARGETS, *STORED_TARGETS, *RECORDING_TARGETS, *SCENARIO_TARGETS)
TARGETS = {target.name: target for target in (*_TARGETS, *_OTHERS)}
