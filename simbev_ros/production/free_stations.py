"""Checks that the masts of roadside units, at poses that a configuration names, do not stand in buildings."""

from collections.abc import Iterator, Sequence
from functools import lru_cache

import numpy as np

from simbev_ros.assets.mesh.mesh import Mesh
from simbev_ros.assets.regions.static_cache import StaticCache
from simbev_ros.config.places import poses_on
from simbev_ros.config.scenario import Scenario
from simbev_ros.foundation.errors import InputError
from simbev_ros.foundation.semantics import Tag
from simbev_ros.foundation.types import Float64Array
from simbev_ros.maps.build import load_network
from simbev_ros.maps.region import Reach, regions_of
from simbev_ros.schema.scene.map_spec import MapSpec
from simbev_ros.schema.scene.spec import SceneSpec

_MAX_BUILDING_M = 150.0
"""Distance at which no building that covers a point is stored: each one is in the region with its center."""

_FootM = tuple[float, float, float]


def require_free_stations(scenario: Scenario, specs: Sequence[SceneSpec]) -> None:
    """Check that no roadside unit stands in a building. One with its foot on a roof is not in the building.

    Args:
        scenario: The configuration.
        specs: Scenes that were drawn from it; their surroundings are built.

    Raises:
        InputError: The foot of a mast is in a building.
    """
    for spec in specs:
        for words, foot_m in _feet(scenario, spec):
            if _is_in_building(spec.map, foot_m):
                x_m, y_m, _ = foot_m
                raise InputError(f"{words}: ({x_m:g}, {y_m:g}) is inside a building of map {spec.map.name}")


def _feet(scenario: Scenario, spec: SceneSpec) -> Iterator[tuple[str, _FootM]]:
    """For each station at a pose of the configuration, the words for this pose, and its foot, map frame."""
    stations = [agent.station for agent in spec.agents if agent.station is not None]
    for number, agent in enumerate(scenario.agents):
        keys, poses = ((), ()) if agent.mast is None else poses_on(agent.mast.poses, spec.map.name)
        for index, pose in enumerate(poses):
            for station in stations:
                if (station.x_m, station.y_m) == (pose.x_m, pose.y_m):
                    words = scenario.where("agents", number, "mast", "poses", *keys, index)
                    yield words, (station.x_m, station.y_m, station.z_m)


@lru_cache(maxsize=256)
def _is_in_building(spec: MapSpec, foot_m: _FootM) -> bool:
    """Whether a part of a building is above a foot."""
    network = load_network(spec)
    cache, around = StaticCache(spec, network), Reach(foot_m[:2], _MAX_BUILDING_M)
    return any(
        is_below_building(np.array(foot_m) - tile.origin_m, tile.mesh)
        for region in regions_of(network.layout, around)
        for tile in cache.region(region).tiles
    )


def is_below_building(point_m: Float64Array, mesh: Mesh) -> bool:
    """Whether a part of a building in a mesh is straight above a (3,) point of the mesh's frame."""
    (west_m, south_m, _), (east_m, north_m, _) = mesh.bounds_m
    if not (west_m <= point_m[0] <= east_m and south_m <= point_m[1] <= north_m):
        return False
    corners_m = mesh.vertices[mesh.triangles[mesh.triangle_tag == Tag.BUILDING]].astype(np.float64) - point_m
    edges_m = np.roll(corners_m, -1, axis=1)
    # Twice the areas, in plan, of the triangles between the point and each side; their shares weigh the corners.
    areas_m2 = corners_m[:, :, 0] * edges_m[:, :, 1] - corners_m[:, :, 1] * edges_m[:, :, 0]
    is_around = np.all(areas_m2 >= 0, axis=1) | np.all(areas_m2 <= 0, axis=1)
    areas_m2, corners_m = areas_m2[is_around], corners_m[is_around]
    total_m2 = areas_m2.sum(axis=1)
    above_m2 = (np.roll(areas_m2, -1, axis=1) * corners_m[:, :, 2]).sum(axis=1)
    return bool(np.any(np.where(total_m2 > 0, above_m2 > 0, above_m2 < 0) & (total_m2 != 0)))
