"""Converts the stack's input messages to arrays and its results to ROS messages."""

from array import array

import numpy as np
from builtin_interfaces.msg import Time
from geometry_msgs.msg import Point, Pose, Quaternion, Vector3
from nav_msgs.msg import Odometry
from sensor_msgs.msg import Image, PointCloud2, PointField
from std_msgs.msg import ColorRGBA, Header
from visualization_msgs.msg import Marker, MarkerArray

from simbev_ros.reference_stack.arrays import Bytes, Floats, Integers, Table
from simbev_ros.reference_stack.classes import load_kinds

_NS_PER_S = 1_000_000_000
_FIELD_TYPES = {"f4": PointField.FLOAT32, "f8": PointField.FLOAT64, "i4": PointField.INT32, "u1": PointField.UINT8}
_MIN_SHOWN_SCORE = 0.3
_COLORS = {
    "car": (0.1, 0.6, 1.0),
    "truck": (0.1, 0.3, 1.0),
    "bus": (0.5, 0.3, 1.0),
    "motorcycle": (1.0, 0.3, 0.8),
    "bicycle": (1.0, 0.6, 0.8),
    "pedestrian": (1.0, 0.6, 0.1),
}


def stamp_ns_of(header: Header) -> int:
    """Stamp of a header in nanoseconds."""
    return int(header.stamp.sec) * _NS_PER_S + int(header.stamp.nanosec)


def header_of(stamp_ns: int, frame: str) -> Header:
    """Header with a stamp in nanoseconds and a frame."""
    sec, nanosec = divmod(stamp_ns, _NS_PER_S)
    return Header(stamp=Time(sec=sec, nanosec=nanosec), frame_id=frame)


def points_of(cloud: PointCloud2) -> tuple[Floats, Integers]:
    """(N, 3) points, lidar frame, and (N,) rings of a cloud with the fields x, y, z (float32) and ring (uint16)."""
    offset = {field.name: field.offset for field in cloud.fields}
    names = ["x", "y", "z", "ring"]
    formats, offsets = ["<f4", "<f4", "<f4", "<u2"], [offset[name] for name in names]
    dtype = np.dtype({"names": names, "formats": formats, "offsets": offsets, "itemsize": cloud.point_step})
    rows = np.frombuffer(cloud.data, dtype, count=cloud.width * cloud.height)
    return np.stack([rows[name] for name in "xyz"], axis=1, dtype=np.float64), rows["ring"].astype(np.int64)


def pose_of(odometry: Odometry) -> Floats:
    """(4, 4) pose of an odometry message: map from base_link."""
    position, rotation = odometry.pose.pose.position, odometry.pose.pose.orientation
    x, y, z, w = rotation.x, rotation.y, rotation.z, rotation.w
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w), position.x],
            [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w), position.y],
            [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y), position.z],
            [0.0, 0.0, 0.0, 1.0],
        ]
    )


def table_message(table: Table, header: Header) -> PointCloud2:
    """Message with one point per row and one field per column of a table."""
    return PointCloud2(
        header=header,
        height=1,
        width=len(table),
        fields=[
            PointField(name=name, offset=field[1], datatype=_FIELD_TYPES[field[0].str[1:]], count=1)
            for name, field in (table.dtype.fields or {}).items()
        ],
        point_step=table.itemsize,
        row_step=table.nbytes,
        data=array("B", table.tobytes()),
        is_dense=True,
    )


def table_of(message: PointCloud2, dtype: np.dtype[np.void]) -> Table:
    """(N,) rows of a message with one point per row, such as ``table_message`` makes, with the columns of a dtype.

    Raises:
        ValueError: The message lacks a column, or its data are too short.
    """
    formats = {number: name for name, number in _FIELD_TYPES.items()}
    fields = {field.name: field for field in message.fields if field.datatype in formats}
    names = dtype.names or ()
    missing = [name for name in names if name not in fields]
    if missing:
        raise ValueError(f"a table has no column {missing[0]}, but {', '.join(fields)}")
    layout = np.dtype(
        {
            "names": names,
            "formats": [f"<{formats[fields[name].datatype]}" for name in names],
            "offsets": [fields[name].offset for name in names],
            "itemsize": message.point_step,
        }
    )
    rows = np.frombuffer(message.data, layout, count=message.width * message.height)
    table: Table = rows.astype(dtype)
    return table


def scores_message(scores: Bytes, header: Header) -> Image:
    """Image message of (rows, columns, channels) scores, 255 = certain."""
    rows, columns, channels = scores.shape
    return Image(
        header=header,
        height=rows,
        width=columns,
        encoding=f"8UC{channels}",
        step=columns * channels,
        data=array("B", scores.tobytes()),
    )


def markers_message(boxes: Table, header: Header) -> MarkerArray:
    """Cubes of all boxes above a minimum score, more opaque for higher scores; earlier cubes are deleted."""
    kinds = load_kinds()
    name_of = dict(zip(kinds.class_number.tolist(), kinds.class_name, strict=True))
    markers = [Marker(header=header, action=Marker.DELETEALL)]
    for index, box in enumerate(boxes[boxes["score"] >= _MIN_SHOWN_SCORE]):
        name, score, half_rad = name_of[int(box["class"])], float(box["score"]), float(box["yaw"]) / 2
        red, green, blue = _COLORS[name]
        number = int(box["id"]) if box["id"] >= 0 else -1 - index
        marker = Marker(header=header, ns=name, id=number, type=Marker.CUBE, text=f"{score:.2f}")
        marker.pose = Pose(
            position=Point(x=float(box["x"]), y=float(box["y"]), z=float(box["z"])),
            orientation=Quaternion(z=float(np.sin(half_rad)), w=float(np.cos(half_rad))),
        )
        marker.scale = Vector3(x=float(box["length"]), y=float(box["width"]), z=float(box["height"]))
        marker.color = ColorRGBA(r=red, g=green, b=blue, a=0.2 + 0.5 * score)
        markers.append(marker)
    return MarkerArray(markers=markers)
