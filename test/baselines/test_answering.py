"""Frames reach the model as it was trained, and its answers come back in the map and on the scene's grid."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from made_up_scene import made_up_spec

from simbev_ros.baselines.boxes import BOX_DTYPE as MODEL_BOX_DTYPE
from simbev_ros.baselines.grid import CELL_M, CELLS
from simbev_ros.baselines.inference import Answer
from simbev_ros.baselines.modality import Modality
from simbev_ros.baselines.node.answering import Answering, Frame, scores_on_grid
from simbev_ros.baselines.node.scene_inputs import inputs_of_scene
from simbev_ros.baselines.node.sweeps import Sweep
from simbev_ros.foundation.geometry.grid import BevGrid
from simbev_ros.foundation.geometry.transforms import matrices_from_xyz_rpy
from simbev_ros.foundation.types import Float64Array, UInt8Array
from simbev_ros.reference_stack.pipeline import BOX_DTYPE
from simbev_ros.reference_stack.pipeline import BOX_DTYPE as REFERENCE_BOX_DTYPE

SIZE_PX = (64, 32)
SENSORS = [
    {"type": "camera", "name": "front", "pose": {"x_m": 0.6, "z_m": 1.6}, "width_px": 64, "height_px": 48},
    {"type": "lidar", "name": "lidar", "pose": {"z_m": 1.8}},
]


class FakeBaseline:
    """Notes what it is given and answers with one box 10 m ahead, and with cells that name their row and column."""

    modality, cameras, camera_size_px, sweep_ages_ns = Modality.FUSED, 3, SIZE_PX, (0, 250_000_000, 500_000_000)

    def __init__(self) -> None:
        self.given: list[Any] = []

    def answer(self, *given: Any) -> Answer:
        self.given.append(given)
        boxes = np.zeros(1, MODEL_BOX_DTYPE)
        boxes["x"], boxes["vx"], boxes["score"], boxes["class"], boxes["length"] = 10.0, 2.0, 0.9, 5, 4.0
        return Answer(numbered_cells(), boxes)


def numbered_cells() -> UInt8Array:
    """Cells whose two channels are half of their row and of their column."""
    row, column = np.indices((CELLS, CELLS)) // 2
    return np.stack([row, column], axis=-1).astype(np.uint8)


def pose(x_m: float, yaw_rad: float) -> Float64Array:
    return matrices_from_xyz_rpy(np.array([x_m, 0.0, 0.0]), np.array([0.0, 0.0, yaw_rad]))


def answering(baseline: FakeBaseline, *, tracks: bool = False) -> Answering:
    text = made_up_spec(SENSORS, number=0, split="train", ticks=1).model_dump_json()
    inputs = inputs_of_scene(text, Modality.FUSED, "", baseline.cameras, SIZE_PX)
    return Answering(baseline, inputs, tracks=tracks)  # type: ignore[arg-type]


def frame(map_from_ego: Float64Array, *older: Sweep | None) -> Frame:
    sweep = Sweep(10**9, np.array([[1.0, 2.0, 3.0]], np.float32), map_from_ego)
    white = np.full((48, 64, 3), 255, np.uint8)
    return Frame(10**9, map_from_ego, [sweep, *older], {"front": lambda fit: fit.fit(white)})


def test_cameras_that_the_rig_lacks_are_black_and_see_nothing() -> None:
    baseline = FakeBaseline()
    answering(baseline).answer(frame(pose(0.0, 0.0)))
    [(_, images, pixel_from_level)] = baseline.given
    assert images.shape == (3, 32, 64, 3) and (images[0] == 255).all() and not images[1:].any()
    assert pixel_from_level.shape == (3, 3, 4) and pixel_from_level[0].any() and not pixel_from_level[1:].any()


def test_earlier_sweeps_move_to_the_frame_of_the_newest() -> None:
    baseline = FakeBaseline()
    older = Sweep(7 * 10**8, np.array([[1.0, 0.0, 0.5]], np.float32), pose(90.0, 0.0))
    answering(baseline).answer(frame(pose(100.0, np.pi / 2), None, older))
    [(points, _, _)] = baseline.given
    assert points == pytest.approx(np.array([[1, 2, 3, 0], [0, 9, 0.5, 2]]), abs=1e-4)


def test_boxes_are_published_in_the_map_and_have_no_track() -> None:
    assert BOX_DTYPE == REFERENCE_BOX_DTYPE
    [box] = answering(FakeBaseline()).answer(frame(pose(100.0, np.pi / 2))).boxes
    assert (box["x"], box["y"], box["yaw"]) == pytest.approx((100.0, 10.0, np.pi / 2))
    assert (box["vx"], box["vy"], box["vz"]) == pytest.approx((0.0, 2.0, 0.0), abs=1e-6)
    assert (box["id"], box["class"], box["length"]) == (-1, 5, 4.0)


def test_tracked_boxes_have_the_ids_and_velocities_of_their_tracks() -> None:
    tracking, start = answering(FakeBaseline(), tracks=True), frame(pose(0.0, 0.0))
    [first] = tracking.answer(start).boxes
    later = replace(start, stamp_ns=start.stamp_ns + 5 * 10**8, map_from_ego=pose(1.3, 0.0))
    [second] = tracking.answer(later).boxes
    assert (first["id"], second["id"]) == (1, 1)
    assert first["vx"] == 2.0 and 2.05 < second["vx"] < 2.6  # it was 1.3 m behind, half a second ago
    assert second["x"] == 11.3


def test_scores_on_the_models_grid_are_its_own() -> None:
    cells = numbered_cells()
    assert scores_on_grid(cells, BevGrid(CELLS, CELLS, CELL_M)) is cells
    assert scores_on_grid(cells, None) is cells


def test_a_smaller_grid_gets_the_middle_of_the_models() -> None:
    scores = scores_on_grid(numbered_cells(), BevGrid(100, 40, CELL_M))
    assert (scores == numbered_cells()[130:230, 160:200]).all()


def test_cells_beyond_the_models_grid_have_no_score() -> None:
    scores = scores_on_grid(np.full((CELLS, CELLS, 1), 9, np.uint8), BevGrid(200, 100, 0.8))
    assert (scores[10:190, 5:95] == 9).all()
    assert not scores[:10].any() and not scores[190:].any()
    wide = scores_on_grid(np.full((CELLS, CELLS, 1), 9, np.uint8), BevGrid(200, 200, 0.8))
    assert wide[:, 10:190].any() and not wide[:, :10].any()


def test_a_grid_of_coarser_cells_takes_the_score_at_the_center() -> None:
    scores = scores_on_grid(numbered_cells(), BevGrid(3, 3, 2.0))
    assert scores[0, 1].tolist() == [(180 - 5) // 2, 180 // 2]  # 2 m ahead is 5 cells of 0.4 m
