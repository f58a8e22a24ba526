"""Sensor nodes serve several agents, or a share of them, with what nodes of their own would publish."""

from collections import defaultdict
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from made_up_scene import labeled_at, made_up_spec
from several_agents import car, roadside_unit, with_agents
from started_nodes import started_node
from synthetic_world import actor, box, cart_model, mesh, sheet, static_scene, world

from simbev_ros.assets.materials import Material
from simbev_ros.config.lidar import Lidar
from simbev_ros.foundation.errors import InputError
from simbev_ros.foundation.semantics import Tag
from simbev_ros.foundation.types import Table
from simbev_ros.ros.msgs.sensor_topics import sensor_topics
from simbev_ros.ros.msgs.tables import table_from_message
from simbev_ros.ros.nodes import ray_scenes, surroundings
from simbev_ros.schema.scene.agents import agent_views
from simbev_ros.schema.scene.spec import SceneSpec
from simbev_ros.schema.scene.state import EGO_ID, WorldState
from simbev_ros.simulation.raycast.part_stack import PartStack
from simbev_ros.simulation.raycast.scene import RayScene
from simbev_ros.simulation.sensors.lidar import LidarModel
from simbev_ros.simulation.sensors.mount import vector

MODELS = (cart_model(),)
STATIC = static_scene(
    mesh(sheet([-200, -200], [200, 200]), Tag.ROAD, Material.ASPHALT),
    mesh(box([14, 6, 2], [3, 3, 4]), Tag.BUILDING, Material.BRICK),
)
LIDAR = {"type": "lidar", "name": "lidar", "channels": 8, "columns": 180, "range_m": 60.0, "pose": {"z_m": 2.0}}
LIDARS: list[dict[str, Any]] = [
    {**LIDAR, "name": "slow", "rate_hz": 10, "rolling": True},
    {**LIDAR, "hits_own_vehicle": True},
]
RADAR = {"type": "radar", "name": "radar", "range_m": 50.0, "points_per_second": 40_000, "pose": {"z_m": 1.0}}
SENSORS: dict[str, list[dict[str, Any]]] = {
    "lidar": LIDARS,
    "radar": [RADAR, {**RADAR, "name": "back", "pose": {"z_m": 1.0, "yaw_deg": 180}, "rate_hz": 10}],
    "gnss": [{"type": "gnss", "name": "gnss"}],
    "imu": [{"type": "imu", "name": "imu"}],
    "odometry": [{"type": "odometry", "name": "wheels"}],
}
CAR_ID = EGO_ID + 1


def scene_of(kind: str) -> SceneSpec:
    """A scene with ``ego`` in vehicle 0, ``car`` in vehicle 1 and, for sensors without wheels, ``rsu``; equal rigs."""
    mast = [] if kind == "odometry" else [roadside_unit(sensors=SENSORS[kind], x_m=4.0, y_m=9.0)]
    return with_agents(made_up_spec(SENSORS[kind]), car("car", 1, SENSORS[kind]), *mast)


def state_at(tick: int) -> WorldState:
    ego = actor(MODELS[0], id=EGO_ID, x=0.6 * tick, y=3.0, yaw=0.1 * tick, vx=12.0, wz=2.0)
    other = actor(MODELS[0], id=CAR_ID, x=9.0 - 0.7 * tick, y=-1.0, yaw=3.0, vx=-14.0)
    return replace(world(ego, other, tick=tick), ego_id=EGO_ID)


