"""Roadside units in drawn places stand outside everything solid and see the street; others are drawn again."""

from types import SimpleNamespace

import numpy as np
import pytest
from made_up_scene import made_up_spec
from several_agents import roadside_unit, with_agents
from synthetic_world import actor, box, cart_model, mesh, sheet, static_scene, world

from simbev_ros.assets.mesh.mesh import Mesh
from simbev_ros.assets.regions.static_cache import load_static_scene
from simbev_ros.config.lidar import Lidar
from simbev_ros.config.load import parse_scenario
from simbev_ros.config.scenario import Scenario
from simbev_ros.foundation.errors import InputError
from simbev_ros.foundation.semantics import Tag
from simbev_ros.maps.build import load_network
from simbev_ros.maps.region import Reach
from simbev_ros.production import drawing, open_stations
from simbev_ros.production.drawing import draw_scenes
from simbev_ros.production.events import SceneRefused
from simbev_ros.production.open_stations import open_share
from simbev_ros.scene.drawing.draw_scene import draw_scene, planned_scenes
from simbev_ros.schema.scene.agents import AgentView, agent_views
from simbev_ros.schema.scene.spec import SceneSpec
from simbev_ros.simulation.raycast.embree import TriangleSet, relative_rays
from simbev_ros.simulation.raycast.scene import RayScene
from simbev_ros.simulation.raycast.static import StaticTriangles
from simbev_ros.simulation.sensors.lidar import LidarModel

TEXT = """scenes: [{{map: {town}, train: {scenes}}}]
time: {{warm_up_s: 1, duration_s: 1}}
weather: {{season: summer}}
rig: {{sensors: []}}
traffic: {{vehicles: 0, pedestrians: 0}}
agents:
  - name: rsu
    rig:
      sensors: [{{type: lidar, name: lidar, channels: 32, columns: 180, lower_fov_deg: -30, upper_fov_deg: 10}}]
      drawn: {{lidar: {{pose.z_m: {{uniform: [0, 3]}}}}}}
    count: 4
    mast: {{junction: {{near: {{distance_m: 150, tolerance_m: 150}}}}, height_m: 4}}
"""


def scenario_in(town: str, scenes: int) -> Scenario:
    return parse_scenario(TEXT.format(town=town, scenes=scenes), "my.yaml")


def units_of(spec: SceneSpec) -> list[AgentView]:
    return [view for view in agent_views(spec) if view.station is not None]


@pytest.mark.slow
@pytest.mark.parametrize("town", ["Town05", "Town02"])
def test_lidars_of_drawn_units_are_outside_all_meshes_and_see_the_street(town: str) -> None:
    """Town05 has poles of traffic lights at its junctions, Town02 trees and walls."""
    rng = np.random.default_rng(7)
    azimuth_rad, z = rng.uniform(-np.pi, np.pi, 3000), rng.uniform(-0.35, 0.35, 3000)
    level = np.sqrt(1.0 - z**2)
    rays = np.stack([level * np.cos(azimuth_rad), level * np.sin(azimuth_rad), z], axis=1).astype(np.float32)
    for view in [view for spec in draw_scenes(scenario_in(town, 3)) for view in units_of(spec)]:
        station, (lidar,) = view.station, view.rig.of_type(Lidar)
        assert station is not None
        origin_m = np.array([station.x_m, station.y_m, station.z_m + lidar.pose.z_m])
        reach = Reach((station.x_m, station.y_m), 200.0)
        static = load_static_scene(view.scene.map, load_network(view.scene.map), reach=reach)
        solid, center_m = StaticTriangles(static).mesh_around(origin_m, 60.0)
        cast = TriangleSet(solid.vertices, solid.triangles).cast
        range_m = cast(relative_rays(origin_m[None], center_m, rays)).range_m
        assert range_m.min() > 0.1 and np.mean(range_m > 3.0) > 0.5
        scene, state = RayScene(static, (cart_model(),)), view.ego_state(world(actor(cart_model(), x=1e5)))
        scene.update(state, origin_m, lidar.range_m)
        points = LidarModel(lidar, 1, 0.05).scan(scene, state).points
        assert points is not None and len(points) > 0.3 * lidar.channels * lidar.columns


@pytest.mark.parametrize(
    ("things", "share"),
    [
        ([sheet([-90, -90], [90, 90], z=0.0)], 1.0),
        ([box([0, 0, 4], [0.3, 0.3, 8])], 0.0),
        ([box([51, 0, 0], [100, 200, 200])], 1.0 - 2.0 * np.arccos(1.0 / 3.0) / (2.0 * np.pi)),
    ],
    ids=["open land", "in a pole", "1 m from a wall"],
)
def test_the_open_share_is_that_of_the_rays_longer_than_3_m(
    monkeypatch: pytest.MonkeyPatch, things: list[np.ndarray], share: float
) -> None:
    meshes = Mesh.merge([mesh(corners, Tag.POLE) for corners in things])
    static = static_scene(meshes, origin_m=(12.0, -3.0, 1.0))  # the foot of the unit
    monkeypatch.setattr(open_stations, "load_static_scene", lambda *_, **__: static)
    spec = with_agents(made_up_spec([]), roadside_unit())
    assert open_share(spec.map, spec.agents[-1]) == pytest.approx(share, abs=0.02)


def with_shares(monkeypatch: pytest.MonkeyPatch, *shares: float) -> None:
    """Let units see these shares, one after the other, and later ones the last."""
    left = list(shares)
    monkeypatch.setattr(open_stations, "build_surroundings", lambda *_: None)
    monkeypatch.setattr(open_stations, "open_share", lambda *_: left.pop(0) if len(left) > 1 else left[0])


def test_a_scene_with_an_enclosed_unit_is_drawn_again_with_the_next_seed(monkeypatch: pytest.MonkeyPatch) -> None:
    with_shares(monkeypatch, 1.0, 0.25, 1.0)
    scenario, events = scenario_in("Town02", 1), list[object]()
    (spec,) = draw_scenes(scenario, SimpleNamespace(notify=events.append))
    (planned,) = planned_scenes(scenario)
    assert spec == draw_scene(scenario, planned._replace(draw=1), load_network(planned.map))
    refused = SceneRefused("Town02-0000", ("rsu_2: 75% of the view ends within 3 m",))
    assert [event for event in events if isinstance(event, SceneRefused)] == [refused]


def test_units_that_are_always_enclosed_end_the_draws(monkeypatch: pytest.MonkeyPatch) -> None:
    with_shares(monkeypatch, 0.0)
    monkeypatch.setattr(drawing, "_MAX_DRAWS", 3)
    with pytest.raises(InputError, match=r"none of 3 draws is accepted; the last one: rsu_1: 100% of the view ends"):
        draw_scenes(scenario_in("Town02", 1))
