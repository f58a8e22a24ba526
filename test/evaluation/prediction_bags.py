"""Messages of a perception stack, and bags of them, written by rosbags with the definitions of vision_msgs."""

from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from rosbags.rosbag2 import StoragePlugin, Writer
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from simbev_ros.foundation.types import AnyArray, Table

_DEFINITIONS = {
    "vision_msgs/msg/ObjectHypothesis": "string class_id\nfloat64 score\n",
    "vision_msgs/msg/ObjectHypothesisWithPose": "ObjectHypothesis hypothesis\ngeometry_msgs/PoseWithCovariance pose\n",
    "vision_msgs/msg/BoundingBox3D": "geometry_msgs/Pose center\ngeometry_msgs/Vector3 size\n",
    "vision_msgs/msg/Detection3D": (
        "std_msgs/Header header\nObjectHypothesisWithPose[] results\nBoundingBox3D bbox\nstring id\n"
    ),
    "vision_msgs/msg/Detection3DArray": "std_msgs/Header header\nDetection3D[] detections\n",
}
TYPES = get_typestore(Stores.ROS2_JAZZY)
for _name, _text in _DEFINITIONS.items():
    TYPES.register(get_types_from_msg(_text, _name))

TABLE_DTYPE = np.dtype(
    [
        ("note", "<u2"),
        *((name, "<f4") for name in ("x", "y", "z", "length", "width", "height", "yaw")),
        ("class", "u1"),
        ("score", "<f4"),
        ("vx", "<f8"),
        ("vy", "<f8"),
    ]
)
_CODES = {"u1": 2, "u2": 4, "i4": 5, "f4": 7, "f8": 8}
Entry = tuple[str, float, Sequence[float], Sequence[float], Sequence[float]]
"""Class, score, position, size, orientation x y z w."""


def make(type_name: str, **fields: Any) -> Any:
    package, _, name = type_name.partition("/")
    return TYPES.types[f"{package}/msg/{name}"](**fields)