@pytest.fixture(autouse=True)
def small_world(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(ray_scenes, "load_part_stack", lambda: PartStack(MODELS))
    monkeypatch.setattr(surroundings, "load_network", lambda *_: None)
    monkeypatch.setattr(surroundings, "loaded_reach", lambda *_: None)
    monkeypatch.setattr(surroundings, "load_static_scene", lambda *_, **__: STATIC)
    monkeypatch.setattr(surroundings, "_loaded", {})


def play(node: Any, spec: SceneSpec, ticks: Sequence[int] = range(-2, 4)) -> dict[str, list[Any]]:
    """Let a node process ticks; return what it has published, by topic."""
    sent: dict[str, list[Any]] = defaultdict(list)
    node.publish = lambda name, message: sent[name].append(message)
    node.report_finished = lambda *_: None
    for tick in ticks:
        node.process(spec, state_at(tick))
        node.finish(spec, state_at(tick))
        node._send(0)
    return dict(sent)


def published(kind: str, spec: SceneSpec, **parameters: object) -> dict[str, list[Any]]:
    with started_node(kind, spec, **parameters) as node:
        return play(node, spec)


def cloud_of(sent: dict[str, list[Any]], name: str) -> Table:
    """The table in the last message on a topic."""
    return table_from_message(sent[name][-1])


@pytest.mark.parametrize("kind", SENSORS)
def test_a_node_publishes_the_topics_of_all_agents_in_their_frames(kind: str) -> None:
    spec = scene_of(kind)
    expected = [topic.name for view in agent_views(spec) for topic in sensor_topics(view, compressed_images=True)]
    with started_node(kind, spec) as node:
        assert node.topics == expected
        assert play(node, spec, [-2, -1]) == {}, "the lead-in"
        sent = play(node, spec, range(4))
    assert set(sent) == set(expected)
    for name, messages in sent.items():
        agent = name.split("/")[1]
        frames = {message.header.frame_id for message in messages if not isinstance(message, bytes)}
        assert all(frame.startswith(f"{agent}/") for frame in frames)


@pytest.mark.parametrize("kind", SENSORS)
def test_nodes_that_share_the_agents_publish_what_a_single_one_would(kind: str) -> None:
    spec = scene_of(kind)
    agents = [view.agent for view in agent_views(spec)]
    together = published(kind, spec)
    apart: dict[str, list[Any]] = {}
    for share, agent in enumerate(agents):
        alone = published(kind, spec, agent_share=share, agent_shares=len(agents))
        assert all(name.startswith(f"/{agent}/") for name in alone)
        assert alone
        apart |= alone
    assert apart == together


def test_clouds_of_each_agent_equal_those_of_its_models() -> None:
    spec = scene_of("lidar")
    sent = published("lidar", spec)
    for view in agent_views(spec):
        for lidar in view.rig.of_type(Lidar):
            ticks = range(3) if lidar.rolling else range(3, 4)
            *earlier, state = (view.ego_state(state_at(tick)) for tick in ticks)
            rays = RayScene(STATIC, MODELS)
            hidden_ids = frozenset() if lidar.hits_own_vehicle else state.ego_ids
            rays.update(state, vector(state.ego, "x y z"), 60.0, hidden_ids, earlier)
            scan = LidarModel(lidar, view.noise_seed, 0.1 if lidar.rolling else 0.05).scan(rays, state, earlier)
            for cloud, table in (("points", scan.points), ("semantic_points", scan.semantic_points)):
                assert table is not None
                assert len(table) > 200
                assert cloud_of(sent, f"/{view.agent}/{lidar.name}/{cloud}").tobytes() == table.tobytes()


def test_a_lidar_sees_the_other_agents_and_not_the_vehicle_that_carries_it() -> None:
    sent = published("lidar", scene_of("lidar"))
    for agent, expected in (("ego", {0, CAR_ID}), ("car", {0, EGO_ID}), ("rsu", {0, EGO_ID, CAR_ID})):
        seen = cloud_of(sent, f"/{agent}/slow/semantic_points")["object_id"]
        assert set(seen.tolist()) == expected
    own = cloud_of(sent, "/car/lidar/semantic_points")["object_id"]
    assert set(own.tolist()) == {0, EGO_ID, CAR_ID}, "this lidar also hits its own vehicle"


def test_rays_of_radars_pass_through_the_vehicle_that_carries_them() -> None:
    sent = published("radar", scene_of("radar"))
    for agent in ("ego", "car", "rsu"):
        ranges_m = cloud_of(sent, f"/{agent}/radar/points")["range"]
        assert len(ranges_m) > 100
        assert ranges_m.min() > 3.0, "the sensor is inside the body, and 4 m from the ground that it sees"


def test_agents_with_equal_rigs_at_one_place_see_the_same_with_different_noise() -> None:
    masts = [roadside_unit(name, LIDARS, x_m=4.0, y_m=9.0) for name in ("left", "right")]
    sent = published("lidar", with_agents(made_up_spec(LIDARS), *masts))
    semantic, points = (
        [cloud_of(sent, f"/{name}/lidar/{cloud}") for name in ("left", "right")]
        for cloud in ("semantic_points", "points")
    )
    assert semantic[0].tobytes() == semantic[1].tobytes()
    assert points[0].tobytes() != points[1].tobytes()


def test_the_imu_of_a_roadside_unit_is_at_rest() -> None:
    sent = published("imu", scene_of("imu"))
    samples = sent["/rsu/imu/data_raw"]
    accelerations = np.array([[getattr(m.linear_acceleration, axis) for axis in "xyz"] for m in samples])
    rates = np.array([[getattr(m.angular_velocity, axis) for axis in "xyz"] for m in samples])
    np.testing.assert_allclose(accelerations.mean(axis=0), [0.0, 0.0, 9.81], atol=0.1)
    np.testing.assert_allclose(rates.mean(axis=0), 0.0, atol=0.02)
    turning = [message.angular_velocity.z for message in sent["/ego/imu/data_raw"]]
    assert np.mean(turning) == pytest.approx(2.0, abs=0.05)


def test_each_wheel_odometry_measures_its_own_vehicle() -> None:
    sent = published("odometry", scene_of("odometry"))
    for agent, speed_mps in (("ego", 12.0), ("car", 14.0)):
        (measured,) = (messages for name, messages in sent.items() if name.startswith(f"/{agent}/"))
        assert measured[-1].twist.twist.linear.x == pytest.approx(speed_mps, rel=0.1)
        assert measured[-1].child_frame_id == f"{agent}/base_link"


def test_ray_scenes_of_a_node_share_models_and_static_triangles() -> None:
    spec = scene_of("lidar")
    with started_node("lidar", spec) as node:
        play(node, spec, [0])
        scenes = node._scenes.take(6)
        assert len({id(scene) for scene in scenes}) == 6
        assert {id(scene.parts) for scene in scenes} == {id(scenes[0].parts)}
        cells = [scene.static.triangles_around(np.zeros(3), node._scenes.reach_m) for scene in scenes]
        assert {id(cell) for cell in cells} == {id(cells[0])}
        node.start_scene(spec)
        assert [id(scene) for scene in node._scenes.take(6)] == [id(scene) for scene in scenes], (
            "kept for the next scene"
        )


def test_the_reach_of_ray_scenes_is_that_of_all_agents_whichever_ones_a_node_serves() -> None:
    far = [{**LIDAR, "range_m": 90.0, "pose": {"x_m": 3.0, "y_m": -4.0, "z_m": 2.0}}]
    spec = with_agents(made_up_spec(LIDARS), car("car", 1, far))
    for share in range(2):
        with started_node("lidar", spec, agent_share=share, agent_shares=2) as node:
            assert node._scenes.reach_m == 95.0


def test_agents_without_sensors_of_a_kind_take_no_share_of_it() -> None:
    blind = [{"type": "imu", "name": "imu"}]
    spec = with_agents(made_up_spec(LIDARS), car("car", 1, blind), roadside_unit(sensors=LIDARS, x_m=4.0, y_m=9.0))
    topics = []
    for share in range(3):
        with started_node("lidar", spec, agent_share=share, agent_shares=3) as node:
            topics.append({name.split("/")[1] for name in node.topics})
            assert node.is_due(spec, 0) == bool(node.topics)
            assert bool(play(node, spec)) == bool(node.topics)
    assert topics == [{"ego"}, {"rsu"}, set()]


@pytest.mark.parametrize("kind", ["radar", "gnss"])
def test_a_node_without_agents_to_serve_plays_scenes(kind: str) -> None:
    spec = scene_of(kind)
    with started_node(kind, spec, agent_share=3, agent_shares=4) as node:
        assert node.topics == []
        assert play(node, spec) == {}


def test_a_share_that_does_not_exist_is_refused() -> None:
    with (
        pytest.raises(InputError, match="parameter agent_share: must be less than agent_shares, which is 2"),
        started_node("imu", scene_of("imu"), agent_share=2, agent_shares=2),
    ):
        pass


def test_readers_are_expected_for_the_topics_of_every_agent() -> None:
    spec = scene_of("lidar")
    read = "/car/slow/points"
    readers = {"recorded": True, "annotated": True, "evaluated_topics": f"['{read}','{read}']"}
    with started_node("lidar", spec, **readers) as node:
        node._on_scene(spec.model_dump_json(), b"")
        expected = node._awaited_readers
    clouds = {view.agent: expected[f"/{view.agent}/slow/points"] for view in agent_views(spec)}
    assert clouds == {"ego": 2, "car": 4, "rsu": 2}, "a recorder, an annotator, and two evaluators of one topic"
    assert expected["/car/slow/semantic_points"] == 1


@pytest.mark.parametrize("kind", ["lidar", "radar"])
@pytest.mark.parametrize("recorded", [False, True])
def test_what_only_annotators_read_is_sent_at_ticks_with_labels(kind: str, recorded: bool) -> None:
    spec, every_tick, of_car = labeled_at(scene_of(kind), 10), published(kind, scene_of(kind)), f"/car/{kind}/"
    with started_node(kind, spec, annotated=True) as node:
        node._on_scene(spec.model_dump_json(), b"")
        node.reader_count = lambda name: name.endswith("/points") + (recorded and name.startswith(of_car))
        sent = play(node, spec)
    for name, messages in every_tick.items():
        is_needed = len(messages) == 2 or (recorded and name.startswith(of_car))
        assert sent[name] == (messages if is_needed else messages[::2]), name
