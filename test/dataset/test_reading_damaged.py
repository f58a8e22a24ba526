"""Bags that are cut off or damaged: intact parts can be read, and damage is reported."""

import os
from pathlib import Path

import numpy as np
import pytest
import recorded_scene as written

from simbev_ros.dataset import open_dataset
from simbev_ros.foundation.errors import BagError, InputError
from simbev_ros.recording.bag_writer import SceneBagWriter
from simbev_ros.recording.mcap.mcap_index import read_mcap_index


@pytest.fixture(scope="module")
def content(tmp_path_factory: pytest.TempPathFactory) -> bytes:
    bag = written.record(tmp_path_factory.mktemp("whole") / "Blocks-0000", written.spec())
    return (bag / "Blocks-0000_0.mcap").read_bytes()


@pytest.mark.parametrize("share", [0.4, 0.7, 0.97])
def test_a_bag_that_is_cut_off_can_be_read_as_far_as_it_goes(content: bytes, tmp_path: Path, share: float) -> None:
    file = tmp_path / "cut_0.mcap"
    file.write_bytes(content[: int(len(content) * share)])
    scene = open_dataset(file).scenes[0]
    assert 1 < len(scene) <= written.TICKS
    for frame in list(scene)[:-1]:  # only the last tick may be incomplete
        assert frame["lidar/points"].tobytes() == written.points(frame.tick).tobytes()
        assert frame["boxes"].tobytes() == written.boxes(frame.tick).tobytes()
        np.testing.assert_array_equal(frame.load()["cam_front/instance"], written.pixels("mono16", frame.tick))


def test_a_pipe_in_place_of_the_index_is_refused_and_not_waited_for(tmp_path: Path) -> None:
    written.record(tmp_path / "scenes/train/Blocks-0000", written.spec())
    os.mkfifo(tmp_path / "index.parquet")
    with pytest.raises(InputError, match="is not a file"):
        open_dataset(tmp_path)


@pytest.mark.parametrize("share", [0.5, 0.999])
def test_a_cut_off_scene_of_a_dataset_is_no_shorter_scene(content: bytes, tmp_path: Path, share: float) -> None:
    for number in (0, 1):
        bag = written.record(tmp_path / f"scenes/train/Blocks-000{number}", written.spec())
    (bag / "Blocks-0001_0.mcap").write_bytes(content[: int(len(content) * share)])
    whole, cut_off = open_dataset(tmp_path).scenes
    assert len(whole) == written.TICKS
    with pytest.raises(BagError, match="Blocks-0001: it was cut off; simbev repair saves what is in it"):
        len(cut_off)


def test_a_flipped_bit_is_named_and_other_frames_can_be_read(content: bytes, tmp_path: Path) -> None:
    file = tmp_path / "flipped_0.mcap"
    file.write_bytes(content)
    scene = open_dataset(file).scenes[0]
    offset = int(scene.sources["lidar/points"].topic.between(-1, scene[3].stamp_ns)[-1, -2])
    data = bytearray(content)
    data[offset + 9 + 60] ^= 1
    file.write_bytes(data)
    scene = open_dataset(file).scenes[0]
    for _ in range(2):  # the cache does not keep an error instead of a chunk
        with pytest.raises(BagError, match=rf"flipped_0.mcap: /ego/lidar/points: damaged chunk at byte {offset}"):
            scene[3]["lidar/points"]
        with pytest.raises(BagError, match=r"damaged chunk"):
            scene[3].load()
    assert len(scene[0]["lidar/points"]) == len(written.points(0))


def test_a_damaged_index_is_found(content: bytes, tmp_path: Path) -> None:
    file = tmp_path / "index_0.mcap"
    file.write_bytes(content)
    with file.open("rb") as stream:
        index = read_mcap_index(stream, "")
    channel = next(number for number, each in index.channels.items() if each.topic == "/ego/boxes")
    stamp_ns, _, offset = index.locations[channel].table()[2].tolist()
    entry = stamp_ns.to_bytes(8, "little") + offset.to_bytes(8, "little")
    file.write_bytes(content.replace(entry, stamp_ns.to_bytes(8, "little") + (offset + 1).to_bytes(8, "little")))
    with pytest.raises(BagError, match=r"/ego/boxes: the index of the chunk at byte .* is damaged"):
        open_dataset(file).scenes[0][2]["boxes"]


def test_an_unfinished_bag_has_no_trajectories(tmp_path: Path) -> None:
    with SceneBagWriter(tmp_path / "a") as writer:
        writer.add_attachment("scene.json", "application/json", written.spec().model_dump_json().encode())
    scene = open_dataset(tmp_path / "a.partial").scenes[0]
    assert len(scene) == 0
    with pytest.raises(BagError, match=r"it holds no trajectories: trajectories.npz is not attached"):
        scene.tracks  # noqa: B018


def test_a_path_without_a_bag_is_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"no such file or folder"):
        open_dataset(tmp_path / "missing")
    (tmp_path / "empty").mkdir()
    with pytest.raises(InputError, match=r"a scene's bag holds one .mcap file, this folder holds 0"):
        open_dataset(tmp_path / "empty")
    (tmp_path / "text.mcap").write_text("This is no bag. " * 9)
    with pytest.raises(BagError, match=r"not an MCAP file"):
        len(open_dataset(tmp_path / "text.mcap").scenes[0])
    with SceneBagWriter(tmp_path / "b") as writer:
        writer.finish({})
    with pytest.raises(BagError, match=r"it holds no scene: scene.json is not attached"):
        len(open_dataset(tmp_path / "b").scenes[0])
