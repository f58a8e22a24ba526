"""Frames of a dataset, compared with what was written and with what rosbags reads."""

import pickle
import shutil
from collections import Counter
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
import recorded_scene as written
from index_files import write_index
from rosbags.highlevel import AnyReader

from simbev_ros.dataset import Dataset, Frame, Scene, columns, open_dataset
from simbev_ros.dataset.index_row import index_row
from simbev_ros.foundation.errors import BagError, InputError
from simbev_ros.foundation.types import AnyArray
from simbev_ros.recording.mcap import chunk_cache


@pytest.fixture(scope="module")
def path(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A dataset of two scenes; the second one has an additional bag with other sensors."""
    dataset = tmp_path_factory.mktemp("dataset")
    for number, split in enumerate(("train", "val")):
        written.record(dataset / "scenes" / split / f"Blocks-000{number}", written.spec(number, split), seed=number)
    moved = {**written.SENSORS[0], "pose": {"x_m": -1.0}}
    night = written.spec(1, "val", [moved, {"type": "lidar", "name": "lidar_left"}])
    bag = dataset / "scenes/val/Blocks-0001.night"
    written.record(bag, night, seed=7, only=["/ego/cam_front/rgb", "/ego/odom", "/clock"])
    (dataset / "scenes/val/Blocks-0002.partial").mkdir()
    return dataset


@pytest.fixture
def scene(path: Path) -> Scene:
    return open_dataset(path).scenes[0]


def image_of(message: Any, encoding: str) -> AnyArray:
    """Image decoded according to the format's specification, without the package's codecs."""
    if encoding == "rgb8":
        return cv2.imdecode(message.data, cv2.IMREAD_COLOR)[..., ::-1]
    if encoding == "32FC1":
        scale, offset = np.frombuffer(message.data[4:12].tobytes(), "<f4")
        levels = cv2.imdecode(message.data[12:], cv2.IMREAD_UNCHANGED).astype(np.float32)
        return np.where(levels > 0, scale / np.maximum(levels - offset, np.float32(1e-9)), np.float32(np.inf))
    decoded = cv2.imdecode(message.data, cv2.IMREAD_UNCHANGED)
    if encoding == "32FC2":
        flow_px = (decoded[..., [2, 1]].astype(np.float32) - 32768) / 64
        return np.where(decoded[..., :1] > 0, flow_px, np.float32(np.nan))
    return decoded


def equal(a: Any, b: Any) -> bool:
    if isinstance(a, np.ndarray) and a.dtype.names:
        return a.dtype == b.dtype and all(equal(a[name], b[name]) for name in a.dtype.names)
    if isinstance(a, np.ndarray):
        return a.dtype == b.dtype and np.array_equal(a, b, equal_nan=a.dtype.kind == "f")
    if isinstance(a, dict):
        return list(a) == list(b) and all(equal(a[key], b[key]) for key in a)
    return bool(a == b)


def test_every_message_that_rosbags_reads_is_in_its_frame(path: Path, scene: Scene) -> None:
    prefix, counts, held = "/ego/", Counter[str](), Counter[str]()
    with AnyReader([scene.path]) as reader:
        for connection, stamp_ns, data in reader.messages():
            key = connection.topic.removeprefix(prefix).removeprefix("/").partition("/image_raw")[0]
            expected = reader.deserialize(data, connection.msgtype)
            if key in scene.constants:
                continue
            frame = scene[int(np.searchsorted(scene.stamps_ns, stamp_ns))]
            found = frame.messages(key)[counts[key, frame.tick]]  # type: ignore[index]
            counts[key, frame.tick] += 1  # type: ignore[index]
            assert reader.typestore.serialize_cdr(found, connection.msgtype) == bytes(data)
            for modality, encoding in written.IMAGES.items():
                if key == f"cam_front/{modality}":
                    assert equal(frame[key], image_of(expected, encoding).astype(frame[key].dtype))
            held[key] += 1
    for key in scene.keys:
        assert held[key] == sum(len(frame.messages(key)) for frame in scene) == len(scene.sources[key].stamps_ns)


def test_frames_have_the_values_that_were_written(scene: Scene) -> None:
    assert len(scene) == written.TICKS
    for frame in scene:
        assert frame.stamp_ns == frame["clock"] == written.spec().stamp_ns(frame.tick)
        assert equal(frame["cam_front/semantic"], written.pixels("mono8", frame.tick))
        assert equal(frame["cam_front/instance"], written.pixels("mono16", frame.tick))
        assert equal(frame["lidar/points"], written.points(frame.tick))
        assert equal(frame["boxes"], written.boxes(frame.tick))
        assert equal(frame["bev/labels"], written.pixels("mono16", frame.tick))
        depth_m = written.pixels("32FC1", frame.tick)
        np.testing.assert_allclose(frame["cam_front/depth"], depth_m, rtol=1e-3)
        np.testing.assert_allclose(frame["cam_front/flow"], written.pixels("32FC2", frame.tick), atol=1 / 127)
        assert frame["gnss/fix"]["latitude_deg"].tolist() == [48.0 + frame.tick]
        np.testing.assert_array_equal(frame["gnss/fix"]["covariance_m2"][0], np.arange(9.0).reshape(3, 3))
        np.testing.assert_array_equal(frame["tf"]["map", "ego/base_link"][:3, 3], [1, 2, 3])
        np.testing.assert_array_equal(frame["cam_front/rgb/camera_info"]["p"], np.arange(12.0).reshape(3, 4))
        assert all(value.flags.writeable for value in frame.load().values() if isinstance(value, np.ndarray))


def test_slow_sensors_are_in_some_frames_and_fast_ones_have_all_samples(scene: Scene) -> None:
    assert ["cam_slow/rgb" in frame for frame in scene] == [True, False, False, False, True, False, False]
    assert scene.has(["cam_slow/rgb", "lidar/points"]).tolist() == ["cam_slow/rgb" in frame for frame in scene]
    np.testing.assert_array_equal(scene[3].last("cam_slow/rgb"), written.pixels("rgb8", 0, 9))
    np.testing.assert_array_equal(scene[4].last("cam_slow/rgb"), written.pixels("rgb8", 4, 9))
    assert [frame.last_tick("cam_slow/rgb") for frame in scene] == [0, 0, 0, 0, 4, 4, 4]
    age_ns = scene[3].stamp_ns - scene[0].stamp_ns
    assert [scene[3].last_tick("cam_slow/rgb", age_ns - short_ns) for short_ns in (0, 1)] == [0, None]
    with pytest.raises(KeyError, match="'cam_slow/rgb' has no value at tick 3 of scene Blocks-0000"):
        scene[3]["cam_slow/rgb"]
    assert [len(frame["imu/data_raw"]) for frame in scene] == [1, 4, 4, 4, 4, 4, 4]
    assert scene[2]["imu/data_raw"]["acceleration_mps2"][:, 1].tolist() == [1.25, 1.5, 1.75, 2]
    assert np.isnan(scene[2]["imu/data_raw"]["orientation_xyzw"]).all()
    assert [len(frame.messages("world/events")) for frame in scene] == [0, 0, 2, 3, 0, 0, 0]
    assert [event["type"] for event in scene[2]["world/events"]] == ["collision", "collision"]


def test_unknown_keys_and_ticks_are_errors(scene: Scene) -> None:
    with pytest.raises(KeyError, match="has no 'cam_frnt/rgb', but bev/labels, boxes"):
        scene[0]["cam_frnt/rgb"]
    with pytest.raises(IndexError):
        scene[written.TICKS]
    assert scene[-1].tick == written.TICKS - 1
    assert [frame.tick for frame in scene[1:6:2]] == [1, 3, 5]
    assert "cam_frnt/rgb" not in scene[0]


def test_poses_and_calibration_match_the_rig(scene: Scene) -> None:
    camera, frame = scene.calibration["cam_front"], scene[3]
    assert camera.intrinsics.tolist() == [[20.0, 0.0, 11.5], [0.0, 20.0, 7.5], [0.0, 0.0, 1.0]]
    assert camera.distortion.tolist() == [0.01, 0, 0, 0, 0]
    assert camera.size_px == (written.WIDTH, written.HEIGHT)
    cos, sin = np.cos(0.3), np.sin(0.3)
    expected = [[cos, -sin, 0, 3], [sin, cos, 0, 2], [0, 0, 1, 0.5], [0, 0, 0, 1]]
    np.testing.assert_allclose(frame.map_from_ego, expected, atol=1e-12)
    np.testing.assert_allclose(frame.map_from_sensor("lidar")[:3, 3], [3, 2, 2.3], atol=1e-12)
    # The camera looks left: its optical axis is the ego's y axis, its right is the ego's x axis.
    np.testing.assert_allclose(camera.ego_from_optical[:3, :3], [[1, 0, 0], [0, 0, 1], [0, -1, 0]], atol=1e-12)
    np.testing.assert_allclose(frame.map_from_optical("cam_front")[:3, 2], [-sin, cos, 0], atol=1e-12)
    with pytest.raises(AttributeError, match="lidar is a lidar, not a camera"):
        scene.calibration["lidar"].intrinsics  # noqa: B018


def test_latched_topics_are_constants(scene: Scene) -> None:
    assert scene.constants["world/legend"] == {"box_classes": ["car"]}
    assert list(scene.constants["tf_static"]) == [("ego/base_link", "ego/lidar")]
    assert not set(scene.constants) & set(scene.keys)


def test_futures_are_aligned_with_boxes(scene: Scene) -> None:
    futures = scene[4].futures(0.15, 0.05)
    assert futures.valid.tolist() == [[True, True, False], [False] * 3]  # the scene ends; the light has no track
    np.testing.assert_allclose(futures.position_m[0, :2, 0], [2.5, 3.0])


def test_random_access_equals_sequential_with_any_cache(path: Path) -> None:
    first = [frame.load() for frame in open_dataset(path).scenes[0]]
    order = np.random.default_rng(3).permutation(np.repeat(np.arange(written.TICKS), 2))
    for cache_bytes, threads in ((1, 2), (1, 1), (1 << 20, 3)):
        scene = open_dataset(path, cache_bytes=cache_bytes, threads=threads).scenes[0]
        assert all(equal(scene[int(tick)].load(), first[tick]) for tick in order)


def test_chunks_are_decompressed_once_in_order_and_only_if_needed(path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    offsets: list[int] = []
    original = chunk_cache.read_chunk
    monkeypatch.setattr(chunk_cache, "read_chunk", lambda s, *at: (offsets.append(at[0]), original(s, *at))[1])
    for frame in (scene := open_dataset(path).scenes[0]):
        frame.load()
    every = {int(offset) for source in scene.sources.values() for offset in source.topic.locations[:, -2]}
    assert sorted(offsets) == sorted(every)
    assert len(every) > 10
    offsets.clear()
    frame = open_dataset(path).scenes[0][3]
    assert not offsets
    assert frame["lidar/points"] is frame["lidar/points"]
    assert len(offsets) == 1


def test_additional_bags_are_merged_and_conflicting_keys_get_a_label(path: Path) -> None:
    scene = open_dataset(path).scenes[1]
    assert scene.additional == {"night": path / "scenes/val/Blocks-0001.night"}
    assert {key for key in scene.keys if "@" in key} == {"cam_front/rgb@night", "cam_front/rgb/camera_info@night"}
    assert set(scene.calibration) >= {"cam_front", "cam_front@night", "lidar_left"}
    assert scene.calibration["cam_front@night"].ego_from_sensor[0, 3] == -1.0
    assert not equal(scene[2]["cam_front/rgb@night"], scene[2]["cam_front/rgb"])
    assert len(scene) == written.TICKS


def test_an_additional_bag_of_another_motion_is_refused(path: Path, tmp_path: Path) -> None:
    folder = tmp_path / "scenes/train"
    shutil.copytree(path / "scenes/train/Blocks-0000", folder / "Blocks-0000")
    written.record(folder / "Blocks-0000.other", written.spec(5))
    with pytest.raises(BagError, match="its motion is that of scene Blocks-0005, not of Blocks-0000"):
        len(open_dataset(tmp_path).scenes[0])


def test_frames_of_many_scenes_are_one_list(path: Path) -> None:
    dataset = open_dataset(path)
    assert [scene.name for scene in dataset.scenes] == ["Blocks-0000", "Blocks-0001"]
    assert [(scene.number, scene.split, scene.map) for scene in dataset.scenes] == [
        (0, "train", "Blocks"),
        (1, "val", "Blocks"),
    ]
    assert len(dataset.frames()) == 2 * written.TICKS
    assert [(frame.scene.name, frame.tick) for frame in dataset.frames(keys=["cam_slow/rgb"])] == [
        ("Blocks-0000", 0),
        ("Blocks-0000", 4),
        ("Blocks-0001", 0),
        ("Blocks-0001", 4),
    ]
    assert [frame.tick for frame in dataset.frames("val", every=3)] == [0, 3, 6]
    assert len(dataset.frames("test", keys=["boxes"])) == 0
    assert dataset.scene("Blocks-0001") is dataset.scenes[1]
    with pytest.raises(InputError, match="split: 'training' is none of train, val, test"):
        dataset.frames("training")
    with pytest.raises(InputError, match=r"maps: Town01: .* has scenes of Blocks"):
        dataset.frames(maps=["Town01", "Blocks"])
    with pytest.raises(InputError, match="keys: no scene has 'cam_frnt/rgb'; Blocks-0000 has bev/labels, boxes"):
        dataset.frames(keys=["boxes", "cam_frnt/rgb"])


def test_the_index_spares_opening_bags_unless_it_is_stale(path: Path, tmp_path: Path) -> None:
    dataset = Path(shutil.copytree(path, tmp_path / "copy"))
    bag = dataset / "scenes/train/Blocks-0000"
    row = index_row(bag, dataset)
    write_index(dataset, [row])
    mcap = bag / "Blocks-0000_0.mcap"
    content = mcap.read_bytes()
    mcap.write_bytes(b"x" * len(content))
    scene = open_dataset(dataset).scenes[0]
    assert (len(scene), scene.name, scene.row["seed"]) == (written.TICKS, "Blocks-0000", 0)
    write_index(dataset, [{**row, "bytes": 1}])
    mcap.write_bytes(content)
    assert open_dataset(dataset).scenes[0].row == {}


def test_datasets_scenes_and_frames_can_be_pickled(path: Path) -> None:
    dataset = open_dataset(path)
    frame = dataset.scenes[0][2]
    loaded = frame.load()
    copy: Dataset = pickle.loads(pickle.dumps(dataset))
    assert len(pickle.dumps(dataset)) < 5000
    assert equal(copy.scenes[0][2].load(), loaded)
    other: Frame = pickle.loads(pickle.dumps(frame))
    assert equal(other["lidar/points"], loaded["lidar/points"])
    frames = pickle.loads(pickle.dumps(dataset.frames("val")))
    assert equal(frames[1]["boxes"], written.boxes(1))


def test_columns_stack_in_the_order_asked_for() -> None:
    table = written.points(1)
    np.testing.assert_array_equal(columns(table, "z", "x")[:, 1], table["x"])
