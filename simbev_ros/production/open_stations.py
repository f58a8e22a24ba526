"""Finds roadside units that something solid encloses: masts are drawn by the roads, without trees and walls."""

from collections.abc import Iterator

import numpy as np

from simbev_ros.assets.regions.static_cache import load_static_scene
from simbev_ros.config.camera import Camera
from simbev_ros.config.lidar import Lidar
from simbev_ros.config.radar import Radar
from simbev_ros.config.scenario import Scenario
from simbev_ros.foundation.geometry.transforms import apply, matrices_from_xyz_rpy
from simbev_ros.maps.build import load_network
from simbev_ros.maps.region import Reach
from simbev_ros.production.observer import ProductionObserver
from simbev_ros.production.surroundings import build_surroundings
from simbev_ros.schema.scene.agent_spec import AgentSpec
from simbev_ros.schema.scene.map_spec import MapSpec
from simbev_ros.schema.scene.spec import SceneSpec

_REACH_M = 150.0  # each object is stored in the region of its center
_CLOSE_M, _MIN_OPEN_SHARE = 3.0, 0.6
_LOWEST_M = 1.5  # lower sensors see the ground close to them


def enclosed_units(scenario: Scenario, spec: SceneSpec, observer: ProductionObserver) -> Iterator[str]:
    """Yield words about each roadside unit in a drawn place that lacks a free view; surroundings are built for it."""
    masts = [agent for agent in scenario.agents if agent.mast is not None and agent.mast.drawn_place is not None]
    names = {name for agent in masts for name in agent.names(agent.max_count)}
    for unit in spec.agents:
        if unit.name in names and any(unit.rig.of_type(kind) for kind in (Camera, Lidar, Radar)):
            build_surroundings([spec], observer)
            if (share := open_share(spec.map, unit)) < _MIN_OPEN_SHARE:
                yield f"{unit.name}: {1.0 - share:.0%} of the view ends within {_CLOSE_M:g} m"


def open_share(map_spec: MapSpec, unit: AgentSpec) -> float:
    """Share of level rays that meet nothing close, for that of a roadside unit's sensors with the least free view."""
    from simbev_ros.simulation.raycast.embree import relative_rays  # takes long to load and is seldom needed
    from simbev_ros.simulation.raycast.static import StaticTriangles

    station, sensors = unit.station, [each for each in unit.rig.sensors if isinstance(each, Camera | Lidar | Radar)]
    assert station is not None
    foot_m = np.array([station.x_m, station.y_m, station.z_m])
    mounts_m = np.array([sensor.pose.ego_from_sensor[:3, 3] for sensor in sensors])
    mounts_m[:, 2] = np.maximum(mounts_m[:, 2], _LOWEST_M)
    origins_m = apply(matrices_from_xyz_rpy(foot_m, np.array([0.0, 0.0, station.yaw_rad])), mounts_m)
    reach = Reach((station.x_m, station.y_m), _REACH_M)
    static = StaticTriangles(load_static_scene(map_spec, load_network(map_spec), reach=reach))
    azimuth_rad, elevation_rad = np.radians(np.mgrid[0:360:5, -15:21:5].reshape(2, -1))
    level = np.cos(elevation_rad)
    directions = np.stack([level * np.cos(azimuth_rad), level * np.sin(azimuth_rad), np.sin(elevation_rad)], axis=1)
    shares = []
    for origin_m in origins_m:
        near = static.triangles_around(origin_m, _CLOSE_M)
        hits = near.triangles.cast(relative_rays(origin_m[None], near.origin_m, directions.astype(np.float32)))
        shares.append(float(np.mean(hits.range_m > _CLOSE_M)))
    return min(shares)
