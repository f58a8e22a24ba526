import numpy as np
import pytest
from synthetic_world import actor, box_model

from simbev_ros.assets.actors.catalog import load_models
from simbev_ros.assets.actors.posing import pose_actors
from simbev_ros.foundation.geometry.grid import BevGrid
from simbev_ros.foundation.semantics import Tag
from simbev_ros.foundation.types import BoolArray, Float64Array, Table
from simbev_ros.schema.scene.state import ACTOR_DTYPE
from simbev_ros.simulation.annotation.bev.actor_plans import ActorPlans
from simbev_ros.simulation.annotation.bev.raster import corners_near_centers, covered_cells

MODELS = load_models()
PLANS = ActorPlans(MODELS)
EGO_M, EGO_YAW_RAD = np.array([9000.0, -4000.0]), 0.7


def crowd(random: np.random.Generator, reach_m: float) -> Table:
    """Two actors of every model in all kinds of motion, tilted and with open doors, up to a distance from the ego."""
    actors = np.zeros(2 * len(MODELS), ACTOR_DTYPE)
    actors["blueprint"] = random.permutation(np.repeat(np.arange(len(MODELS)), 2))
    actors["x"], actors["y"] = EGO_M[:, None] + random.uniform(-reach_m, reach_m, (2, len(actors)))
    for name in ("roll", "pitch", "steer"):
        actors[name] = random.normal(0.0, 0.2, len(actors))
    for name in ("yaw", "wheel", "gait", "vx"):
        actors[name] = random.uniform(0.0, 6.0, len(actors))
    actors["doors"] = random.integers(0, 16, len(actors))
    actors["length"], actors["width"], _ = np.array([model.size_m for model in MODELS])[actors["blueprint"]].T
    return actors


def covered(corners: Float64Array, grid: BevGrid) -> BoolArray:
    return covered_cells(corners, np.zeros(corners.shape[2], np.uint8), (1, grid.rows, grid.columns))[0]


@pytest.mark.parametrize(("rows", "columns", "cell_m"), [(200, 240, 0.4), (90, 400, 0.15), (1, 1, 30.0)])
def test_the_triangles_cover_the_same_cells_as_all_triangles_of_the_posed_meshes(
    rows: int, columns: int, cell_m: float
) -> None:
    grid, random = BevGrid(rows, columns, cell_m), np.random.default_rng(rows)
    actors, cells_from_map = crowd(random, 60.0), grid.cells_from_map(EGO_M, EGO_YAW_RAD)
    corners, row = PLANS.corners_near_centers(actors, cells_from_map, grid)
    posed = pose_actors(MODELS, actors, np.array([*EGO_M, 0.0]))
    points = cells_from_map[:, :2] @ (posed.vertices[:, :2].T + EGO_M[:, None]) + cells_from_map[:, 2:]
    for chosen in (np.arange(len(actors)), *np.arange(8)[:, None]):
        triangles = posed.triangles[np.isin(posed.triangle_row, chosen)]
        expected, _ = corners_near_centers(points, triangles, grid.rows, grid.columns)
        assert np.array_equal(covered(corners[:, :, np.isin(row, chosen)], grid), covered(expected, grid))


def test_no_triangle_is_returned_that_contains_no_center_in_its_bounding_rectangle() -> None:
    grid = BevGrid(200, 200, 0.4)
    corners, _ = PLANS.corners_near_centers(
        crowd(np.random.default_rng(1), 60.0), grid.cells_from_map(EGO_M, EGO_YAW_RAD), grid
    )
    first, last = np.ceil(corners.min(axis=1)).clip(0), np.floor(corners.max(axis=1)).clip(max=199)
    assert corners.shape[2] > 10_000
    assert (first <= last).all()


def test_actors_beside_the_grid_have_no_triangles() -> None:
    models, grid = (box_model(Tag.CAR, (4.0, 2.0, 1.5)),), BevGrid(20, 20, 1.0)
    plans, cells_from_map = ActorPlans(models), grid.cells_from_map(np.zeros(2), 0.0)
    beside, across = actor(models[0], id=8, x=13.0), actor(models[0], id=9, y=10.0)
    for actors in (np.zeros(0, ACTOR_DTYPE), beside):
        corners, row = plans.corners_near_centers(actors, cells_from_map, grid)
        assert corners.shape == (2, 3, 0)
        assert not len(row)
    corners, row = plans.corners_near_centers(np.concatenate([beside, across]), cells_from_map, grid)
    assert set(row.tolist()) == {1}
    assert np.argwhere(covered(corners, grid)).tolist() == [[8, 0], [9, 0], [10, 0], [11, 0]]


def test_models_that_are_not_the_cached_catalog_have_the_same_triangles() -> None:
    actors, grid = crowd(np.random.default_rng(2), 30.0), BevGrid(150, 150, 0.4)
    cells_from_map = grid.cells_from_map(EGO_M, EGO_YAW_RAD)
    found, row = ActorPlans([*MODELS]).corners_near_centers(actors, cells_from_map, grid)
    cached, row_cached = PLANS.corners_near_centers(actors, cells_from_map, grid)
    assert np.array_equal(found, cached)
    assert np.array_equal(row, row_cached)
