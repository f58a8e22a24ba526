"""Pedestrians visit plazas: they walk there along paths, stop, and return to a sidewalk."""

from functools import cache

import numpy as np
import open3d as o3d
import pytest
import shapely
from scene_edits import with_ego
from world_scenes import of_kind

from simbev_ros.assets.regions.static_cache import load_static_scene, load_streetside
from simbev_ros.config.rig import Rig
from simbev_ros.config.scenario import Scenario
from simbev_ros.maps.build import load_network
from simbev_ros.maps.roads.surface import surfaces_of
from simbev_ros.maps.source import map_spec
from simbev_ros.scene.drawing.draw_scene import draw_scene, planned_scenes
from simbev_ros.simulation.world.demand import demand_of
from simbev_ros.simulation.world.simulation import Simulation

pytestmark = pytest.mark.slow

TOWN = "Town15"  # a campus in the hills
TICK_S = 0.1


@cache
def plazas():
    return load_streetside(map_spec(TOWN), load_network(map_spec(TOWN))).plazas


def draw_town(seed, duration_s, **traffic):
    scenario = Scenario.model_validate(
        {
            "seed": seed,
            "scenes": [{"map": TOWN, "train": 1}],
            "rig": Rig(sensors=()),
            "time": {"tick_s": TICK_S, "duration_s": duration_s},
            "hazards": {"count": 0},
            "traffic": {
                "vehicles": 1,
                "pedestrians": 120,
                "walker_cross_factor": 0.0,
                "group_probability": 0.0,
                **traffic,
            },
        }
    )
    planned = next(planned_scenes(scenario))
    return draw_scene(scenario, planned, load_network(planned.map))


def simulate(spec):
    """(T, P) pedestrians."""
    network = load_network(spec.map)
    with Simulation(spec, network, load_streetside(spec.map, network).obstacles, plazas()) as simulation:
        states = [simulation.step().actors for _ in range(spec.warm_up_ticks + spec.ticks)]
    return of_kind(np.stack(states), "pedestrian")


@cache
def minute():
    """(T, P) pedestrians over a minute, and whether each is on a plaza, beyond the sidewalk."""
    pedestrians = simulate(draw_town(31, 56.0, plaza_probability=1.0))
    paved = shapely.difference(shapely.union_all([plaza.free for plaza in plazas()]), walkable().buffer(0.5))
    shapely.prepare(paved)
    return pedestrians, shapely.contains_xy(paved, pedestrians["x"].astype(float), pedestrians["y"].astype(float))


@cache
def walkable():
    surfaces = surfaces_of(load_network(map_spec(TOWN)).layout)
    return shapely.union(surfaces.sidewalk, surfaces.crosswalk)


def speed_mps(pedestrians):
    return np.hypot(pedestrians["vx"], pedestrians["vy"])


def test_visitors_reach_plazas_stop_there_and_return_to_the_sidewalk():
    pedestrians, paved = minute()
    visitors = paved.any(axis=0)
    assert np.count_nonzero(visitors) > 10
    assert paved[0].any()  # some are there from the start
    stop_s = np.sum(paved & (speed_mps(pedestrians) < 0.02), axis=0) * TICK_S
    assert np.count_nonzero(stop_s > 2.0) > 8
    sidewalk = walkable().buffer(0.1)
    shapely.prepare(sidewalk)
    on_sidewalk = shapely.contains_xy(sidewalk, pedestrians["x"].astype(float), pedestrians["y"].astype(float))
    walks_on_s = np.sum(on_sidewalk & (speed_mps(pedestrians) > 0.3) & (np.cumsum(paved, axis=0) > 0), axis=0) * TICK_S
    assert np.count_nonzero(walks_on_s > 3.0) > 2


def test_visitors_stand_on_the_visible_paving():
    pedestrians, paved = minute()
    position_m = np.stack([pedestrians[name][paved] for name in ("x", "y", "z")], axis=-1)[::5].astype(np.float32)
    rays = np.concatenate(
        [position_m + np.float32([0, 0, 0.5]), np.tile(np.float32([0, 0, -1]), (len(position_m), 1))], axis=1
    )
    scene = o3d.t.geometry.RaycastingScene()
    for tile in load_static_scene(map_spec(TOWN), load_network(map_spec(TOWN))).tiles:
        vertices = (tile.mesh.vertices + tile.origin_m).astype(np.float32)
        scene.add_triangles(vertices, tile.mesh.triangles.astype(np.uint32))
    below_m = scene.cast_rays(rays)["t_hit"].numpy() - 0.5
    assert len(below_m) > 500
    assert np.mean(np.abs(below_m) < 0.03) > 0.99


def test_visitors_keep_to_paving_and_sidewalks_clear_of_obstacles():
    pedestrians, paved = minute()
    pedestrians = pedestrians[:, paved.any(axis=0)]
    free = shapely.union_all([walkable().buffer(0.3), *(plaza.free.buffer(0.25) for plaza in plazas())])
    shapely.prepare(free)
    inside = shapely.contains_xy(free, pedestrians["x"].astype(float), pedestrians["y"].astype(float))
    assert np.mean(inside) > 0.999


def test_visitors_neither_jump_nor_spin():
    pedestrians, paved = minute()
    visitors = pedestrians[:, paved.any(axis=0)]
    position_m = np.stack([visitors[name] for name in ("x", "y", "z")], axis=-1).astype(np.float64)
    assert np.linalg.norm(np.diff(position_m, axis=0), axis=-1).max() < 1.4 * 2.3 * TICK_S
    acceleration_mps2 = np.linalg.norm(np.stack([visitors[name] for name in ("ax", "ay", "az")], axis=-1), axis=-1)
    assert acceleration_mps2.max() < 5.0
    assert np.abs(visitors["wz"]).max() < 2.5


def test_the_same_seed_gives_the_same_bytes_with_plazas():
    spec = draw_town(32, 8.0, plaza_probability=1.0)
    first, second = simulate(spec), simulate(spec)
    assert first.tobytes() == second.tobytes()


def test_pedestrians_without_plazas_to_visit_stay_on_the_network():
    network = load_network(map_spec(TOWN))
    visitors_spec, others_spec = (draw_town(33, 16.0, plaza_probability=probability) for probability in (1.0, 0.0))
    assert demand_of(visitors_spec, network, plazas()).excursions
    assert not demand_of(visitors_spec, network).excursions
    assert not demand_of(others_spec, network, plazas()).excursions


def test_the_drawn_share_visits_plazas_but_runners_do_not():
    spec = draw_town(34, 16.0, pedestrians=300, plaza_probability=0.4)
    walks = np.array([each.max_speed_mps < 2.0 for each in spec.pedestrians])
    visits = np.array([each.visits_plazas for each in spec.pedestrians])
    assert np.mean(visits[walks]) == pytest.approx(0.4, abs=0.07)
    assert not any(each.visits_plazas for each in spec.pedestrians if each.max_speed_mps > 2.6)


def test_an_ego_driven_from_outside_works_with_visitors_who_start_on_plazas():
    spec = with_ego(draw_town(31, 56.0, plaza_probability=1.0), driver="twist")
    network = load_network(spec.map)
    assert any(legs[0].starts_at_stop for legs in demand_of(spec, network, plazas()).excursions.values())
    with Simulation(spec, network, plazas=plazas()) as simulation:
        simulation.drive_vehicle(0, 1.0, 0.0)
        assert len(simulation.step().actors) > 80
