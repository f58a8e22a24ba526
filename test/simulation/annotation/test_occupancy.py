import math

import numpy as np
import pytest
from exact_voxels import touches, winding_numbers
from synthetic_world import EGO_ID, actor, box, box_model, mesh, sheet, static_scene, world

from simbev_ros.assets.actors.catalog import load_models
from simbev_ros.assets.actors.posing import pose_actors
from simbev_ros.assets.mesh.mesh import Mesh
from simbev_ros.foundation.geometry.transforms import apply, matrices_from_xyz_rpy
from simbev_ros.foundation.geometry.voxel_grid import VoxelGrid
from simbev_ros.foundation.semantics import Tag
from simbev_ros.foundation.types import BoolArray, Float64Array, UInt8Array
from simbev_ros.schema.voxels import dense_tags
from simbev_ros.simulation.annotation.occupancy.occupancy import OccupancyAnnotator, occupied_voxels, voxelize
from simbev_ros.simulation.annotation.occupancy.triangle_soup import Soup

GRID = VoxelGrid((-8.0, -6.0, -1.0), 0.5, (32, 24, 10))
MODELS = (box_model(Tag.CAR, (4.0, 2.0, 1.5)), box_model(Tag.PEDESTRIAN, (0.2, 0.2, 1.8)))
EGO = actor(MODELS[1], 1)


def block(x: tuple[float, float], y: tuple[float, float], z: tuple[float, float]) -> BoolArray:
    """Voxels that overlap a box in the ego frame; none of its faces may lie on a voxel border."""
    expected = np.zeros(GRID.shape, bool)
    first, last = (
        [math.floor((reach[end] - low) / GRID.voxel_m) for reach, low in zip((x, y, z), GRID.low_m, strict=True)]
        for end in (0, 1)
    )
    expected[tuple(slice(max(a, 0), b + 1) for a, b in zip(first, last, strict=True))] = True
    return expected


def tags(*meshes: Mesh, others: tuple[np.ndarray, ...] = (), ego: np.ndarray = EGO) -> UInt8Array:
    annotator = OccupancyAnnotator(static_scene(*meshes), MODELS)
    return annotator.tags(world(ego, *others), GRID, frozenset({EGO_ID}))


def test_a_box_fills_exactly_the_voxels_that_it_overlaps() -> None:
    found = tags(mesh(box([3.1, -2.2, 1.1], [4.0, 3.0, 2.0]), Tag.BUILDING))
    assert np.array_equal(found == Tag.BUILDING, block((1.1, 5.1), (-3.7, -0.7), (0.1, 2.1)))
    assert set(np.unique(found).tolist()) == {0, Tag.BUILDING}


def test_a_sheet_occupies_one_layer_and_nothing_below_it() -> None:
    found = tags(mesh(sheet([-50, -50], [50, 50], 0.2), Tag.ROAD))
    assert np.array_equal(found == Tag.ROAD, block((-7.9, 7.9), (-5.9, 5.9), (0.2, 0.2)))


def test_solids_that_extend_beyond_the_grid_are_filled_up_to_its_borders() -> None:
    found = tags(mesh(box([0.0, 0.0, 0.0], [100.0, 100.0, 100.0]), Tag.BUILDING))
    assert (found == Tag.BUILDING).all()


def test_the_ego_is_hidden_and_other_actors_are_placed_in_its_frame_for_any_pose() -> None:
    pose = matrices_from_xyz_rpy(np.array([500.0, -300.0, 40.0]), np.array([0.1, -0.2, 2.0]))
    position_m = apply(pose, np.array([[3.1, 2.3, 0.1]]))[0]
    names = dict(zip(("x", "y", "z", "roll", "pitch", "yaw"), (500.0, -300.0, 40.0, 0.1, -0.2, 2.0), strict=True))
    other = actor(MODELS[0], id=9, **(names | dict(zip("xyz", position_m, strict=True))))
    found = tags(ego=actor(MODELS[1], 1, **names), others=(other,))
    assert np.array_equal(found == Tag.CAR, block((1.1, 5.1), (1.3, 3.3), (0.1, 1.6)))
    assert set(np.unique(found).tolist()) == {0, Tag.CAR}


def test_moving_actors_take_priority_over_the_surfaces_below_them() -> None:
    road, line = (
        mesh(sheet([-50, -50], [50, 50], 0.1), Tag.ROAD),
        mesh(sheet([-50, -0.3], [50, -0.1], 0.11), Tag.ROAD_LINE),
    )
    car = actor(MODELS[0], id=9, x=3.1, y=2.3, z=0.1)
    pedestrian = actor(MODELS[1], 1, id=10, x=3.25, y=2.25, z=0.1)
    found = tags(road, line, others=(car, pedestrian))
    bottom = found[:, :, 2]
    assert (bottom[:, 11] == Tag.ROAD_LINE).all() and (bottom[:, 0] == Tag.ROAD).all()
    assert np.array_equal(found == Tag.PEDESTRIAN, block((3.2, 3.3), (2.2, 2.3), (0.1, 1.9)))
    assert np.array_equal(found == Tag.CAR, block((1.1, 5.1), (1.3, 3.3), (0.1, 1.6)) & (found != Tag.PEDESTRIAN))


def test_invisible_labeled_surfaces_occupy_nothing() -> None:
    static = static_scene(crosswalk=mesh(sheet([-5, -5], [5, 5]), Tag.ROAD))
    assert not OccupancyAnnotator(static, MODELS).tags(world(EGO), GRID, frozenset({EGO_ID})).any()


