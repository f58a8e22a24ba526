import numpy as np
import pytest
from synthetic_world import EGO_ID, world

from simbev_ros.assets.actors.actor_model import ActorModel, Part
from simbev_ros.assets.actors.catalog import load_models
from simbev_ros.assets.actors.posing import pose_actors
from simbev_ros.assets.mesh.mesh import Mesh
from simbev_ros.foundation.geometry.transforms import rotations_from_rpy
from simbev_ros.foundation.semantics import Tag
from simbev_ros.foundation.types import Float64Array, Table
from simbev_ros.scene.blueprints import load_blueprints
from simbev_ros.schema.scene.state import ACTOR_DTYPE
from simbev_ros.simulation.annotation.boxes.boxes import boxes_around_ego
from simbev_ros.simulation.annotation.boxes.extents import Extents

CENTIMETER = 0.01
WITH_BOX = [index for index, blueprint in enumerate(load_blueprints()) if blueprint.box_class]
MODELS = load_models()
EXTENTS = Extents(MODELS)


def catalog(copies: int = 1) -> Table:
    """Actors of every blueprint with a box: in rest pose, on slopes, far from the map's origin."""
    random = np.random.default_rng(4)
    actors = np.zeros(copies * len(WITH_BOX), ACTOR_DTYPE)
    actors["blueprint"] = np.repeat(WITH_BOX, copies)
    actors["id"] = EGO_ID + 1 + np.arange(len(actors))
    actors["x"] = random.uniform(11_910.0, 12_090.0, len(actors))
    actors["y"] = random.uniform(-7_090.0, -6_910.0, len(actors))
    actors["yaw"] = random.uniform(-np.pi, np.pi, len(actors))
    actors["roll"], actors["pitch"] = random.normal(size=(2, len(actors))) * 0.05
    sizes_m = np.array([blueprint.size_m for blueprint in load_blueprints()])[actors["blueprint"]]
    actors["length"], actors["width"], actors["height"] = sizes_m.T
    return actors


def moving(copies: int) -> Table:
    """The actors of ``catalog`` in all kinds of motion."""
    random, actors = np.random.default_rng(5), catalog(copies)
    actors["gait"], actors["wheel"] = random.uniform(0.0, 2.0 * np.pi, (2, len(actors)))
    actors["steer"] = random.uniform(-0.6, 0.6, len(actors))
    actors["vx"] = random.uniform(0.0, 4.0, len(actors))
    return actors


def boxes_of(actors: Table, extents: Extents | None = EXTENTS) -> Table:
    """The boxes of actors, in their order."""
    ego = np.zeros(1, ACTOR_DTYPE)
    ego["id"], ego["x"], ego["y"] = EGO_ID, 12_000.0, -7_000.0
    return boxes_around_ego(world(ego, actors), 1_000.0, extents=extents)


def bounds_in_boxes(actors: Table, of: Table, doors: bool = True) -> tuple[Float64Array, Float64Array]:
    """Distance by which each actor's mesh exceeds its box's lower and upper faces, (N, 3), with or without doors."""
    below_m, above_m = np.empty((2, len(actors), 3))
    for row, box in enumerate(of):
        model = MODELS[actors["blueprint"][row]]
        center_m = np.array([box["x"], box["y"], box["z"]])
        vertices = pose_actors(MODELS, actors[row : row + 1], center_m).vertices.astype(np.float64)
        if not doors:
            is_door = np.array([part.opening_rad != 0.0 for part in model.parts])
            vertices = vertices[~is_door[model.mesh.part]]
        local_m = vertices @ rotations_from_rpy(np.array([box["roll"], box["pitch"], box["yaw"]]))
        half_m = np.array([box["length"], box["width"], box["height"]]) / 2.0
        below_m[row], above_m[row] = -half_m - local_m.min(axis=0), local_m.max(axis=0) - half_m
    return below_m, above_m


def test_at_rest_boxes_enclose_all_vertices_tightly() -> None:
    actors = catalog()
    assert len(actors) > 35
    for gaps_m in bounds_in_boxes(actors, boxes_of(actors)):
        np.testing.assert_allclose(gaps_m, 0.0, atol=1e-4)


def test_boxes_fit_strides_steered_wheels_and_handlebars() -> None:
    actors = moving(copies=8)
    found = boxes_of(actors)
    for gaps_m in bounds_in_boxes(actors, found):
        np.testing.assert_allclose(gaps_m, 0.0, atol=1e-4)
    constant = boxes_of(actors, extents=None)
    assert max(gaps_m.max() for gaps_m in bounds_in_boxes(actors, constant)) > 5 * CENTIMETER
    assert min(gaps_m.min() for gaps_m in bounds_in_boxes(actors, constant)) < -10 * CENTIMETER


def test_open_doors_do_not_change_the_box() -> None:
    actors = moving(copies=1)
    shut = boxes_of(actors)
    actors["doors"] = 255
    opened = boxes_of(actors)
    for name in ("x", "y", "z", "length", "width", "height"):
        np.testing.assert_array_equal(opened[name], shut[name])
    has_doors = np.array([load_blueprints()[index].doors > 0 for index in actors["blueprint"]])
    _, beyond_m = bounds_in_boxes(actors[has_doors], opened[has_doors])
    assert (beyond_m[:, 1] > 0.3).all()
    _, beyond_m = bounds_in_boxes(actors, opened, doors=False)
    assert beyond_m.max() < CENTIMETER


@pytest.mark.parametrize("flat", [True, False])
def test_planar_parts_are_included(flat: bool) -> None:
    corners = np.array([[[0.0, 0.0, 1.0], [2.0, 0.0, 1.0], [0.0, 1.0, 1.0 if flat else 3.0]]])
    mesh = Mesh.flat(corners, material=MODELS[0].mesh.material[0], tag=Tag.CAR, color=(0, 0, 0))
    body = Part("body", steers=True)
    extents = Extents([ActorModel("sheet", Tag.CAR, "car", mesh, (2.0, 1.0, 3.0), (body,), 0.0)])
    turned = np.zeros(2, ACTOR_DTYPE)
    turned["steer"] = [0.0, np.pi / 2]
    low_m, high_m = extents.bounds(turned)
    top_m = 1.0 if flat else 3.0
    np.testing.assert_allclose(low_m, [[0.0, 0.0, 1.0], [-1.0, 0.0, 1.0]], atol=1e-6)
    np.testing.assert_allclose(high_m, [[2.0, 1.0, top_m], [0.0, 2.0, top_m]], atol=1e-6)


def test_no_actors_give_empty_bounds() -> None:
    assert [each.shape for each in EXTENTS.bounds(np.zeros(0, ACTOR_DTYPE))] == [(0, 3), (0, 3)]


def test_bounds_follow_actors_that_move_appear_and_leave_whatever_was_asked_before() -> None:
    actors, extents, random = moving(copies=3), Extents(MODELS), np.random.default_rng(6)
    for _ in range(6):
        chosen = random.permutation(np.flatnonzero(random.random(len(actors)) < 0.7))
        for name in ("wheel", "gait", "steer", "vx", "vy", "x", "yaw"):
            actors[name][random.random(len(actors)) < 0.1] += 0.3
        expected = Extents(MODELS).bounds(actors[chosen])
        np.testing.assert_array_equal(extents.bounds(actors[chosen]), expected)
    actors["blueprint"][:] = actors["blueprint"][::-1].copy()  # the same ids in another scene
    np.testing.assert_array_equal(extents.bounds(actors), Extents(MODELS).bounds(actors))
