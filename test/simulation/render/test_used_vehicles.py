"""What makes vehicles look used: people behind the glass, dirt above the sills, numbers on the plates."""

from functools import cache

import numpy as np
import pytest
from render_scene import NOON, scene

from simbev_ros.assets.actors.catalog import load_models
from simbev_ros.foundation.geometry.camera import PinholeCamera
from simbev_ros.foundation.geometry.transforms import matrices_from_xyz_rpy
from simbev_ros.foundation.semantics import Tag
from simbev_ros.foundation.types import Float64Array
from simbev_ros.scene.blueprints import blueprint_index, blueprint_named
from simbev_ros.schema.scene.state import ACTOR_DTYPE, SIGNAL_DTYPE, Behavior, WorldState
from simbev_ros.simulation.render.frame import CameraView, RenderFrame
from simbev_ros.simulation.render.renderer import Renderer

pytestmark = pytest.mark.gl

NAME, AHEAD_M = "vehicle.compact", 9.0
CAMERA = PinholeCamera.from_field_of_view(800, 450, np.radians(40.0))
HEIGHT_M = 1.0
BANDS = ((0.32, 0.42), (0.8, 0.88))
"""Heights of the sills and of the doors below their windows."""


@cache
def renderer() -> Renderer:
    return Renderer(scene(), [load_models()[blueprint_index()[NAME]]])


def picture(actor_id: int, yaw_rad: float, behavior: int = 0) -> Float64Array:
    """(450, 800, 3) image of a white car ahead, in sRGB, 0..255; the ego is below the ground."""
    actors = np.zeros(2, ACTOR_DTYPE)
    actors["id"], actors["tag"], actors["color"] = [1, actor_id], Tag.CAR, 0xF0F0F0
    actors["length"], actors["width"], actors["height"] = blueprint_named(NAME).size_m
    actors["x"], actors["z"] = [0.0, AHEAD_M], [-5.0, 0.0]
    actors["yaw"], actors["behavior"] = [0.0, yaw_rad], behavior
    view = CameraView(CAMERA, matrices_from_xyz_rpy(np.array([0.0, 0.0, 5.0 + HEIGHT_M]), np.zeros(3)), ("rgb",))
    world = WorldState(0, 0, 1, actors, np.zeros(0, SIGNAL_DTYPE), NOON)
    [images] = renderer().render([view], RenderFrame(world, None))
    return np.asarray(images.rgb, np.float64)


def rows(low_m: float, high_m: float, distance_m: float) -> slice:
    """Rows of the image between two heights at a distance."""
    low, high = (225.0 - CAMERA.fy_px * (z_m - HEIGHT_M) / distance_m for z_m in (low_m, high_m))
    return slice(round(high), round(low))


def test_a_parked_vehicle_is_empty_and_differs_nowhere_but_behind_its_glass() -> None:
    driven, parked = picture(40, np.pi), picture(40, np.pi, Behavior.PARKED)
    changed = np.abs(driven - parked).max(axis=2) > 2.0
    glass = rows(0.9, 1.5, AHEAD_M - 1.0)
    assert changed[glass].sum() > 100
    assert changed.sum() == changed[glass].sum()


def test_vehicles_are_dirtier_at_their_sills_than_below_their_windows_each_by_its_own_share() -> None:
    sides = [picture(actor_id, np.pi / 2) for actor_id in range(50, 62)]
    doors, across = slice(330, 430), AHEAD_M - 0.9
    sills, shoulders = (np.array([side[rows(*band, across), doors].mean() for side in sides]) for band in BANDS)
    assert (sills < shoulders).all()
    clean = shoulders.max()
    assert np.ptp(sills) > 10.0
    assert sills.max() > 0.7 * clean


def test_numbers_on_plates_differ_between_vehicles_and_stay_those_of_a_vehicle() -> None:
    plate = rows(0.37, 0.48, AHEAD_M - 2.1), slice(365, 435)
    first, again, other = (picture(actor_id, np.pi)[plate] for actor_id in (70, 70, 71))
    np.testing.assert_array_equal(first, again)
    assert np.abs(first - other).max() > 60.0
    assert np.ptp(first.mean(axis=2)) > 80.0  # dark characters on a light sheet
