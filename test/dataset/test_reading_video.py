"""A bag with video reads like one with images: as the key of color images, in any order, and in exports."""

from pathlib import Path

import numpy as np
import pytest
import recorded_scene as written
from rosbags.highlevel import AnyReader

from simbev_ros.dataset import Scene
from simbev_ros.drawing.displays.messages import build, moment, serialize
from simbev_ros.export.sensor_data import recorded_jpeg
from simbev_ros.recording.bag_writer import SceneBagWriter
from simbev_ros.recording.image_codecs import decode_rgb
from simbev_ros.recording.mcap.chunk_cache import ChunkCache
from simbev_ros.recording.qos import QosProfile
from simbev_ros.recording.video import VIDEO_TYPE, VideoEncoder

WIDTH, HEIGHT, TICKS = 64, 48, 24
TOPIC, KEY = "/ego/cam_front/rgb/video", "cam_front/rgb"


def picture(tick: int) -> np.ndarray:
    rows, columns = np.mgrid[:HEIGHT, :WIDTH]
    return np.stack([3 * columns + tick, 4 * rows + tick, 200 - rows - tick], axis=2).astype(np.uint8)


@pytest.fixture(scope="module")
def path(tmp_path_factory: pytest.TempPathFactory) -> Path:
    scene, encoder = written.spec(), VideoEncoder(WIDTH, HEIGHT)
    with SceneBagWriter(tmp_path_factory.mktemp("bags") / "Blocks-0000", chunk_bytes=2000) as writer:
        writer.add_attachment("scene.json", "application/json", scene.model_dump_json().encode())
        writer.add_topic(TOPIC, VIDEO_TYPE, QosProfile(), separate_chunks=True)
        for tick in range(TICKS):
            stamp_ns, data = scene.start_ns + tick * scene.tick_ns, encoder.encode(picture(tick))
            fields = {"timestamp": moment(stamp_ns), "frame_id": "ego/cam_front_optical", "format": "h264"}
            writer.write(TOPIC, stamp_ns, serialize(build(VIDEO_TYPE, data=np.frombuffer(data, np.uint8), **fields)))
        return writer.finish({"complete": "true"})


@pytest.fixture
def scene(path: Path) -> Scene:
    return Scene(path, ChunkCache(1 << 20))


@pytest.mark.parametrize("ticks", [range(TICKS), (23, 0, 21, 7, 8)], ids=["in order", "anywhere"])
def test_images_of_a_video_have_the_key_of_color_images(scene: Scene, ticks: tuple[int, ...]) -> None:
    assert scene.keys == (KEY,)
    for tick in ticks:
        error = scene[tick][KEY].astype(int) - picture(tick)
        assert error.shape == (HEIGHT, WIDTH, 3) and np.abs(error).mean() < 3


def test_the_latest_image_of_a_video_is_found(scene: Scene) -> None:
    assert np.array_equal(scene[5].last(KEY), scene[5][KEY])
    assert scene[5].messages(KEY)[-1].format == "h264"


def test_exports_get_the_image_as_jpeg(scene: Scene) -> None:
    error = decode_rgb(recorded_jpeg(scene[9], KEY)).astype(int) - picture(9)
    assert np.abs(error).mean() < 4


def test_other_readers_know_the_type_from_the_bag(path: Path) -> None:
    with AnyReader([path]) as reader:
        (connection,) = reader.connections
        messages = [reader.deserialize(data, connection.msgtype) for _, _, data in reader.messages()]
    assert connection.msgtype == VIDEO_TYPE and len(messages) == TICKS
    assert bytes(messages[20].data[:5]) in (b"\0\0\0\1\x67", b"\0\0\1\x67\x64")
