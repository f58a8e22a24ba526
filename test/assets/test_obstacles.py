"""What stands on sidewalks, against the meshes themselves."""

import numpy as np
import shapely
from scipy.spatial import cKDTree

from simbev_ros.assets.regions.static_cache import load_static_scene, load_streetside
from simbev_ros.maps.build import load_network
from simbev_ros.maps.roads.surface import surfaces_of
from simbev_ros.maps.source import map_spec


def test_every_trunk_and_pole_on_a_sidewalk_is_covered_and_nothing_else() -> None:
    spec = map_spec("Blocks")
    network = load_network(spec)
    obstacles, surfaces = load_streetside(spec, network).obstacles, surfaces_of(network.layout)
    walk = shapely.buffer(surfaces.sidewalk, -0.3)
    stands_m = []
    for tile in load_static_scene(spec, network).tiles:
        corner_m = tile.mesh.vertices[tile.mesh.triangles].astype(np.float64) + tile.origin_m
        upright = (corner_m[..., 2].min(axis=1) < 0.4) & (corner_m[..., 2].max(axis=1) > 0.35)
        at_knee_m = corner_m[upright].mean(axis=1)
        stands_m.append(at_knee_m[shapely.contains_xy(walk, at_knee_m[:, :2])])
    stands_m = np.concatenate(stands_m)
    places_m = np.column_stack([obstacles["x"], obstacles["y"]])
    distance_m, nearest = cKDTree(places_m).query(stands_m[:, :2])
    assert len(stands_m) > 500
    assert np.all(distance_m < obstacles["radius"][nearest] + 0.1)
    empty_m, _ = cKDTree(stands_m[:, :2]).query(places_m[shapely.contains_xy(walk, places_m)])
    assert np.mean(empty_m < 0.6) > 0.95
    assert np.all(obstacles["radius"] < 0.6)


def test_people_pass_on_the_side_away_from_the_road() -> None:
    spec = map_spec("Blocks")
    network = load_network(spec)
    obstacles, road = load_streetside(spec, network).obstacles, surfaces_of(network.layout).road
    places_m = np.column_stack([obstacles["x"], obstacles["y"]])
    away = np.column_stack([obstacles["away_x"], obstacles["away_y"]])
    here, aside = (shapely.distance(road, shapely.points(places_m + step * away)) for step in (0.0, 0.5))
    np.testing.assert_allclose(np.hypot(*away.T), 1.0)
    assert np.all(aside > here + 0.3)
