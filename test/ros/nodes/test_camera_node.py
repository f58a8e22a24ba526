"""The camera node requests the right images from a fake renderer and publishes the right topics."""

from collections.abc import Iterator
from threading import Event
from typing import Any

import pytest
from fake_cameras import play, set_readers, started_camera_node, state_at
from rclpy.experimental.events_executor import EventsExecutor
from rclpy.serialization import deserialize_message
from sensor_msgs.msg import CameraInfo, CompressedImage, Image
from waiting import PATIENCE_S

from simbev_ros.config.scenario import Scenario
from simbev_ros.dataset.values import decode_message
from simbev_ros.foundation.errors import InputError
from simbev_ros.maps.build import load_network
from simbev_ros.recording.video import VIDEO_TYPE, is_key_frame
from simbev_ros.ros.msgs import message_types
from simbev_ros.ros.nodes import camera_node
from simbev_ros.scene.drawing.draw_scene import draw_scene, planned_scenes
from simbev_ros.schema.scene.spec import SceneSpec

FAST = "/ego/fast/rgb/image_raw/compressed"
RAW = "/ego/fast/rgb/image_raw"
VIDEO = "/ego/fast/rgb/video"
SLOW = "/ego/slow/flow/image_raw"


@pytest.fixture(scope="module")
def spec() -> SceneSpec:
    camera = {"type": "camera", "height_px": 16, "modalities": ["rgb", "semantic", "flow"]}
    fast, slow = {**camera, "name": "fast", "width_px": 16}, {**camera, "name": "slow", "width_px": 32, "rate_hz": 10}
    scenario = Scenario.model_validate(
        {"scenes": [{"map": "Blocks", "train": 1}], "rig": {"sensors": [slow, fast]}, "traffic": {"vehicles": 0}}
    )
    planned = next(planned_scenes(scenario))
    return draw_scene(scenario, planned, load_network(planned.map))


@pytest.fixture
def node(spec: SceneSpec, monkeypatch: pytest.MonkeyPatch) -> Iterator[Any]:
    """A camera node that has started a scene and collects what it publishes in ``sent``."""
    with started_camera_node(spec, monkeypatch) as made:
        yield made


def test_only_images_with_readers_are_drawn_and_flow_refers_to_the_cameras_own_previous_frame(
    node: Any, spec: SceneSpec, monkeypatch: pytest.MonkeyPatch
) -> None:
    set_readers(node, monkeypatch, FAST, SLOW)
    assert play(node, spec, range(4)).requests == [
        (16, ("rgb",), 0, None),
        (32, ("flow",), 0, None),
        (16, ("rgb",), 1, 0),
        (16, ("rgb",), 2, 1),
        (32, ("flow",), 2, 0),
        (16, ("rgb",), 3, 2),
    ]
    images = [(name, type(message)) for name, message in node.sent if isinstance(message, Image | CompressedImage)]
    first_two_ticks = [(FAST, CompressedImage), (SLOW, Image), (FAST, CompressedImage)]
    assert images == first_two_ticks * 2


def test_without_readers_nothing_is_drawn_but_camera_info_is_published(
    node: Any, spec: SceneSpec, monkeypatch: pytest.MonkeyPatch
) -> None:
    set_readers(node, monkeypatch)
    assert play(node, spec, [0, 1]).requests == []
    infos = [f"/ego/fast/{part}camera_info" for part in ("rgb/", "semantic/", "flow/", "")]
    assert [name for name, _ in node.sent if "fast" in name] == infos * 2
    set_readers(node, monkeypatch, SLOW)
    assert play(node, spec, [2]).requests == [(32, ("flow",), 2, 0)], (
        "its previous frame counts although it had no reader"
    )


