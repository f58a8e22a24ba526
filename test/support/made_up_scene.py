"""A bag of a synthetic scene with random contents: every topic that exports and statistics read, in small size.

``several_agents`` has scenes with several agents for ``record_made_up``.
"""

import json
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from ros_messages import header, image, message, odometry, point_cloud, serialize, string
from scene_edits import ego

from simbev_ros.config.modalities import IMAGE_KINDS
from simbev_ros.foundation.geometry.transforms import quaternion_from_rpy, rotations_from_rpy
from simbev_ros.foundation.semantics import BEV_CLASSES, BOX_CLASSES, Tag
from simbev_ros.foundation.types import AnyArray, Float64Array, Table
from simbev_ros.recording.bag_writer import SceneBagWriter
from simbev_ros.recording.layout import SCENE_ATTACHMENT
from simbev_ros.recording.qos import QosProfile
from simbev_ros.scene.legend import legend
from simbev_ros.schema.boxes import BOX_DTYPE, LIGHT_IDS, NO_BLUEPRINT, SIGN_IDS
from simbev_ros.schema.messages import table_messages
from simbev_ros.schema.points import POINT_DTYPE, RADAR_POINT_DTYPE, SEMANTIC_POINT_DTYPE
from simbev_ros.schema.scene.agents import AgentView, agent_views
from simbev_ros.schema.scene.spec import SceneSpec
from simbev_ros.schema.scene.state import ACTOR_DTYPE, SIGNAL_DTYPE
from simbev_ros.schema.voxels import VOXEL_DTYPE

TICK_NS = 50_000_000
SENSORS: list[dict[str, Any]] = [
    {"type": "camera", "name": "cam_front", "pose": {"x_m": 0.6, "z_m": 1.6}, "width_px": 32, "height_px": 24},
    {"type": "camera", "name": "cam_back_left", "pose": {"z_m": 1.6, "yaw_deg": 110}, "width_px": 32, "height_px": 24},
    {"type": "lidar", "name": "lidar", "pose": {"z_m": 1.8}},
    {"type": "radar", "name": "radar_front", "pose": {"x_m": 2.4, "z_m": 0.6}},
    {"type": "gnss", "name": "gnss"},
    {"type": "imu", "name": "imu"},
]
SIGNALS = [{"programme": name, "opendrive_id": place} for name, place in (("A", None), ("A", "A_3"), ("B", "B_0"))]
_ENCODINGS = {"rgb": "rgb8", "semantic": "mono8", "instance": "mono16", "depth": "32FC1", "flow": "32FC2"}
_TYPED = {"world/actors": table_messages.ACTORS, "world/signals": table_messages.SIGNALS, "boxes": table_messages.BOXES}
_LABELS = ("boxes", "bev/labels", "hd_map", "occupancy/points")
_WEATHER = {
    **dict.fromkeys(("cloudiness", "precipitation", "precipitation_deposits", "wetness", "wind_intensity"), 10),
    **dict.fromkeys(("sun_azimuth_deg", "sun_altitude_deg", "fog_density", "fog_distance_m", "fog_falloff"), 5),
}


@dataclass
class MadeUp:
    """Content of the written bag: the scene, and per tick the arrays by the reader's keys, also of further agents."""

    spec: SceneSpec
    ticks: list[dict[str, Any]] = field(default_factory=list)
    others: dict[str, list[dict[str, Any]]] = field(default_factory=dict)


def made_up_scene(
    path: Path,
    *,
    number: int = 0,
    split: str = "train",
    ticks: int = 3,
    sensors: list[dict[str, Any]] | None = None,
    grid: tuple[int, int] = (20, 24),
    chunk_bytes: int = 4 << 20,
    typed: bool = False,
) -> MadeUp:
    """Write a finished bag. Occupancy is there at every second tick; tables also as typed messages if asked for."""
    spec = made_up_spec(SENSORS if sensors is None else sensors, number=number, split=split, ticks=ticks, grid=grid)
    return record_made_up(path, spec, chunk_bytes=chunk_bytes, typed=typed)


