"""The lidar node publishes the clouds of its lidar models when they are due, with the states of the whole turn."""

from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import pytest
from rclpy.experimental.events_executor import EventsExecutor
from started_nodes import collecting_node
from synthetic_world import actor, cart_model, mesh, sheet, static_scene, world

from simbev_ros.assets.materials import Material
from simbev_ros.config.scenario import Scenario
from simbev_ros.foundation.semantics import Tag
from simbev_ros.maps.build import load_network
from simbev_ros.ros.msgs.stamps import stamp_of
from simbev_ros.ros.nodes import ray_scenes, surroundings
from simbev_ros.scene.drawing.draw_scene import draw_scene, planned_scenes
from simbev_ros.schema.scene.spec import SceneSpec
from simbev_ros.schema.scene.state import EGO_ID, WorldState
from simbev_ros.simulation.raycast.part_stack import PartStack

MODELS = (cart_model(),)
STATIC = static_scene(mesh(sheet([-200, -200], [200, 200]), Tag.ROAD, Material.ASPHALT))
SMALL = {"type": "lidar", "channels": 8, "columns": 180, "range_m": 60.0, "pose": {"z_m": 2.0}}
LIDARS = (
    {**SMALL, "name": "slow", "rate_hz": 10, "rolling": True},
    {**SMALL, "name": "fast", "semantic_points": False},
    {**SMALL, "name": "own", "hits_own_vehicle": True, "points": False},
)


@pytest.fixture(scope="module")
def spec() -> SceneSpec:
    rig = {"sensors": LIDARS}
    scenario = Scenario.model_validate(
        {"scenes": [{"map": "Blocks", "train": 1}], "rig": rig, "traffic": {"vehicles": 0}}
    )
    planned = next(planned_scenes(scenario))
    return draw_scene(scenario, planned, load_network(planned.map))


@pytest.fixture
def node(spec: SceneSpec, monkeypatch: pytest.MonkeyPatch) -> Iterator[Any]:
    """A lidar node that has started a scene and collects what it publishes in ``sent``."""
    monkeypatch.setattr(ray_scenes, "load_part_stack", lambda: PartStack(MODELS))
    monkeypatch.setattr(surroundings, "loaded_reach", lambda *_: None)
    monkeypatch.setattr(surroundings, "load_static_scene", lambda *_, **__: STATIC)
    monkeypatch.setattr(surroundings, "_loaded", {})
    with collecting_node("lidar", spec, monkeypatch) as made:
        yield made


def state_at(tick: int) -> WorldState:
    ego = actor(MODELS[0], id=EGO_ID, x=0.6 * tick, y=3.0, yaw=0.1 * tick, vx=12.0)
    state = world(ego, actor(MODELS[0], id=9, x=9.0 - 0.7 * tick, y=-1.0, yaw=3.0), tick=tick)
    return replace(state, ego_id=EGO_ID)


def play(node: Any, spec: SceneSpec, tick: int) -> None:
    node.process(spec, state_at(tick))
    node.finish(spec, state_at(tick))
    node._send(0)


def test_clouds_are_published_in_order_while_the_next_turn_is_scanned(
    node: Any, executor: EventsExecutor, spec: SceneSpec
) -> None:
    for tick in range(3):
        node.process(spec, state_at(tick))
        node.finish(spec, state_at(tick))
        assert len(node.reported) >= tick, "at most one tick is not sent yet"
    while len(node.reported) < 3:  # the last one is sent without another tick
        executor.spin_once(timeout_sec=5.0)
    assert node.reported == [0, 1, 2]
    stamps_ns = [stamp_of(message.header.stamp) for name, message in node.sent if name == "/ego/fast/points"]
    assert stamps_ns == [state_at(tick).stamp_ns for tick in range(3)]


def test_each_lidar_publishes_at_its_rate_and_not_in_the_lead_in(node: Any, spec: SceneSpec) -> None:
    assert node.recorded_topics == [
        "/ego/slow/points",
        "/ego/slow/semantic_points",
        "/ego/fast/points",
        "/ego/own/semantic_points",
    ]
    names = []
    for tick in range(-2, 3):
        node.sent.clear()
        play(node, spec, tick)
        names.append(sorted(name for name, _ in node.sent))
    every_tick = ["/ego/fast/points", "/ego/own/semantic_points"]
    every_second_tick = sorted([*every_tick, "/ego/slow/points", "/ego/slow/semantic_points"])
    assert names == [[], [], every_second_tick, every_tick, every_second_tick]
    assert all(node.is_due(spec, tick) for tick in range(3))
    assert not node.is_due(spec, -2)
