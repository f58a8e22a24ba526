"""Spray: puffs behind the wheels of vehicles that drive on wet roads; only the color image shows them."""

from dataclasses import replace

import numpy as np
import pytest
from render_scene import CAMERA, NOON, car, front_pose, scene, world

from simbev_ros.config.modalities import MODALITIES
from simbev_ros.foundation.semantics import Tag
from simbev_ros.foundation.types import Table
from simbev_ros.schema.scene.state import WorldState
from simbev_ros.simulation.render.frame import CameraView, RenderFrame
from simbev_ros.simulation.render.renderer import Renderer
from simbev_ros.simulation.render.shading.spray import LIFE_NS, spray_puffs

WET = NOON.model_copy(update={"wetness": 80.0})
FAST = {"id": 2, "x": 12.0, "y": 0.0, "vx": 15.0, "tag": Tag.CAR}


def puffs_of(state: WorldState) -> Table:
    return spray_puffs(state, np.zeros(3))


def test_puffs_start_at_the_rear_wheels_and_follow_the_car() -> None:
    puffs = puffs_of(world({"id": 1}, FAST, weather=WET))
    along_m, across_m, up_m = puffs["at"].T - np.array([[12.0], [0.0], [0.0]])
    assert len(puffs) > 10
    assert along_m.max() < -1.0  # the rear axle is 1.4 m behind the center
    assert along_m.min() > -1.5 - 15.0 * LIFE_NS * 1e-9
    assert np.abs(across_m).max() < 1.6
    assert up_m.min() > 0.0
    order = np.argsort(-along_m)
    assert np.all(np.diff(puffs["radius_m"][order]) >= 0.0)  # older ones are larger
    assert puffs["opacity"][order][-1] < 0.2 * puffs["opacity"].max()


def test_puffs_turn_with_the_path_of_the_car() -> None:
    left = puffs_of(world({"id": 1}, {**FAST, "wz": 0.6}, weather=WET))
    straight = puffs_of(world({"id": 1}, FAST, weather=WET))
    shift_m = (left["at"] - straight["at"])[:, 1]
    assert shift_m.max() > 0.5  # in a turn to the left, it was farther left before
    assert shift_m.min() > -1e-6


def test_spray_grows_with_speed_and_water_and_needs_both() -> None:
    def opacity(speed_mps: float, wetness: float) -> float:
        weather = NOON.model_copy(update={"wetness": wetness})
        return float(puffs_of(world({"id": 1}, {**FAST, "vx": speed_mps}, weather=weather))["opacity"].sum())

    assert 0.0 < opacity(8.0, 80.0) < opacity(15.0, 80.0) < opacity(25.0, 80.0)
    assert opacity(15.0, 30.0) < opacity(15.0, 90.0)
    assert opacity(15.0, 0.0) == 0.0
    assert opacity(3.0, 90.0) == 0.0
    assert len(puffs_of(world({"id": 1}, {**FAST, "tag": Tag.BICYCLE}, weather=WET))) == 0


def test_a_puff_moves_steadily_until_it_vanishes() -> None:
    state = world({"id": 1}, FAST, weather=WET)
    stamps_ns = np.arange(0, LIFE_NS, 50_000_000)
    paths = np.stack([puffs_of(replace(state, stamp_ns=int(stamp_ns)))["at"] for stamp_ns in stamps_ns])
    steps_m = np.linalg.norm(np.diff(paths, axis=0), axis=2)
    jumps = steps_m > 1.0
    assert np.all(jumps.sum(axis=0) <= 1)  # only when the next puff takes its place
    np.testing.assert_array_equal(puffs_of(state), puffs_of(replace(state, stamp_ns=0)))


@pytest.mark.gl
def test_only_the_color_image_of_a_wet_road_shows_spray(monkeypatch: pytest.MonkeyPatch) -> None:
    renderer = Renderer(scene(), [car()])
    view = CameraView(CAMERA, front_pose(), MODALITIES)
    changed = {}
    for weather in (WET, NOON):
        frame = RenderFrame(world({"id": 1}, FAST, weather=weather))
        [sprayed] = renderer.render([view], frame)
        with monkeypatch.context() as patch:
            patch.setattr(renderer._shading.spray, "draw", lambda _: None)
            [clean] = renderer.render([view], frame)
        changed[weather.wetness] = np.abs(sprayed.rgb.astype(int) - clean.rgb).max(axis=2)
        for name in ("semantic", "instance", "depth", "flow"):
            np.testing.assert_array_equal(getattr(sprayed, name), getattr(clean, name))
    assert changed[80.0].max() > 20
    assert not changed[80.0][:20].any()  # nothing in the sky
    assert not changed[0.0].any()
