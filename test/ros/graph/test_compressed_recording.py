"""A graph records compressed clouds in place of others: the same points, and all else as without compression."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from changed_recording import record_changed
from commands import SCENE, Command, digests

pytestmark = pytest.mark.graph

CLOUDS = {"/ego/lidar/points", "/ego/lidar/semantic_points"}


def test_compressed_clouds_are_recorded_in_place_of_others_and_nothing_else_changes(
    small_config: Callable[..., Path], tmp_path: Path
) -> None:
    pytest.importorskip("point_cloud_interfaces")
    config = small_config(0.3, without=["camera", "radar", "gnss", "imu"])
    plain, packed = record_changed(config, tmp_path, "columns: 128}", "columns: 128, compression: zstd}")
    assert plain.digests.keys() - packed.digests.keys() == CLOUDS
    assert packed.digests.keys() - plain.digests.keys() == {f"{name}/zstd" for name in CLOUDS}
    for key in ("lidar/points", "lidar/semantic_points"):
        ticks = np.flatnonzero(plain.scene.has([key])).tolist()
        assert len(ticks) == 6 and ticks == np.flatnonzero(packed.scene.has([key])).tolist()
        assert all(np.array_equal(plain.scene[tick][key], packed.scene[tick][key]) for tick in ticks)
    code, output = Command("replay", packed.bag, config, "--out", tmp_path / "again").finish()
    assert code == 0, output
    again = digests(tmp_path / "again" / SCENE)
    assert all(again[name] == packed.digests[name] for name in again.keys() & packed.digests.keys())
    assert {f"{name}/zstd" for name in CLOUDS} <= again.keys()
