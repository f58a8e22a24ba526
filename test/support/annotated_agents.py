"""A small world with three agents, and an annotator node that is played in it without a graph."""

from collections import defaultdict
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np
import pytest
from rclpy.serialization import serialize_message
from several_agents import car, roadside_unit, with_agents
from started_nodes import started_node
from synthetic_world import actor, box, cart_model, mesh, sheet, static_scene, world

from simbev_ros.assets.materials import Material
from simbev_ros.config.load import load_scenario
from simbev_ros.foundation.geometry.transforms import apply, inverse
from simbev_ros.foundation.semantics import Tag
from simbev_ros.foundation.types import Table
from simbev_ros.maps.build import load_network
from simbev_ros.maps.network import RoadNetwork
from simbev_ros.ros.msgs.annotation_topics import annotator_inputs
from simbev_ros.ros.msgs.images import image_message
from simbev_ros.ros.msgs.tables import message_from_table, table_from_message
from simbev_ros.ros.nodes import annotator_node, surroundings
from simbev_ros.scene.drawing.draw_scene import draw_scene, planned_scenes
from simbev_ros.schema.boxes import LIGHT_IDS
from simbev_ros.schema.scene.agents import AgentView, agent_views
from simbev_ros.schema.scene.spec import SceneSpec
from simbev_ros.schema.scene.state import EGO_ID, SIGNAL_DTYPE, WorldState
from simbev_ros.simulation.sensors.mount import map_from_sensor

MODELS = (cart_model(),)
CAR_ID = EGO_ID + 1
GAP_M = 12.0
CAMERA: dict[str, Any] = {"width_px": 32, "height_px": 24, "modalities": ["instance"], "rate_hz": 10}
SENSORS: list[dict[str, Any]] = [
    {"type": "lidar", "name": "lidar", "pose": {"z_m": 2.0}},
    {"type": "camera", "name": "cam", "pose": {"x_m": 2.5, "z_m": 1.0}, **CAMERA},
]
ANNOTATION: dict[str, Any] = {
    "bev": {"rows": 80, "columns": 60, "cell_m": 0.5},
    "occupancy": {"half_side_m": 16.0, "rate_hz": None},
    "vector_map": {},
}
POINTS = {"ego": 3, "car": 5, "rsu": 2}
"""Number of points on each other vehicle at tick 0, and of pixels that show it."""
TICKS = range(4)
CLOUD_DTYPE = np.dtype([("x", "<f4"), ("y", "<f4"), ("z", "<f4")])


@cache
def drawn() -> tuple[dict[str, Any], RoadNetwork]:
    """A scene on the map Blocks, and its roads."""
    scenario = load_scenario("demo")
    planned = next(planned_scenes(scenario))
    network = load_network(planned.map)
    return draw_scene(scenario, planned, network).model_dump(mode="json"), network


def single(name: str, vehicles: Sequence[dict[str, Any]], annotation: dict[str, Any]) -> SceneSpec:
    """A scene with one agent, which rides in the first vehicle."""
    agent = {"rig": {"agent": name, "sensors": SENSORS}, "annotation": annotation, "vehicle": 0}
    own = {"agents": [agent], "vehicles": vehicles}
    return SceneSpec.model_validate(drawn()[0] | own)


@cache
def scene() -> SceneSpec:
    """Agents with equal rigs: ``ego``, ``car`` in front of it, and ``rsu`` between them beside the road."""
    (x, y, z), yaw = start()
    left = np.array([-np.sin(yaw), np.cos(yaw)]) * 8.0 + GAP_M / 2.0 * np.array([np.cos(yaw), np.sin(yaw)])
    mast = {"x_m": x + left[0], "y_m": y + left[1], "z_m": z, "yaw_rad": yaw - np.pi / 2.0}
    unit = roadside_unit(sensors=SENSORS) | {"station": mast, "annotation": ANNOTATION}
    return with_agents(ego_alone(), car("car", 1, SENSORS, annotation=ANNOTATION), unit)


def ego_alone() -> SceneSpec:
    return single("ego", drawn()[0]["vehicles"], ANNOTATION)


def start() -> tuple[tuple[float, float, float], float]:
    """Where the ego starts, and its yaw."""
    spec, network = drawn()
    lane = spec["vehicles"][0]["start"]
    position_m, yaw_rad = network.pose_on_lane(lane["lane"], lane["s_m"])
    return tuple(position_m.tolist()), float(yaw_rad)


