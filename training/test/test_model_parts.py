"""A model that is cut in two computes what the whole one computes, and fuses agents as if their points were one's."""

from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("onnxruntime", reason="baselines need it: ./simbev setup baselines")
pytest.importorskip("torch", reason="training needs it: pip install ./training[torch]")
pytest.importorskip("onnx", reason="training needs it: pip install ./training[torch]")

from simbev_ros.baselines.cooperation import TwoPartBaseline, fuse_features
from simbev_ros.baselines.inference import Answer, Baseline, weights_file
from simbev_ros.baselines.modality import Modality
from simbev_ros.foundation.errors import InputError
from simbev_ros.foundation.types import Float32Array
from simbev_training.training.parts import cut_model

FILE = weights_file(Modality.LIDAR)


@pytest.fixture(scope="module")
def parts() -> TwoPartBaseline:
    return TwoPartBaseline(FILE, cut_model(FILE), threads=1)


def street() -> Float32Array:
    """Points of a road with two cars on it, ahead and behind."""
    rng = np.random.default_rng(0)
    ground = np.column_stack([rng.uniform(-40, 40, (20_000, 2)), np.zeros(20_000)])
    sides = rng.uniform(-1, 1, (4000, 3)) * [2.1, 0.9, 0.75] + [0, 0, 0.8]
    sides[::2, 1] = np.sign(sides[::2, 1]) * 0.9
    cars = sides + np.repeat([[12.0, 3.0, 0.0], [-15.0, -3.0, 0.0]], 2000, axis=0)
    points = np.concatenate([ground, cars])
    return np.column_stack([points, np.arange(len(points)) % 3]).astype(np.float32)


def require_same(one: Answer, other: Answer) -> None:
    assert len(one.boxes) > 0 and (one.boxes["score"] > 0.3).any()
    assert np.array_equal(one.boxes, other.boxes)
    assert np.array_equal(one.cells, other.cells)


def test_two_parts_answer_as_the_whole_model_does(parts: TwoPartBaseline) -> None:
    require_same(parts.answer(parts.encode(street())), Baseline(FILE, threads=1).answer(street()))


def test_two_agents_that_see_half_of_the_cells_each_find_what_one_finds_that_sees_all(parts: TwoPartBaseline) -> None:
    points = street()
    ahead = points[:, 0] > 0
    own, other = (parts.encode(points[each]) for each in (ahead, ~ahead))
    require_same(parts.answer(fuse_features(own, [(other, np.eye(4))])), parts.answer(parts.encode(points)))
    assert not (parts.answer(own).boxes["score"][parts.answer(own).boxes["x"] < -10] > 0.3).any()


def test_without_points_there_are_no_features(parts: TwoPartBaseline) -> None:
    assert len(parts.encode(np.zeros((0, 4), np.float32)).cells) == 0


@pytest.mark.parametrize("modality", [Modality.CAMERA, Modality.FUSED])
def test_models_that_see_images_are_refused(modality: Modality) -> None:
    with pytest.raises(InputError, match="is not a single lidar model that `simbev train` wrote, so it cannot be cut"):
        cut_model(weights_file(modality))


def test_a_damaged_file_is_refused(tmp_path: Path) -> None:
    file = tmp_path / "model.onnx"
    file.write_bytes(b"\xff" * 100)
    with pytest.raises(InputError, match="cannot be read"):
        cut_model(file)