def record_made_up(
    path: Path,
    spec: SceneSpec,
    *,
    chunk_bytes: int = 4 << 20,
    typed: bool = False,
    tables: Mapping[str, Table | Sequence[Table]] | None = None,
) -> MadeUp:
    """Write a finished bag of a scene; what the first agent has does not depend on the others.

    Args:
        path: The bag.
        spec: The scene.
        chunk_bytes: Size of chunks.
        typed: Whether to write tables also as typed messages.
        tables: Further tables by topic: one that is written at every tick, or one for each tick.
    """
    made = MadeUp(spec, others={view.agent: [] for view in agent_views(spec)[1:]})
    seeds = [spec.number, *([spec.number, *name.encode()] for name in made.others)]
    agents = [(view, np.random.default_rng(seed)) for view, seed in zip(agent_views(spec), seeds, strict=True)]
    with SceneBagWriter(path, chunk_bytes=chunk_bytes) as writer:
        writer.add_attachment(SCENE_ATTACHMENT, "application/json", spec.model_dump_json().encode())
        writer.add_attachment("config.yaml", "application/yaml", b"seed: 1\n")
        latched = QosProfile(durability="transient_local")
        writer.add_topic("/world/legend", "std_msgs/msg/String", latched)
        writer.write("/world/legend", spec.start_ns, string(json.dumps({**legend(), "signals": SIGNALS})))
        topics: set[str] = set()
        for tick in range(spec.ticks):
            messages = [
                _message(topic, "", table if isinstance(table, np.ndarray) else table[tick], spec.stamp_ns(tick))
                for topic, table in (tables or {}).items()
            ]
            for view, rng in agents:
                values = _values(rng, view, tick)
                if tick % view.label_period_ticks():
                    values = {key: value for key, value in values.items() if key not in _LABELS}
                (made.ticks if view.is_ego else made.others[view.agent]).append(values)
                messages += _messages(view, values, tick, typed=typed)
            for topic, type_name, data in messages:
                if topic not in topics:
                    writer.add_topic(topic, type_name, QosProfile())
                    topics.add(topic)
                writer.write(topic, spec.stamp_ns(tick), data)
        writer.finish({"scene": spec.name})
    return made


def boxes(rng: np.random.Generator, count: int) -> Table:
    """Boxes of actors, followed by a traffic light and a sign."""
    table = noise(rng, BOX_DTYPE, count)
    place = np.arange(count)
    table["id"], table["class"], table["blueprint"] = 2 + place, place % 6, place % 3
    table["tag"] = Tag.CAR
    table["parent"], table["sign"], table["limit"], table["state"] = 0, 0, 0, 0
    table["parent"][0] = 7
    table["lidar_points"] = rng.integers(-1, 50, count)
    table["distance"] = rng.uniform(0, 119, count)
    table["visibility"] = np.where(rng.random(count) < 0.3, np.nan, rng.random(count))
    for name in ("length", "width", "height"):
        table[name] = rng.uniform(0.5, 5, count)
    table["valid"] = table["lidar_points"] > 0
    table["difficulty"] = rng.integers(0, 3, count)
    light, sign = table[-2:-1], table[-1:]
    light["id"], light["tag"], light["class"] = LIGHT_IDS + 2, Tag.TRAFFIC_LIGHT, BOX_CLASSES.index("traffic_light")
    light["state"] = 3
    sign["id"], sign["tag"], sign["class"] = SIGN_IDS + 1, Tag.TRAFFIC_SIGN, BOX_CLASSES.index("traffic_sign")
    sign["sign"], sign["limit"] = 3, 50 / 3.6
    table["blueprint"][-2:] = NO_BLUEPRINT
    return table


def noise(rng: np.random.Generator, dtype: np.dtype[Any], count: int) -> Table:
    """Rows of small random numbers."""
    table = np.zeros(count, dtype)
    for name in dtype.names or ():
        is_real = dtype[name].kind == "f"
        table[name] = rng.normal(0, 3, count) if is_real else rng.integers(0, 100, count)
    return table