def test_modalities_share_the_camera_info_of_their_camera(
    node: Any, spec: SceneSpec, monkeypatch: pytest.MonkeyPatch
) -> None:
    set_readers(node, monkeypatch)
    play(node, spec, [0])
    infos = {name: deserialize_message(message, CameraInfo) for name, message in node.sent}
    for camera, width_px in ("fast", 16), ("slow", 32):
        shared = infos[f"/ego/{camera}/camera_info"]
        assert (shared.width, shared.header.frame_id) == (width_px, f"ego/{camera}_optical")
        assert all(infos[f"/ego/{camera}/{each}/camera_info"] == shared for each in ("rgb", "semantic", "flow"))


@pytest.mark.parametrize("forms", [("",), ("", "/compressed"), ("/compressed",)])
def test_a_picture_is_made_in_the_forms_that_have_readers(
    node: Any, spec: SceneSpec, monkeypatch: pytest.MonkeyPatch, forms: tuple[str, ...]
) -> None:
    names = [f"/ego/fast/semantic/color{form}" for form in forms]
    set_readers(node, monkeypatch, *names)
    assert play(node, spec, [0]).requests == [(16, ("semantic",), 0, None)]
    pictures = [(name, message) for name, message in node.sent if not name.endswith("camera_info")]
    assert [name for name, _ in pictures] == names
    for name, message in pictures:
        kind = CompressedImage if name.endswith("/compressed") else Image
        assert deserialize_message(message, kind).header.frame_id == "ego/fast_optical"


def test_of_the_lead_in_only_the_image_that_the_first_flow_refers_to_is_drawn(
    node: Any, spec: SceneSpec, monkeypatch: pytest.MonkeyPatch
) -> None:
    set_readers(node, monkeypatch, FAST, SLOW)
    assert play(node, spec, range(-4, 1)).requests == [
        (32, ("flow",), -2, -4),
        (16, ("rgb",), 0, -1),
        (32, ("flow",), 0, -2),
    ]
    assert all(message.header.stamp.nanosec == 0 for _, message in node.sent if isinstance(message, Image))


def test_live_images_of_the_lead_in_are_drawn_but_not_published(
    spec: SceneSpec, monkeypatch: pytest.MonkeyPatch
) -> None:
    with started_camera_node(spec, monkeypatch, "-p", "live:=true") as node:
        set_readers(node, monkeypatch, FAST)
        assert play(node, spec, [-1]).requests == [(16, ("rgb",), -1, None)]
        assert node.sent == []


def test_a_frame_is_encoded_while_the_next_one_is_drawn_and_sent_in_order(
    node: Any, executor: EventsExecutor, spec: SceneSpec, monkeypatch: pytest.MonkeyPatch
) -> None:
    set_readers(node, monkeypatch, FAST)
    may_encode, renderer = Event(), node._surroundings.built

    def encode(*_: object) -> bytes:
        may_encode.wait(PATIENCE_S)
        return b"made up"

    monkeypatch.setattr(camera_node, "encode_image", encode)
    for tick in (-1, 0, 1):
        state = state_at(spec, tick)
        node.process(spec, state)
        if tick == 1:
            assert [tick for *_, tick, _ in renderer.requests] == [0, 1] and node.reported == [-1]
            may_encode.set()
        node.finish(spec, state)
    assert node.reported[:2] == [-1, 0]
    while len(node.reported) < 3:  # the last frame is sent without another tick
        executor.spin_once(timeout_sec=5.0)
    assert node.reported == [-1, 0, 1]
    stamps_s = [message.header.stamp.nanosec for name, message in node.sent if name == FAST]
    assert stamps_s == sorted(stamps_s) and len(stamps_s) == 2


def test_an_image_that_cannot_be_encoded_ends_the_process(
    node: Any, executor: EventsExecutor, spec: SceneSpec, monkeypatch: pytest.MonkeyPatch
) -> None:
    set_readers(node, monkeypatch, FAST)

    def fail(*_: object) -> bytes:
        raise ValueError("made up")

    monkeypatch.setattr(camera_node, "encode_image", fail)
    state = state_at(spec, 0)
    node.process(spec, state)
    with pytest.raises(ValueError, match="made up"):
        node.finish(spec, state)
        for _ in range(20):
            executor.spin_once(timeout_sec=0.1)
            node.raise_failure()


