"""Obstacles on sidewalks agree with the meshes of the objects there."""

import numpy as np
import pytest
import shapely
from scipy.spatial import cKDTree

from simbev_ros.assets.regions.static_cache import load_static_scene, load_streetside
from simbev_ros.maps.build import load_network
from simbev_ros.maps.roads.surface import surfaces_of
from simbev_ros.maps.source import map_spec


@pytest.mark.slow
def test_every_trunk_and_pole_on_a_sidewalk_is_covered_and_nothing_else() -> None:
    spec = map_spec("Blocks")
    network = load_network(spec)
    obstacles, surfaces = load_streetside(spec, network).obstacles, surfaces_of(network.layout)
    walk = shapely.buffer(surfaces.sidewalk, -0.3)
    obstacle_points_m = []
    for tile in load_static_scene(spec, network).tiles:
        corner_m = tile.mesh.vertices[tile.mesh.triangles].astype(np.float64) + tile.origin_m
        upright = (corner_m[..., 2].min(axis=1) < 0.4) & (corner_m[..., 2].max(axis=1) > 0.35)
        at_knee_m = corner_m[upright].mean(axis=1)
        obstacle_points_m.append(at_knee_m[shapely.contains_xy(walk, at_knee_m[:, :2])])
    obstacle_points_m = np.concatenate(obstacle_points_m)
    positions_m = np.column_stack([obstacles["x"], obstacles["y"]])
    distance_m, nearest = cKDTree(positions_m).query(obstacle_points_m[:, :2])
    assert len(obstacle_points_m) > 500
    assert np.all(distance_m < obstacles["radius"][nearest] + 0.1)
    empty_m, _ = cKDTree(obstacle_points_m[:, :2]).query(positions_m[shapely.contains_xy(walk, positions_m)])
    assert np.mean(empty_m < 0.6) > 0.95
    assert np.all(obstacles["radius"] < 0.6)


@pytest.mark.slow
def test_pedestrians_pass_obstacles_on_the_side_away_from_the_road() -> None:
    spec = map_spec("Blocks")
    network = load_network(spec)
    obstacles, road = load_streetside(spec, network).obstacles, surfaces_of(network.layout).road
    positions_m = np.column_stack([obstacles["x"], obstacles["y"]])
    away = np.column_stack([obstacles["away_x"], obstacles["away_y"]])
    here, aside = (shapely.distance(road, shapely.points(positions_m + step * away)) for step in (0.0, 0.5))
    np.testing.assert_allclose(np.hypot(*away.T), 1.0)
    assert np.all(aside > here + 0.3)
