"""Tests that an export has the annotator's voxels at every frame, also where the graph has not recorded them."""

from pathlib import Path

import numpy as np
import pytest

from simbev_ros.dataset import open_dataset
from simbev_ros.export.simbev.export import finish, make_part, parts_of
from simbev_ros.export.simbev.voxels import KEY, VoxelLabeler

pytestmark = pytest.mark.graph


def test_voxels_are_labeled_again_as_the_graph_has_labeled_them(recorded: Path, tmp_path: Path) -> None:
    dataset = open_dataset(recorded)
    scene = dataset.scenes[0]
    labeler, with_voxels = VoxelLabeler(scene), [frame for frame in scene if KEY in frame]
    assert len(with_voxels) == len(scene) // 2
    for frame in with_voxels:
        np.testing.assert_array_equal(labeler.rows(frame), frame[KEY])
    parts = parts_of(dataset, tmp_path)
    for part in parts:
        make_part(part)
    assert len(list((tmp_path / "sweeps/VOXEL-GRID").iterdir())) == len(scene)
    assert not any("VOXEL-GRID" in line for line in finish(dataset, parts))