def header(stamp_ns: int, frame_id: str = "map") -> Any:
    stamp = make("builtin_interfaces/Time", sec=stamp_ns // 10**9, nanosec=stamp_ns % 10**9)
    return make("std_msgs/Header", stamp=stamp, frame_id=frame_id)


def table_message(table: Table, stamp_ns: int, frame_id: str = "map", **changes: Any) -> Any:
    fields = [
        make("sensor_msgs/PointField", name=name, offset=entry[1], datatype=_CODES[entry[0].str[1:]], count=1)
        for name, entry in (table.dtype.fields or {}).items()
    ]
    values = {
        "header": header(stamp_ns, frame_id),
        "height": 1,
        "width": len(table),
        "fields": fields,
        "is_bigendian": False,
        "point_step": table.dtype.itemsize,
        "row_step": table.nbytes,
        "data": np.frombuffer(table.tobytes(), np.uint8),
        "is_dense": True,
    }
    return make("sensor_msgs/PointCloud2", **{**values, **changes})


def pose(position: Sequence[float], xyzw: Sequence[float]) -> Any:
    point = make("geometry_msgs/Point", **dict(zip("xyz", map(float, position), strict=True)))
    orientation = make("geometry_msgs/Quaternion", **dict(zip("xyzw", map(float, xyzw), strict=True)))
    return make("geometry_msgs/Pose", position=point, orientation=orientation)


def vector(values: Sequence[float]) -> Any:
    return make("geometry_msgs/Vector3", **dict(zip("xyz", map(float, values), strict=True)))


def marker(entry: Entry, head: Any, *, kind: int = 1, action: int = 0, text: str | None = None) -> Any:
    name, score, position, size, xyzw = entry
    empty = make("sensor_msgs/CompressedImage", header=header(0, ""), format="", data=np.zeros(0, np.uint8))
    zero = make("builtin_interfaces/Duration", sec=0, nanosec=0)
    return make(
        "visualization_msgs/Marker",
        header=head,
        ns=name,
        id=0,
        type=kind,
        action=action,
        pose=pose(position, xyzw),
        scale=vector(size),
        color=make("std_msgs/ColorRGBA", r=0.0, g=0.0, b=0.0, a=1.0),
        lifetime=zero,
        frame_locked=False,
        points=[],
        colors=[],
        texture_resource="",
        texture=empty,
        uv_coordinates=[],
        text=str(score) if text is None else text,
        mesh_resource="",
        mesh_file=make("visualization_msgs/MeshFile", filename="", data=np.zeros(0, np.uint8)),
        mesh_use_embedded_materials=False,
    )


def markers(entries: Iterable[Entry], head: Any) -> Any:
    """MarkerArray of cubes, with a DELETEALL that has no header, and lines."""
    clear = marker(("", 0, (0, 0, 0), (0, 0, 0), (0, 0, 0, 1)), header(0, ""), kind=0, action=3)
    lines = marker(("velocity", 0, (0, 0, 0), (0, 0, 0), (0, 0, 0, 1)), head, kind=5)
    cubes = [marker(entry, head) for entry in entries]
    return make("visualization_msgs/MarkerArray", markers=[clear, lines, *cubes])


def detections(entries: Iterable[Entry], head: Any, *, empty_results: bool = False) -> Any:
    found = []
    for name, score, position, size, xyzw in entries:
        at = make("geometry_msgs/PoseWithCovariance", pose=pose((9, 9, 9), (0, 0, 0, 1)), covariance=np.zeros(36))
        best = make("vision_msgs/ObjectHypothesis", class_id=name, score=score)
        result = make("vision_msgs/ObjectHypothesisWithPose", hypothesis=best, pose=at)
        box = make("vision_msgs/BoundingBox3D", center=pose(position, xyzw), size=vector(size))
        results = [] if empty_results else [result]
        found.append(make("vision_msgs/Detection3D", header=header(0, ""), results=results, bbox=box, id=""))
    return make("vision_msgs/Detection3DArray", header=head, detections=found)


def image(cells: AnyArray, stamp_ns: int, **changes: Any) -> Any:
    """Image from (H, W, C) cells, with padding bytes after each row."""
    height, width, channels = cells.shape
    rows = cells.reshape(height, -1).view(np.uint8)
    padded = np.concatenate([rows, np.full((height, 5), 77, np.uint8)], axis=1)
    values = {
        "header": header(stamp_ns, "ego/base_link"),
        "height": height,
        "width": width,
        "encoding": f"{'8UC' if cells.dtype == np.uint8 else '32FC'}{channels}",
        "is_bigendian": int(cells.dtype.str[0] == ">"),
        "step": padded.shape[1],
        "data": padded.ravel(),
    }
    return make("sensor_msgs/Image", **{**values, **changes})


def occupancy(data: AnyArray, stamp_ns: int, origin: Any = None, resolution_m: float = 0.5) -> Any:
    """OccupancyGrid from (height, width) int8 in message order: x along a row."""
    height, width = data.shape
    corner = pose((-width * resolution_m / 2, -height * resolution_m / 2, 0), (0, 0, 0, 1))
    info = make(
        "nav_msgs/MapMetaData",
        map_load_time=make("builtin_interfaces/Time", sec=0, nanosec=0),
        resolution=resolution_m,
        width=width,
        height=height,
        origin=corner if origin is None else origin,
    )
    return make("nav_msgs/OccupancyGrid", header=header(stamp_ns, "ego/base_link"), info=info, data=data.ravel())


def write_bag(path: Path, messages: Iterable[tuple[str, int, Any]]) -> Path:
    """Write a bag of (topic, log time, message)."""
    with Writer(path, version=9, storage_plugin=StoragePlugin.MCAP) as writer:
        known: dict[str, Any] = {}
        for topic, stamp_ns, message in messages:
            name = message.__msgtype__
            if topic not in known:
                known[topic] = writer.add_connection(topic, name, typestore=TYPES)
            writer.write(known[topic], stamp_ns, TYPES.serialize_cdr(message, name))
    return path
