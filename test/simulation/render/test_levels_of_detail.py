from dataclasses import replace

import numpy as np
import pytest
from render_scene import NOON, scene

from simbev_ros.assets.actors.actor_model import ActorModel
from simbev_ros.assets.actors.catalog import load_models
from simbev_ros.foundation.geometry.camera import PinholeCamera
from simbev_ros.foundation.geometry.transforms import matrices_from_xyz_rpy
from simbev_ros.foundation.types import AnyArray, BoolArray, Int64Array, Table
from simbev_ros.scene.blueprints import blueprint_index
from simbev_ros.schema.scene.state import ACTOR_DTYPE, SIGNAL_DTYPE, WorldState
from simbev_ros.simulation.render.frame import CameraImages, CameraView, RenderFrame
from simbev_ros.simulation.render.geometry.level_of_detail import LevelsOfDetail
from simbev_ros.simulation.render.renderer import Renderer

pytestmark = pytest.mark.gl

NAMES = (
    "vehicle.sedan",
    "vehicle.bus",
    "vehicle.bicycle",
    "pedestrian.woman",
    "vehicle.fire_engine",
    "prop.sign_works",
)
CAMERA = PinholeCamera.from_field_of_view(1600, 900, np.radians(70.0))


def crowd(doors: int = 0) -> Table:
    """The ego below the ground, and each model at distances from 14 to 190 m, side by side in the image."""
    table = np.zeros(1 + 7 * len(NAMES), ACTOR_DTYPE)
    table["id"] = np.arange(1, 1 + len(table))
    table["z"][0] = -5.0
    table["blueprint"][1:] = np.tile(np.arange(len(NAMES)), 7)
    distance_m = np.repeat(np.geomspace(14.0, 190.0, 7), len(NAMES))
    table["x"][1:] = distance_m
    table["y"][1:] = distance_m * np.linspace(-0.6, 0.6, len(table) - 1)
    table["yaw"][1:] = np.arange(len(table) - 1)
    table["doors"] = doors
    for row, model in zip(table, [models()[0], *np.tile(np.array(models(), object), 7)], strict=True):
        row["length"], row["width"], row["height"] = model.size_m
        row["tag"] = model.tag
    return table


def models() -> list[ActorModel]:
    return [load_models()[blueprint_index()[name]] for name in NAMES]


def images(of: list[ActorModel], *tables: Table) -> CameraImages:
    """Images of the last of some tables of actors, which one renderer draws one after the other."""
    above = matrices_from_xyz_rpy(np.array([0.0, 0.0, 5.0 + 12.0]), np.array([0.0, 0.2, 0.0]))
    view = CameraView(CAMERA, above, ("semantic", "instance", "depth"))
    renderer = Renderer(scene(), of)
    worlds = [WorldState(0, 0, 1, table, np.zeros(0, SIGNAL_DTYPE), NOON) for table in tables]
    result = [renderer.render([view], RenderFrame(world, None)) for world in worlds][-1][0]
    renderer.close()
    return result


def inside(image: AnyArray) -> BoolArray:
    """Pixels whose four neighbors have the same value."""
    same = np.ones(image.shape, bool)
    for axis in (0, 1):
        for step in (1, -1):
            same &= np.roll(image, step, axis) == image
    return same


def test_coarser_meshes_change_labels_and_depth_only_at_silhouettes() -> None:
    exact = images([replace(model, build_coarser=tuple) for model in models()], crowd())
    drawn = images(models(), crowd())
    assert exact.instance is not None and drawn.instance is not None
    assert exact.semantic is not None and drawn.semantic is not None
    assert exact.depth is not None and drawn.depth is not None
    assert len(np.unique(exact.instance)) > 20
    assert (exact.instance != drawn.instance).any()  # something is coarser
    assert np.mean(exact.instance != drawn.instance) < 5e-4
    assert np.mean(exact.semantic != drawn.semantic) < 5e-4
    inner = inside(exact.instance) & (exact.instance > 0)
    off_m = np.abs(exact.depth[inner] - drawn.depth[inner])
    assert np.mean(exact.instance[inner] != drawn.instance[inner]) < 1e-3
    assert np.mean(off_m > np.maximum(0.01, 1e-3 * exact.depth[inner])) < 5e-3


def test_models_that_appear_later_are_drawn_like_those_that_were_there_from_the_start() -> None:
    few = crowd()
    few["blueprint"] = 3 * (few["blueprint"] % 2)
    at_once, later = images(models(), crowd()), images(models(), few, crowd())
    np.testing.assert_array_equal(later.instance, at_once.instance)
    np.testing.assert_array_equal(later.depth, at_once.depth)


def test_the_level_follows_the_pixel_size_and_is_exact_while_a_door_is_open() -> None:
    detail = LevelsOfDetail(models())

    def levels(table: Table, pixel_m: float) -> Int64Array:
        return detail.select_levels(table, np.full(len(table), pixel_m))

    is_person = np.array(NAMES)[crowd()["blueprint"]] == "pedestrian.woman"  # no level is without error and insides
    np.testing.assert_array_equal(levels(crowd(), 0.0), np.where(is_person, 0, 1))
    found = [int(levels(crowd(), pixel_m).max()) for pixel_m in (0.009, 0.011, 0.04, 0.08, 0.2)]
    assert found == [1, 2, 3, 4, 5]
    assert (levels(crowd(doors=1), 0.2) == 0).all()
