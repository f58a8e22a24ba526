"""A graph records compressed clouds in place of others: the same points, and all else as without compression."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from commands import SCENE, Command, record

from simbev_ros.dataset import open_dataset
from simbev_ros.recording.digest import topic_digests
from simbev_ros.recording.reader import SceneBag
from simbev_ros.recording.verify import verify_bag

pytestmark = pytest.mark.graph

CLOUDS = {"/ego/lidar/points", "/ego/lidar/semantic_points"}
OF_THE_RIG = {"/world/scene"}
"""Topics that contain the settings of the lidar."""


def test_compressed_clouds_are_recorded_in_place_of_others_and_nothing_else_changes(
    small_config: Callable[..., Path], tmp_path: Path
) -> None:
    pytest.importorskip("point_cloud_interfaces")
    config = small_config(0.3, without=["camera", "radar", "gnss", "imu"])
    plain = record(Command, config, tmp_path / "plain")
    config.write_text(config.read_text().replace("columns: 128}", "columns: 128, compression: zstd}", 1))
    packed = record(Command, config, tmp_path / "packed")
    assert verify_bag(packed) == []
    with SceneBag(plain) as one, SceneBag(packed) as other:
        before, after = topic_digests(one), topic_digests(other)
    assert before.keys() - after.keys() == CLOUDS
    assert after.keys() - before.keys() == {f"{name}/zstd" for name in CLOUDS}
    assert {name for name in before.keys() & after.keys() if before[name] != after[name]} == OF_THE_RIG
    of_plain, of_packed = (open_dataset(tmp_path / name).scenes[0] for name in ("plain", "packed"))
    for key in ("lidar/points", "lidar/semantic_points"):
        ticks = np.flatnonzero(of_plain.has([key])).tolist()
        assert len(ticks) == 6 and ticks == np.flatnonzero(of_packed.has([key])).tolist()
        assert all(np.array_equal(of_plain[tick][key], of_packed[tick][key]) for tick in ticks)
    code, output = Command("replay", packed, config, "--out", tmp_path / "again").finish()
    assert code == 0, output
    with SceneBag(tmp_path / "again" / SCENE) as bag:
        again = topic_digests(bag)
    assert {name: digest for name, digest in again.items() if name in after} == {
        name: after[name] for name in again.keys() & after.keys()
    }
    assert {f"{name}/zstd" for name in CLOUDS} <= again.keys()