def made_up_spec(
    sensors: list[dict[str, Any]],
    *,
    number: int = 0,
    split: str = "train",
    ticks: int = 3,
    grid: tuple[int, int] = (20, 24),
) -> SceneSpec:
    """A scene with some sensors, which nobody has drawn; every label is on."""
    start = {"lane": "a_0", "s_m": 0}
    car = {"blueprint": "vehicle.sedan", "color": 0, "start": start, "speed_factor": 1, "min_gap_m": 2}
    return SceneSpec.model_validate(
        {
            "number": number,
            "split": split,
            "seed": number,
            "map": {"name": "Blocks", "seed": 0},
            "tick_ns": TICK_NS,
            "warm_up_ticks": 1,
            "ticks": ticks,
            "weather": _WEATHER | {"sun_altitude_deg": 10.0 * number},
            "agents": [
                ego(
                    sensors,
                    {
                        "bev": {"rows": grid[0], "columns": grid[1]},
                        "occupancy": {"half_side_m": 4, "voxel_m": 1},
                    },
                )
            ],
            "vehicles": [car] * (2 + number),
            "pedestrians": [],
            "green_time_s": [10.0],
        }
    )


def labeled_at(spec: SceneSpec, rate_hz: float) -> SceneSpec:
    """The scene with labels at a rate; ``record_made_up`` writes no others."""
    data = spec.model_dump(mode="json")
    for agent in data["agents"]:
        agent["annotation"]["rate_hz"] = rate_hz
    return SceneSpec.model_validate(data)


def _values(rng: np.random.Generator, view: AgentView, tick: int) -> dict[str, Any]:
    """Values of one tick for an agent by key of the reader, in the form that the reader returns."""
    grid = view.annotation.bev.rows, view.annotation.bev.columns
    values: dict[str, Any] = {
        "odom": _motion(view, tick),
        "boxes": boxes(rng, 12),
        "bev/labels": rng.integers(0, 1 << len(BEV_CLASSES), grid).astype(np.uint16),
    }
    if view.is_ego:
        values |= {"world/actors": noise(rng, ACTOR_DTYPE, 9), "world/signals": noise(rng, SIGNAL_DTYPE, 4)}
        values["world/actors"]["id"] = 1 + np.arange(9)
        values["world/actors"]["blueprint"] %= 5
        values["world/actors"]["parent"] = 0
    _move_to_agent(values)
    if view.is_ego:
        _match_boxes(values["world/actors"], values["boxes"])
    values["hd_map"] = {"stamp_ns": view.scene.stamp_ns(tick), "id": "a_0", "s": 1.5, "is_junction": False}
    if tick % 2 == 0:
        values["occupancy/points"] = _voxels(rng)
    for sensor in view.rig.sensors:
        match sensor.type:
            case "camera":
                for modality in sensor.modalities:
                    values[f"{sensor.name}/{modality}"] = _image(rng, modality, (sensor.height_px, sensor.width_px))
            case "lidar":
                if sensor.points:
                    values[f"{sensor.name}/points"] = noise(rng, POINT_DTYPE, 200)
                if sensor.semantic_points:
                    values[f"{sensor.name}/semantic_points"] = noise(rng, SEMANTIC_POINT_DTYPE, 100)
            case "radar":
                values[f"{sensor.name}/points"] = noise(rng, RADAR_POINT_DTYPE, 50)
            case "gnss":
                values[f"{sensor.name}/fix"] = np.array([42.2, -83.7, 5.0]) + tick
            case "imu":
                values[f"{sensor.name}/data"] = rng.normal(size=6), rng.uniform(-1, 1, 3) * [0.1, 0.1, 3]
    return values


def _move_to_agent(values: dict[str, Any]) -> None:
    """Move the boxes, which are around the origin of the map, to the agent."""
    for name, offset_m in zip("xyz", values["odom"][0], strict=True):
        values["boxes"][name] += offset_m


def _match_boxes(actors: Table, boxes: Table) -> None:
    """Give actors that have a box its size and pose."""
    _, actor, box = np.intersect1d(actors["id"], boxes["id"], return_indices=True)
    for name in ("roll", "pitch", "yaw", "length", "width", "height"):
        actors[name][actor] = boxes[name][box]
    rpy_rad = np.stack([boxes[name] for name in ("roll", "pitch", "yaw")], axis=1).astype(np.float64)
    up = rotations_from_rpy(rpy_rad)[:, :, 2] * boxes["height"][:, None] / 2.0
    for axis, name in enumerate("xyz"):
        actors[name][actor] = (boxes[name] - up[:, axis])[box]


