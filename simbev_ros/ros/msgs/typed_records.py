"""Records, which other topics carry as JSON, as serialized messages of ``simbev_interfaces``.

Angles are in radians and time is in ROS's own types, as REP-103 wants; everything else is as in the record.
"""

import math
from collections.abc import Mapping
from typing import Any

import numpy as np

from simbev_ros.config.weather import WEATHER_PARAMETERS, message_field
from simbev_ros.drawing.displays.messages import MAP_FRAME, build, moment, serialize, stamped
from simbev_ros.foundation.units import NS_PER_S
from simbev_ros.schema.scene.hazard import HazardKind
from simbev_ros.schema.scene.spec import SceneSpec
from simbev_ros.schema.scene.weather import Weather

WEATHER = "simbev_interfaces/msg/Weather"
EVENT = "simbev_interfaces/msg/SceneEvent"
LANE = "simbev_interfaces/msg/LaneRecord"
SCENE = "simbev_interfaces/msg/Scene"

_MARKING, _NEIGHBOR = "simbev_interfaces/msg/LaneMarking", "simbev_interfaces/msg/LaneNeighbor"
_CHANGES = {"NONE": (False, False), "Left": (True, False), "Right": (False, True), "Both": (True, True)}


def serialize_weather(record: Mapping[str, Any], stamp_ns: int) -> bytes:
    """Weather message of a record as on /world/weather, or as ``Weather.model_dump`` gives it."""
    values = {name: value for name, value in record.items() if name in WEATHER_PARAMETERS}
    return serialize(_weather(Weather(**values), stamp_ns))


def serialize_event(record: Mapping[str, Any], stamp_ns: int) -> bytes:
    """SceneEvent message of a record as on /world/events, see ``ros.msgs.world.event_record``."""
    x, y, z = map(float, record["position_m"])
    return serialize(
        build(
            EVENT,
            header=stamped(stamp_ns, MAP_FRAME),
            type=record["type"],
            tick=record["tick"],
            ids=np.array(record["ids"], np.uint32),
            position=build("geometry_msgs/msg/Point", x=x, y=y, z=z),
            relative_speed=float(record["relative_speed_mps"]),
        )
    )


def serialize_lane(record: Mapping[str, Any], stamp_ns: int) -> bytes:
    """LaneRecord message of a record as on /ego/hd_map, see ``maps.hd_map.lane_record``."""
    position_m, rotation_deg = record["transform"]["location"], record["transform"]["rotation"]
    change_left, change_right = _CHANGES[record["lane_change"]]
    same = ("id", "road_id", "section_id", "lane_id", "lane_type", "is_junction")
    return serialize(
        build(
            LANE,
            header=stamped(stamp_ns, MAP_FRAME),
            **{name: record[name] for name in same},
            s=float(record["s"]),
            lane_width=float(record["lane_width"]),
            lane_change_left=change_left,
            lane_change_right=change_right,
            junction_id=record["junction_id"] or "",
            **dict(zip("xyz", map(float, position_m), strict=True)),
            **dict(zip(("roll", "pitch", "yaw"), map(math.radians, rotation_deg), strict=True)),
            left_lane_marking=_marking(record["left_lane_marking"]),
            right_lane_marking=_marking(record["right_lane_marking"]),
            left_lane=_neighbor(record["left_lane"]),
            right_lane=_neighbor(record["right_lane"]),
        )
    )


def serialize_scene(scene_json: str, stamp_ns: int) -> bytes:
    """Scene message of a scene's specification as JSON, as on /world/scene; its stamp is that of tick 0.

    Raises:
        ValidationError: The text is not such a specification.
    """
    spec = SceneSpec.from_json(scene_json)
    ego, kinds = spec.agents[0], [hazard.kind for hazard in spec.hazards]
    return serialize(
        build(
            SCENE,
            header=stamped(stamp_ns, MAP_FRAME),
            name=spec.name,
            number=spec.number,
            split=spec.split,
            map=spec.map.name,
            seed=spec.seed,
            tick_ns=spec.tick_ns,
            ticks=spec.ticks,
            warm_up_ticks=spec.warm_up_ticks,
            start=moment(spec.start_ns),
            duration=_duration(spec.ticks * spec.tick_ns),
            agent=ego.name,
            ego_blueprint=spec.vehicles[0].blueprint,
            ego_driver=ego.driver,
            vehicles=len(spec.vehicles),
            pedestrians=len(spec.pedestrians),
            accidents=kinds.count(HazardKind.ACCIDENT),
            work_zones=kinds.count(HazardKind.WORK_ZONE),
            sensors=[sensor.name for sensor in ego.rig.sensors],
            weather=_weather_at(spec, 0),
            final_weather=_weather_at(spec, spec.ticks - 1),
            json=scene_json,
        )
    )


def _weather_at(spec: SceneSpec, tick: int) -> Any:
    return _weather(spec.weather_at(tick), spec.stamp_ns(tick))


def _weather(weather: Weather, stamp_ns: int) -> Any:
    fields = {}
    for name, row in WEATHER_PARAMETERS.items():
        if not row.typed:
            continue
        value = float(getattr(weather, name))
        fields[message_field(name)] = math.radians(value) if row.unit == "°" else value
    return build(WEATHER, header=stamped(stamp_ns, MAP_FRAME), **fields)


def _marking(record: Mapping[str, Any]) -> Any:
    change_left, change_right = _CHANGES[record["lane_change"]]
    return build(
        _MARKING,
        type=record["type"],
        color=record["color"],
        width=float(record["width"]),
        lane_change_left=change_left,
        lane_change_right=change_right,
    )


def _neighbor(record: Mapping[str, Any] | None) -> Any:
    return build(_NEIGHBOR, **(record or {}))


def _duration(duration_ns: int) -> Any:
    seconds, nanoseconds = divmod(duration_ns, NS_PER_S)
    return build("builtin_interfaces/msg/Duration", sec=seconds, nanosec=nanoseconds)