def state_at(tick: int, ego_id: int = EGO_ID, car_id: int = CAR_ID) -> WorldState:
    """The ego, and the car ahead that looks at it; both drive to the ego's left, so that their distance stays."""
    (x, y, z), yaw = start()
    x, y = x - 0.4 * tick * np.sin(yaw), y + 0.4 * tick * np.cos(yaw)
    ahead = {"x": x + GAP_M * np.cos(yaw), "y": y + GAP_M * np.sin(yaw), "z": z, "yaw": yaw + np.pi}
    own = actor(MODELS[0], id=ego_id, x=x, y=y, z=z, yaw=yaw)
    signals = np.zeros(len(drawn()[1].signals), SIGNAL_DTYPE)
    signals["id"] = np.arange(len(signals)) + 1
    state = world(own, actor(MODELS[0], id=car_id, **ahead), tick=tick)
    return replace(state, ego_id=EGO_ID, signals=signals, stamp_ns=scene().stamp_ns(tick))


def sensor_messages(view: AgentView, state: WorldState) -> dict[str, bytes]:
    """Messages of an agent's sensors that are due, by topic: points on the other vehicles, and pixels of them."""
    state, inputs = view.ego_state(state), annotator_inputs(view, compressed_images=False)
    others = state.actors[state.actors["id"] != state.ego_id]
    count = POINTS[view.agent]
    at_m = np.stack([others["x"], others["y"], others["z"] + 0.9], axis=1).repeat(count * (state.tick + 1), axis=0)
    lidar = view.rig.sensors[0]
    cloud = np.zeros(len(at_m), CLOUD_DTYPE)
    cloud["x"], cloud["y"], cloud["z"] = apply(inverse(map_from_sensor(lidar.pose, state)), at_m).T
    sent = {inputs["lidar"].name: serialize_message(message_from_table(cloud, state.stamp_ns, "lidar"))}
    if state.tick % inputs["cam"].period_ticks == 0:
        ids = np.zeros((24, 32), np.uint16)
        for row, other in enumerate(others["id"].tolist()):
            ids[row, :count] = other
        sent[inputs["cam"].name] = serialize_message(image_message(ids, state.stamp_ns, "cam"))
    return sent


@contextmanager
def small_world() -> Iterator[None]:
    """Let annotators of this process load a small world."""
    (x, y, z), _ = start()
    ground = mesh(sheet([x - 60, y - 60], [x + 60, y + 60], z), Tag.ROAD, Material.ASPHALT)
    building = mesh(box([x - 9, y + 7, z + 2], [3, 5, 4]), Tag.BUILDING, Material.BRICK)
    static = static_scene(ground, building)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(annotator_node, "load_models", lambda: MODELS)
        patch.setattr(surroundings, "loaded_reach", lambda *_: None)
        patch.setattr(surroundings, "load_static_scene", lambda *_, **__: static)
        patch.setattr(surroundings, "_loaded", {})
        yield


def collect(node: Any, spec: SceneSpec) -> dict[str, list[Any]]:
    """Let a node begin a scene; return what it is going to publish, by topic, and the ticks that it reports."""
    sent: dict[str, list[Any]] = defaultdict(list)
    node.spec, node._joined._is_sent = spec, lambda _: True
    node.publish = lambda name, message: sent[name].append(message)
    node.report_finished = lambda _, tick: sent["finished"].append(tick)
    return sent


def events(
    spec: SceneSpec, states: Sequence[WorldState], seed: int | None = None
) -> Iterator[tuple[WorldState, str, bytes]]:
    """States (without a topic) and sensors' messages, each stream in its order; a seed mixes the streams."""
    streams: dict[str, list[tuple[WorldState, str, bytes]]] = defaultdict(list)
    for state in states:
        streams[""].append((state, "", b""))
        for view in agent_views(spec):
            for name, payload in sensor_messages(view, state).items():
                streams[name].append((state, name, payload))
    rng = None if seed is None else np.random.default_rng(seed)
    waiting = [stream for stream in streams.values() if stream]
    while waiting:
        index = 0 if rng is None else int(rng.integers(len(waiting)))
        yield waiting[index].pop(0)
        waiting = [stream for stream in waiting if stream]


def play(node: Any, spec: SceneSpec, arriving: Iterable[tuple[WorldState, str, bytes]]) -> dict[str, list[Any]]:
    sent = collect(node, spec)
    for state, topic, payload in arriving:
        if not topic:
            node.process(spec, state)
            node.finish(spec, state)
        elif topic in node._joined._subscriptions:
            node._joined._subscriptions[topic].callback(payload)
    node._send(0)
    return dict(sent)


def published(spec: SceneSpec, seed: int | None = None, **parameters: object) -> dict[str, list[Any]]:
    with started_node("annotator", spec, compressed=False, **parameters) as node:
        return play(node, spec, events(spec, [state_at(tick) for tick in TICKS], seed))


def actor_boxes(message: Any) -> Table:
    table = table_from_message(message)
    return table[table["id"] < LIGHT_IDS]


def labels_of(sent: dict[str, list[Any]], agent: str) -> dict[str, list[Any]]:
    return {name: messages for name, messages in sent.items() if name.startswith(f"/{agent}/")}
