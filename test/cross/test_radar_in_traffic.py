"""Radars in simulated traffic: measured speeds equal the change of distances from tick to tick."""

import numpy as np
import pytest

from simbev_ros.assets.actors.catalog import load_models
from simbev_ros.assets.regions.static_cache import load_static_scene
from simbev_ros.config.load import load_scenario
from simbev_ros.config.radar import Radar
from simbev_ros.config.traffic import Traffic
from simbev_ros.foundation.geometry.transforms import apply, inverse
from simbev_ros.foundation.types import Float64Array, Table, UInt32Array
from simbev_ros.maps.build import load_network
from simbev_ros.scene.drawing.draw_scene import draw_scene, planned_scenes
from simbev_ros.schema.scene.state import WorldState, map_from_actors
from simbev_ros.simulation.raycast.scene import RayScene
from simbev_ros.simulation.sensors.mount import map_from_sensor, vector
from simbev_ros.simulation.sensors.radar import RadarModel, scan_radars
from simbev_ros.simulation.world.simulation import Simulation

AROUND_TICK = 20


@pytest.fixture(scope="module")
def scene() -> tuple[list[RadarModel], RayScene, list[WorldState]]:
    """Radars of the demo rig, and three consecutive ticks."""
    scenario = load_scenario("demo").model_copy(
        update={"traffic": Traffic(vehicles=60, pedestrians=120, spawn_radius_m=250)}
    )
    planned = next(planned_scenes(scenario))
    network = load_network(planned.map)
    spec = draw_scene(scenario, planned, network)
    models = [RadarModel(radar, spec.seed, 0.05) for radar in spec.agents[0].rig.of_type(Radar)]
    with Simulation(spec, network) as simulation:
        states = [simulation.step() for _ in range(spec.warm_up_ticks + AROUND_TICK + 2)][-3:]
    rays = RayScene(load_static_scene(planned.map, network), load_models())
    rays.update(states[1], vector(states[1].ego, "x y z"), 125.0, states[1].ego_ids)
    return models, rays, states


def hit_actors(model: RadarModel, rays: RayScene, state: WorldState) -> UInt32Array:
    """Ids of the actors that a radar's detections are on."""
    pose = map_from_sensor(model.radar.pose, state)
    hits = rays.cast(pose[None, :3, 3], model.directions(state.tick) @ pose[:3, :3].T)
    return hits.object_id[hits.range_m <= model.radar.range_m]


def distances_m(model: RadarModel, cloud: Table, ids: UInt32Array, now: WorldState, other: WorldState) -> Float64Array:
    """Distances from the radar to the detected points at another tick; points are fixed to their actors."""
    points_m = apply(map_from_sensor(model.radar.pose, now), np.stack([cloud[axis] for axis in "xyz"], 1).astype(float))
    for actor in np.unique(ids[ids > 0]):
        here, there = (map_from_actors(state.actors[state.actors["id"] == actor])[0] for state in (now, other))
        points_m[ids == actor] = apply(there @ inverse(here), points_m[ids == actor])
    return np.linalg.norm(points_m - map_from_sensor(model.radar.pose, other)[:3, 3], axis=1)


@pytest.mark.slow
def test_doppler_is_the_change_of_distance_from_tick_to_tick(
    scene: tuple[list[RadarModel], RayScene, list[WorldState]],
) -> None:
    models, rays, (before, now, after) = scene
    speeds, on_actors = [], 0
    for model, cloud in zip(models, scan_radars(models, rays, now, before), strict=True):
        ids = hit_actors(model, rays, now)
        distance_m = [distances_m(model, cloud, ids, now, other) for other in (before, after)]
        rate_mps = (distance_m[1] - distance_m[0]) / (after.stamp_ns - before.stamp_ns) * 1e9
        far = distance_m[0] > 4.0  # the mean rate of two ticks is that of the moment, unless what is passed is near
        error_mps = np.abs(rate_mps - cloud["doppler_velocity"])[far]
        assert np.quantile(error_mps, 0.99) < 0.04, model.radar.name
        assert np.median(error_mps) < 0.02
        speeds.append(cloud["doppler_velocity"])
        on_actors += int((ids > 0).sum())
    assert on_actors > 300
    assert np.ptp(np.concatenate(speeds)) > 10.0