def _motion(view: AgentView, tick: int) -> tuple[Float64Array, Float64Array]:
    """Position and roll, pitch, yaw of an agent's base_link: vehicles drive behind each other, stations stand still."""
    if (station := view.station) is not None:
        return np.array([station.x_m, station.y_m, station.z_m]), np.array([0.0, 0.0, station.yaw_rad])
    behind_m = 20.0 * (view.spec.vehicle or 0)
    return np.array([5.0 * tick - behind_m, 1.0, 0.5]), np.array([0.01, 0.02, 0.3 + 0.1 * tick])


def _image(rng: np.random.Generator, modality: str, shape: tuple[int, int]) -> AnyArray:
    height, width = shape
    if modality == "rgb":
        return np.tile(np.linspace(0, 255, width, dtype=np.uint8)[None, :, None], (height, 1, 3))
    if modality == "semantic":
        return rng.integers(0, 29, shape).astype(np.uint8)
    if modality == "instance":
        return rng.integers(0, 1 << 16, shape).astype(np.uint16)
    if IMAGE_KINDS[modality].encoding == "32FC1":
        return np.where(rng.random(shape) < 0.1, np.inf, rng.uniform(0.5, 900, shape)).astype(np.float32)
    return rng.normal(0, 9, (*shape, 2)).astype(np.float32)


def _voxels(rng: np.random.Generator) -> Table:
    places = rng.choice(8 * 8 * 8, 40, replace=False)
    table = np.zeros(40, VOXEL_DTYPE)
    table["ix"], table["iy"], table["iz"] = np.unravel_index(np.sort(places), (8, 8, 8))
    table["tag"] = rng.integers(1, 29, 40)
    return table


def _messages(view: AgentView, values: dict[str, Any], tick: int, *, typed: bool) -> Iterator[tuple[str, str, bytes]]:
    """Topic, type and serialized message of each value of an agent, and of its typed form if asked for."""
    for key, value in values.items():
        topic = f"/{key}" if key.startswith("world/") else f"/{view.agent}/{key}"
        yield _message(topic, key, value, view.scene.stamp_ns(tick))
        if typed and key in _TYPED:
            data = table_messages.serialize_table(_TYPED[key], value, view.scene.stamp_ns(tick), "map")
            yield f"{topic}/typed", _TYPED[key], data


def _message(topic: str, key: str, value: Any, stamp_ns: int) -> tuple[str, str, bytes]:
    """Topic, type and serialized message."""
    last = key.rpartition("/")[2]
    if key == "odom":
        return topic, "nav_msgs/msg/Odometry", odometry(stamp_ns, *value)
    if key == "hd_map":
        return topic, "std_msgs/msg/String", string(json.dumps(value))
    if key == "bev/labels":
        return topic, "sensor_msgs/msg/Image", image(stamp_ns, "mono16", value)
    if last in _ENCODINGS:
        return f"{topic}/image_raw", "sensor_msgs/msg/Image", image(stamp_ns, _ENCODINGS[last], value)
    if last == "fix":
        return topic, "sensor_msgs/msg/NavSatFix", _fix(stamp_ns, value)
    if last == "data":
        return topic, "sensor_msgs/msg/Imu", _imu(stamp_ns, *value)
    return topic, "sensor_msgs/msg/PointCloud2", point_cloud(stamp_ns, value)


def _fix(stamp_ns: int, place: AnyArray) -> bytes:
    return serialize(
        "sensor_msgs/msg/NavSatFix",
        header=header(stamp_ns),
        status=message("sensor_msgs/msg/NavSatStatus", status=0, service=1),
        latitude=float(place[0]),
        longitude=float(place[1]),
        altitude=float(place[2]),
        position_covariance=np.zeros(9),
        position_covariance_type=2,
    )


def _imu(stamp_ns: int, motion: AnyArray, rpy_rad: AnyArray) -> bytes:
    turn = dict(zip("xyzw", quaternion_from_rpy(rpy_rad).tolist(), strict=True))
    acceleration, rate = (
        message("geometry_msgs/msg/Vector3", **dict(zip("xyz", part.tolist(), strict=True)))
        for part in (motion[:3], motion[3:])
    )
    return serialize(
        "sensor_msgs/msg/Imu",
        header=header(stamp_ns),
        orientation=message("geometry_msgs/msg/Quaternion", **turn),
        orientation_covariance=np.zeros(9),
        angular_velocity=rate,
        angular_velocity_covariance=np.zeros(9),
        linear_acceleration=acceleration,
        linear_acceleration_covariance=np.zeros(9),
    )
