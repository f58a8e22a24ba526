"""Semantic images as people draw them: gaps are closed by their width in meters, at the distance of what is around."""

import numpy as np
import pytest
from render_scene import car, world

from simbev_ros.assets.placement.static_scene import StaticScene
from simbev_ros.config.camera import Camera
from simbev_ros.foundation.semantics import Tag
from simbev_ros.foundation.types import Float32Array, UInt8Array
from simbev_ros.simulation.render.frame import CameraView, RenderFrame
from simbev_ros.simulation.render.outlines import outlined
from simbev_ros.simulation.render.renderer import Renderer

FOCAL_PX = 400.0


def bars(tag: Tag, distance_m: float, gap_m: float, behind_m: float) -> tuple[UInt8Array, Float32Array]:
    """A wall, and bars of 2 cm before it with gaps between them; columns of pixels."""
    x_m = (np.arange(320) - 160.0) / FOCAL_PX * distance_m
    is_bar = (np.abs((x_m + (gap_m + 0.02) / 2.0) % (gap_m + 0.02)) < 0.02) & (np.abs(x_m) < 3.0)
    row = np.where(is_bar, tag, Tag.WALL).astype(np.uint8)
    depth_m = np.where(is_bar, distance_m, distance_m + behind_m).astype(np.float32)
    return np.tile(row, (200, 1)), np.tile(depth_m, (200, 1))


@pytest.mark.parametrize("distance_m", [4.0, 8.0, 16.0])
def test_narrow_gaps_are_closed_at_each_distance_and_wide_ones_stay(distance_m: float) -> None:
    semantic, depth_m = bars(Tag.FENCE, distance_m, 0.14, 2.0)
    closed = outlined(semantic, depth_m, FOCAL_PX)
    columns = np.flatnonzero((semantic == Tag.FENCE).any(axis=0))
    assert (closed[:, columns[0] : columns[-1] + 1] == Tag.FENCE).all(), "between the first bar and the last"
    np.testing.assert_array_equal(closed[:, : columns[0]], semantic[:, : columns[0]])
    wide, wide_depth_m = bars(Tag.FENCE, distance_m, 0.8, 2.0)
    np.testing.assert_array_equal(outlined(wide, wide_depth_m, FOCAL_PX), wide)


def test_what_is_no_farther_or_outlined_on_its_own_stays() -> None:
    semantic, depth_m = bars(Tag.VEGETATION, 10.0, 0.5, 0.5)
    np.testing.assert_array_equal(outlined(semantic, depth_m, FOCAL_PX), semantic)
    semantic, depth_m = bars(Tag.VEGETATION, 10.0, 0.5, 5.0)
    semantic[50:100][semantic[50:100] == Tag.WALL] = Tag.PEDESTRIAN
    closed = outlined(semantic, depth_m, FOCAL_PX)
    np.testing.assert_array_equal(closed[50:100], semantic[50:100])
    assert (closed[:50, 60:260] == Tag.VEGETATION).all() and (closed[100:, 60:260] == Tag.VEGETATION).all()


def test_a_thin_pole_is_three_pixels_wide_before_what_is_farther_alone() -> None:
    semantic, depth_m = np.full((60, 80), Tag.SKY, np.uint8), np.full((60, 80), np.inf, np.float32)
    semantic[:, 40], depth_m[:, 40] = Tag.POLE, 30.0
    semantic[:20, 41:], depth_m[:20, 41:] = Tag.BUILDING, 20.0
    semantic[40:, 41:], depth_m[40:, 41:] = Tag.CAR, 50.0
    drawn = outlined(semantic, depth_m, FOCAL_PX)
    assert (drawn[:, 39:41] == Tag.POLE).all() and (drawn[22:38, 41] == Tag.POLE).all()
    np.testing.assert_array_equal(drawn[:20, 41:], semantic[:20, 41:])
    np.testing.assert_array_equal(drawn[40:, 41:], semantic[40:, 41:])


def test_the_nearest_of_several_classes_is_drawn() -> None:
    semantic, depth_m = bars(Tag.VEGETATION, 20.0, 0.5, 20.0)
    fence, _ = bars(Tag.FENCE, 8.0, 0.14, 12.0)
    semantic[fence == Tag.FENCE], depth_m[fence == Tag.FENCE] = Tag.FENCE, 8.0
    assert (outlined(semantic, depth_m, FOCAL_PX)[:, 100:220] == Tag.FENCE).all()


def test_a_camera_that_asks_for_outlines_draws_them_and_keeps_its_other_images() -> None:
    fields = {"type": "camera", "name": "a", "width_px": 64, "height_px": 48}
    plain = Camera.model_validate({**fields, "modalities": ["semantic", "instance", "depth"]})
    drawn = Camera.model_validate({**fields, "labels": "drawn", "modalities": ["semantic", "instance"]})
    renderer = Renderer(StaticScene((), ()), [car()], quality="low")
    frame = RenderFrame(world({"id": 1, "x": 0.0, "y": 0.0}, {"id": 2, "x": 9.0, "y": 0.0}))
    views = [CameraView.from_config(camera, 1, 0) for camera in (plain, drawn)]
    exact, outlines = renderer.render(views, frame)
    renderer.close()
    assert exact.semantic is not None and exact.depth is not None
    assert outlines.depth is None, "only drawn for the outlines"
    np.testing.assert_array_equal(outlines.semantic, outlined(exact.semantic, exact.depth, plain.model.fx_px))
    np.testing.assert_array_equal(outlines.instance, exact.instance)