def test_a_cavity_stays_free_and_a_box_within_a_box_is_filled_once() -> None:
    outer, inner = box([0.1, 0.1, 1.6], [10.0, 8.0, 4.8]), box([0.1, 0.1, 1.6], [6.0, 5.0, 2.8])
    hollow = tags(mesh(np.concatenate([outer, inner[:, ::-1]]), Tag.BUILDING))
    assert hollow[16, 12, 5] == 0 and hollow[7, 12, 5] == Tag.BUILDING
    assert tags(mesh(np.concatenate([outer, inner]), Tag.BUILDING))[16, 12, 5] == Tag.BUILDING


def test_a_box_without_a_face_is_closed_and_one_without_three_is_a_sheet() -> None:
    faces = box([0.1, 0.1, 1.6], [6.0, 5.0, 4.0])
    order = np.argsort(np.abs(np.cross(faces[:, 1] - faces[:, 0], faces[:, 2] - faces[:, 0])[:, 2]), kind="stable")
    assert tags(mesh(faces[order[:-2]], Tag.WALL))[16, 12, 5] == Tag.WALL
    assert tags(mesh(faces[order[:6]], Tag.WALL))[16, 12, 5] == 0


def test_the_table_of_occupied_voxels_converts_back_to_the_dense_form() -> None:
    found = tags(mesh(box([3.1, -2.2, 1.1], [4.0, 3.0, 2.0]), Tag.BUILDING))
    table = occupied_voxels(found, GRID)
    assert table.dtype.names == ("x", "y", "z", "ix", "iy", "iz", "tag") and len(table) == (found > 0).sum()
    index = np.floor(apply(GRID.grid_from_ego, np.stack([table["x"], table["y"], table["z"]], axis=1)))
    assert np.array_equal(index, np.stack([table["ix"], table["iy"], table["iz"]], axis=1))
    assert np.array_equal(dense_tags(table, GRID), found)


def test_the_number_of_threads_does_not_change_the_result() -> None:
    meshes = [mesh(box([x, y, 1.0], [1.3, 1.1, 2.0]), Tag.BUILDING) for x in (-4, 0, 4) for y in (-3, 1)]
    cars = [actor(MODELS[0], id=9 + k, x=3.0 * k - 5.0, y=1.0, yaw=k) for k in range(4)]
    one, three = (
        OccupancyAnnotator(static_scene(*meshes), MODELS, threads).tags(world(EGO, *cars), GRID) for threads in (1, 3)
    )
    assert np.array_equal(one, three)


@pytest.mark.parametrize("size", [0.05, 0.7, 3.0, 40.0])
def test_surfaces_agree_with_separating_axes_in_every_voxel(size: float) -> None:
    rng = np.random.default_rng(5)
    shape = (9, 8, 7)
    centers = np.moveaxis(np.indices(shape), 0, -1).reshape(-1, 3) + 0.5
    corners = rng.uniform(-1.0, 10.0, (60, 1, 3)) + size * rng.normal(size=(60, 3, 3))
    corners[:20, :, 1] = corners[:20, :1, 1]  # some are perpendicular to an axis
    found = voxelize(_soup(corners), shape)
    expected = np.array([touches(center, 1.0, corners).any() for center in centers]).reshape(shape)
    assert np.array_equal(found > 0, expected)


@pytest.mark.parametrize(
    "name",
    [
        *(pytest.param(name, marks=pytest.mark.slow) for name in ("vehicle.pickup", "vehicle.van")),
        "vehicle.bicycle",
        "pedestrian.woman",
    ],
)
def test_actor_voxels_agree_with_winding_numbers_and_separating_axes(name: str) -> None:
    model = next(model for model in load_models() if model.blueprint == name)
    row = actor(
        model, 1, id=9, x=0.3, y=0.2, z=0.4, yaw=0.7, pitch=0.1, roll=0.05, steer=0.3, gait=1.0, vx=1.0, doors=1
    )
    grid = VoxelGrid((-4.0, -3.0, -1.0), 0.1, (80, 60, 40))
    annotator = OccupancyAnnotator(static_scene(), (MODELS[1], model))
    found = annotator.tags(world(actor(MODELS[1]), row), grid, frozenset({EGO_ID}))
    posed = pose_actors((MODELS[1], model), row, np.array(grid.low_m))
    corners = posed.vertices[posed.triangles].astype(np.float64) / grid.voxel_m
    around = np.moveaxis(np.indices(grid.shape), 0, -1).reshape(-1, 3)
    low, high = corners.min(axis=(0, 1)) - 1.0, corners.max(axis=(0, 1))
    around = around[((around > low) & (around < high)).all(axis=1)]
    sample = np.random.default_rng(2).choice(around, 400)
    low, high = corners.min(axis=1), corners.max(axis=1)
    expected = np.zeros(len(sample), bool)
    for index, voxel in enumerate(sample):
        near = corners[((low <= voxel + 1) & (high >= voxel)).all(axis=1)]
        expected[index] = touches(voxel + 0.5, 1.0, near).any()
    expected |= winding_numbers(sample + 0.5, corners) > 0.5
    assert 0.05 < expected.mean() < 0.95
    assert np.array_equal(found[tuple(sample.T)] == model.tag, expected)


def _soup(corners: Float64Array) -> Soup:
    """Open surfaces of rank 1 from (T, 3, 3) corners in voxels."""
    points = corners.reshape(-1, 3).T.astype(np.float32)
    triangles = np.arange(points.shape[1]).reshape(-1, 3).T
    return Soup(points, np.ones(points.shape[1], np.uint8), triangles, np.zeros(len(corners), bool))