def test_topics_follow_image_transport(node: Any) -> None:
    assert FAST in node.recorded_topics
    names = dict(node.get_topic_names_and_types())
    assert names["/ego/slow/flow/image_raw"] == ["sensor_msgs/msg/Image"]
    assert names["/ego/slow/flow/image_raw/compressed"] == ["sensor_msgs/msg/CompressedImage"]


def test_instances_that_only_an_annotator_reads_are_drawn_at_ticks_with_labels(
    spec: SceneSpec, monkeypatch: pytest.MonkeyPatch
) -> None:
    data = spec.model_dump(mode="json")
    camera = {"type": "camera", "name": "fast", "height_px": 16, "width_px": 16, "modalities": ["rgb", "instance"]}
    data["agents"][0] |= {"rig": {"sensors": [camera]}, "annotation": {"rate_hz": 10}}
    labeled = SceneSpec.model_validate(data)
    ids = "/ego/fast/instance/image_raw"
    with started_camera_node(labeled, monkeypatch, "-p", "annotated:=true", "-p", "compressed:=false") as node:
        node._on_scene(labeled.model_dump_json(), b"")
        set_readers(node, monkeypatch, ids)
        assert [tick for *_, tick, _ in play(node, labeled, range(4)).requests] == [0, 2]
        set_readers(node, monkeypatch, ids, RAW)
        requests = play(node, labeled, range(4, 6)).requests[2:]
        assert [modalities for _, modalities, *_ in requests] == [("rgb", "instance"), ("rgb",)]
        monkeypatch.setattr(node, "reader_count", lambda name: 2 * (name == ids))
        assert [tick for *_, tick, _ in play(node, labeled, range(6, 8)).requests[4:]] == [6, 7], "a recorder reads too"


@pytest.fixture
def filmed(spec: SceneSpec) -> SceneSpec:
    """The same scene with a video of the fast camera."""
    content = spec.model_dump(mode="json")
    (fast,) = (each for each in content["agents"][0]["rig"]["sensors"] if each["name"] == "fast")
    fast["video"] = "h264"
    return SceneSpec.model_validate(content)


def test_a_video_has_a_message_of_each_image_while_it_has_readers(
    filmed: SceneSpec, monkeypatch: pytest.MonkeyPatch
) -> None:
    pytest.importorskip("foxglove_msgs")
    with started_camera_node(filmed, monkeypatch) as node:
        set_readers(node, monkeypatch, VIDEO)
        assert play(node, filmed, range(3)).requests == [
            (16, ("rgb",), tick, tick - 1 if tick else None) for tick in range(3)
        ]
        sent = [message for name, message in node.sent if name == VIDEO]
        set_readers(node, monkeypatch, FAST)
        play(node, filmed, [3])
    assert len(sent) == 3 and [name for name, _ in node.sent].count(VIDEO) == 3
    messages = [decode_message(VIDEO_TYPE, memoryview(each)) for each in sent]
    assert [is_key_frame(bytes(each.data)) for each in messages] == [True, False, False]
    assert [(each.format, each.frame_id) for each in messages] == [("h264", "ego/fast_optical")] * 3
    stamps_ns = [each.timestamp.sec * 10**9 + each.timestamp.nanosec for each in messages]
    assert stamps_ns == [filmed.stamp_ns(tick) for tick in range(3)]


def test_a_video_without_its_message_package_is_refused_with_the_remedy(
    filmed: SceneSpec, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(message_types, "is_installed", lambda name: name != VIDEO_TYPE)
    with (
        pytest.raises(InputError, match=r"^fast: video needs foxglove_msgs, which `simbev doctor --fix` makes"),
        started_camera_node(filmed, monkeypatch),
    ):
        pass
