"""Hazard areas in the simulation: traffic flows around them, and their vehicles and props are in every table."""

from functools import cache

import numpy as np
import pytest
import shapely

from simbev_ros.config.rig import Rig
from simbev_ros.config.scenario import Scenario
from simbev_ros.foundation.types import AnyArray, Table
from simbev_ros.maps.build import load_network
from simbev_ros.scene.blueprints import load_blueprints
from simbev_ros.scene.drawing.draw_scene import PlannedScene, draw_scene
from simbev_ros.schema.scene.hazard import HazardKind
from simbev_ros.schema.scene.map_spec import MapSpec
from simbev_ros.schema.scene.spec import SceneSpec
from simbev_ros.schema.scene.state import Light
from simbev_ros.simulation.world.simulation import Simulation

TOWN = MapSpec(name="Town06", seed=0)
STRIDE = 4  # of the checked ticks
PASSING_DISTANCE_M = 8.0


def scene(accident_share: float, vehicles: int, duration_s: float) -> SceneSpec:
    scenario = Scenario.model_validate(
        {
            "seed": 2,
            "scenes": [{"map": TOWN.name, "train": 1}],
            "rig": Rig(sensors=()),
            "time": {"duration_s": duration_s},
            "ego": {"reckless_probability": 0},
            "traffic": {
                "vehicles": vehicles,
                "pedestrians": 0,
                "spawn_radius_m": 250,
                "reckless_probability": 0,
                "distracted_probability": 0,
            },
            "hazards": {"count": 2, "accident_share": accident_share, "emergency_vehicle_probability": 1},
        }
    )
    return draw_scene(scenario, PlannedScene(0, TOWN, "train"), load_network(TOWN))


@cache
def states(accident_share: float, vehicles: int = 20, duration_s: float = 2.0) -> tuple[SceneSpec, Table]:
    """A scene and the (T, N) actors of every ``STRIDE``-th tick."""
    spec = scene(accident_share, vehicles, duration_s)
    with Simulation(spec, load_network(TOWN)) as simulation:
        tables = [simulation.step().actors for _ in range(spec.warm_up_ticks + spec.ticks)]
    return spec, np.stack(tables[::STRIDE])


def footprints(actors: Table) -> AnyArray:
    """(N,) footprint polygons."""
    ahead = np.stack([np.cos(actors["yaw"]), np.sin(actors["yaw"])], axis=1) * actors["length"][:, None] / 2.0
    left = np.stack([-np.sin(actors["yaw"]), np.cos(actors["yaw"])], axis=1) * actors["width"][:, None] / 2.0
    center = np.stack([actors["x"], actors["y"]], axis=1)
    corners = [center + ahead + left, center - ahead + left, center - ahead - left, center + ahead - left]
    return np.asarray(shapely.polygons(np.stack(corners, axis=1)), object)


@pytest.mark.slow
def test_traffic_passes_work_zones_and_keeps_off_them() -> None:
    spec, tables = states(accident_share=0.0, vehicles=100, duration_s=45.0)
    outlines = np.array([shapely.Polygon(hazard.outline_m) for hazard in spec.hazards])
    passed: list[set[int]] = [set() for _ in outlines]
    for actors in tables:
        driving = actors[actors["id"] <= len(spec.drivers)]
        shapes = footprints(driving)
        for zone, outline in enumerate(outlines):
            is_on_level = np.abs(driving["z"] - spec.hazards[zone].z_m) < 3.0
            assert not (shapely.intersects(outline, shapes) & is_on_level).any()
            passed[zone].update(
                driving["id"][is_on_level & shapely.dwithin(outline, shapes, PASSING_DISTANCE_M)].tolist()
            )
    assert min(map(len, passed)) >= 5


def test_vehicles_and_props_of_a_hazard_are_in_every_table_lit_and_on_the_ground() -> None:
    spec, tables = states(accident_share=1.0)
    blueprints = np.array(load_blueprints(), object)
    first, last = len(spec.drivers) + 1, len(spec.vehicles)
    standing = tables[:, (tables["id"][0] >= first) & (tables["id"][0] <= last)]
    props = tables[:, [blueprint.kind == "prop" for blueprint in blueprints[tables["blueprint"][0]]]]
    specified = [prop for hazard in spec.hazards for prop in hazard.props]
    assert standing.shape[1] == last - first + 1 and props.shape[1] == len(specified)
    for rows in (standing, props):
        poses = np.stack([rows[name] for name in ("x", "y", "z", "yaw", "vx", "vy", "wz", "doors")])
        assert np.ptp(poses, axis=1).max() < 1e-9
    assert np.all(np.diff(tables["id"].astype(np.int64), axis=1) > 0)
    stands = [vehicle.stands_at for vehicle in spec.vehicles[first - 1 :] if vehicle.stands_at is not None]
    center_m = np.array([(stand.x_m, stand.y_m) for stand in stands])
    assert np.allclose(np.stack([standing["x"][0], standing["y"][0]], axis=1), center_m, atol=0.01)
    assert standing["doors"][0].tolist() == [stand.open_doors for stand in stands]
    z_m = np.array([prop.z_m for prop in specified])
    assert np.abs(props["z"][0] - z_m).max() < 0.5
    lights = np.bitwise_or.reduce(standing["lights"], axis=0)
    flashing = [bool(bits & Light.TURN_LEFT and bits & Light.TURN_RIGHT) for bits in lights.tolist()]
    assert flashing == [stand.hazard_lights for stand in stands]
    blue = [bool(bits & Light.EMERGENCY) for bits in lights.tolist()]
    assert blue == [vehicle.emergency_lights for vehicle in spec.vehicles[first - 1 :]] and sum(blue) == 2
    assert all(hazard.kind is HazardKind.ACCIDENT for hazard in spec.hazards)
