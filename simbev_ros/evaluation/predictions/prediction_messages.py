"""Converts a perception stack's messages to boxes and score grids.

Messages may be objects of rclpy or of rosbags; the results are ``PredictedBoxes`` and score arrays. The bag reader and
the live evaluator share this code, which imports no ROS.

Boxes:

* sensor_msgs/msg/PointCloud2: a table with the fields x y z length width height yaw, class (a number) and score;
  optional vx vy vz, and id, a whole number, of the track that the box belongs to (negative: of none); other fields are
  ignored.
* visualization_msgs/msg/MarkerArray: each CUBE with action ADD is a box: ns = class, text = score ("": 1.0), pose =
  center and heading, scale = length, width, height; markers of other types are ignored. Ids do not count, because
  viewers need some of any marker.
* vision_msgs/msg/Detection3DArray: results[0].hypothesis.class_id (name or number) and score, bbox.center, bbox.size;
  id, any text, of the track (empty: none).

Scores:

* sensor_msgs/msg/Image of all BEV classes, 8UC14, where 255 is 1, or 32FC14, 0 … 1; row 0 ahead, column 0 left.
* nav_msgs/msg/OccupancyGrid of one class: 0 … 100, and -1 as 0; centered on the ego as in our own messages, with x
  running fastest and the first cell behind and right of the ego.

The header gives stamp and coordinate frame; in a MarkerArray it is that of the first marker with a frame_id. An empty
MarkerArray has neither, and so answers no frame: a stack that finds nothing should send DELETEALL with a header.
"""

from collections.abc import Callable, Mapping
from hashlib import blake2b
from typing import Any

import numpy as np

from simbev_ros.evaluation.metrics.boxes import NO_TRACK
from simbev_ros.evaluation.predictions.predicted_boxes import (
    BOX_COLUMNS,
    TRACK_COLUMN,
    UPRIGHT,
    VELOCITY_COLUMNS,
    PredictedBoxes,
    Reference,
    Rows,
    named_labels,
    numbered_labels,
    predictions_from_columns,
)
from simbev_ros.foundation.errors import InputError
from simbev_ros.foundation.semantics import BEV_CLASSES
from simbev_ros.foundation.types import AnyArray, Float32Array, Float64Array, UInt8Array
from simbev_ros.foundation.units import NS_PER_S
from simbev_ros.recording.arrays import point_array

_CUBE, _ADD = 1, 0
_FULL_PERCENT = 100
_SCORE_DTYPES: Mapping[str, np.dtype[Any]] = {
    f"8UC{len(BEV_CLASSES)}": np.dtype("u1"),
    f"32FC{len(BEV_CLASSES)}": np.dtype("f4"),
}
_MAX_YAW_RAD = 0.1
"""Maximum angle between the x axis of an OccupancyGrid and the ego's."""


def header_of(message: Any) -> Any | None:
    """The header with stamp and coordinate frame; None for a MarkerArray without one."""
    if not hasattr(message, "markers"):
        return message.header
    return next((each.header for each in message.markers if each.header.frame_id), None)


def stamp_ns_of(message: Any) -> int | None:
    """Stamp of the frame that a message answers, ns; None if it has none."""
    header = header_of(message)
    return None if header is None else int(header.stamp.sec) * NS_PER_S + int(header.stamp.nanosec)


def message_boxes(type_name: str, message: Any, tick: int, source: str) -> PredictedBoxes:
    """Boxes of one frame from a message.

    Args:
        type_name: One of ``BOX_TYPES``.
        message: Message of this type.
        tick: Tick of the frame that it answers.
        source: Its topic, for error messages, which count points, cubes or detections as rows, from 0.

    Raises:
        InputError: The content is not valid boxes.
    """
    columns, label = BOX_TYPES[type_name](message, source)
    rows = Rows(source, np.arange(len(label)))
    predictions = predictions_from_columns(columns, label, np.full(len(label), tick, np.int64), rows)
    header = header_of(message)
    frame_id = "" if header is None else header.frame_id
    if not frame_id and len(label):
        raise InputError(f"{source}: header.frame_id: is empty; it must be a coordinate frame, such as 'map'")
    return PredictedBoxes.with_reference(predictions, Reference(frame_id, source))


def image_scores(message: Any, source: str) -> AnyArray:
    """(C, H, W) scores of all BEV classes from a ``sensor_msgs/msg/Image``; uint8 or float32.

    Raises:
        InputError: The encoding is not supported, or the size of the data disagrees with the header fields.
    """
    dtype = _SCORE_DTYPES.get(message.encoding)
    if dtype is None:
        raise InputError(f"{source}: encoding: is {message.encoding!r}; allowed: {', '.join(_SCORE_DTYPES)}")
    row_bytes = message.width * len(BEV_CLASSES) * dtype.itemsize
    data = np.frombuffer(message.data, np.uint8)
    if message.step < row_bytes or data.size != message.step * message.height:
        size = f"{message.width} x {message.height} {message.encoding}"
        raise InputError(f"{source}: data: {data.size} bytes, step {message.step}, are not an image of {size}")
    rows = np.ascontiguousarray(data.reshape(message.height, message.step)[:, :row_bytes])
    cells = rows.view(dtype.newbyteorder(">" if message.is_bigendian else "<"))
    layers = np.moveaxis(cells.reshape(message.height, message.width, len(BEV_CLASSES)), -1, 0)
    return np.ascontiguousarray(layers, dtype)


def occupancy_scores(message: Any, source: str) -> Float32Array:
    """(H, W) float32 scores of one class from a ``nav_msgs/msg/OccupancyGrid``, row 0 ahead, column 0 left.

    Raises:
        InputError: The grid is not centered on the ego and aligned with it, a value is invalid, or the size of the data
            disagrees with the header fields.
    """
    info, cells = message.info, np.frombuffer(message.data, np.int8)
    if cells.size != info.width * info.height:
        raise InputError(f"{source}: data: {cells.size} cells do not form a grid of {info.width} x {info.height}")
    _require_centered(info, source)
    bad = (cells < -1) | (cells > _FULL_PERCENT)
    if bad.any():
        index = int(np.argmax(bad))
        raise InputError(f"{source}: data: cell {index} is {cells[index]}; allowed: 0 to {_FULL_PERCENT}, and -1")
    percent = cells.reshape(info.height, info.width).T[::-1, ::-1].clip(0)
    return np.ascontiguousarray(percent, np.float32) / np.float32(_FULL_PERCENT)


def _require_centered(info: Any, source: str) -> None:
    """Raise InputError unless the grid is centered on the ego and aligned with it.

    The origin of our own grids is half a grid behind and right of the ego, or slightly less if the car is tilted.
    """
    position, orientation = info.origin.position, info.origin.orientation
    corner_m = -info.resolution * np.array([info.width, info.height]) / 2.0
    origin_m = np.array([position.x, position.y])
    yaw_rad = np.arctan2(
        2 * (orientation.w * orientation.z + orientation.x * orientation.y),
        1 - 2 * (orientation.y * orientation.y + orientation.z * orientation.z),  # ** would overflow
    )
    tolerance_m = 0.02 * float(np.abs(corner_m).max()) + info.resolution
    if not (np.abs(origin_m - corner_m).max() <= tolerance_m and abs(yaw_rad) <= _MAX_YAW_RAD):
        found = f"x {position.x:g}, y {position.y:g}, yaw {yaw_rad:.3g}"
        allowed = f"x {corner_m[0]:g}, y {corner_m[1]:g}, yaw 0: the grid is centered on the ego and turns with it"
        raise InputError(f"{source}: info.origin: is {found}; it must be {allowed}")


_Columns = tuple[Mapping[str, AnyArray], UInt8Array]


def _table_columns(message: Any, source: str) -> _Columns:
    if message.width * message.height == 0:
        return dict.fromkeys(("score", *BOX_COLUMNS), np.zeros(0)), np.zeros(0, np.uint8)
    try:
        table = point_array(message)
    except (InputError, KeyError) as error:
        raise InputError(f"{source}: fields: {error}") from None
    names = table.dtype.names or ()
    for name in ("class", "score", *BOX_COLUMNS):
        if name not in names:
            raise InputError(f"{source}: {name}: there is no such field; it has {', '.join(names)}")
        if table.dtype[name].shape:
            raise InputError(f"{source}: {name}: has the count {table.dtype[name].shape[0]}; it must be 1")
    for name in ("class", TRACK_COLUMN):
        if name in names and table.dtype[name].kind not in "iu":
            raise InputError(f"{source}: {name}: is of the type {table.dtype[name]}; it must be a whole-number type")
    rows = Rows(source, np.arange(len(table)))
    label = numbered_labels(table["class"].astype(np.int64), rows, may_be_empty=False)
    known = ("score", *BOX_COLUMNS, *VELOCITY_COLUMNS, TRACK_COLUMN)
    return {name: table[name] for name in known if name in names}, label


def _marker_columns(message: Any, source: str) -> _Columns:
    cubes = [each for each in message.markers if _is_box(each)]
    header = header_of(message)
    for row, each in enumerate(cubes):
        if header is not None and each.header != header:
            raise InputError(f"{source}: header: that of row {row} differs from the first marker's; all must be equal")
    poses = [(each.pose, each.scale) for each in cubes]
    scores = [_parse_score(each.text, row, source) for row, each in enumerate(cubes)]
    return _box_columns(poses, scores, [each.ns for each in cubes], source)


def _detection_columns(message: Any, source: str) -> _Columns:
    try:
        for row, each in enumerate(message.detections):
            if not len(each.results):
                raise InputError(f"{source}: results: row {row} has none; the first one must be class and score")
        best = [each.results[0].hypothesis for each in message.detections]
        scores, classes = [each.score for each in best], [each.class_id for each in best]
        poses = [(each.bbox.center, each.bbox.size) for each in message.detections]
        columns, label = _box_columns(poses, scores, classes, source)
        tracks = [_track_of(getattr(each, "id", "")) for each in message.detections]
        return {**columns, TRACK_COLUMN: np.array(tracks, np.int64)}, label
    except AttributeError as error:  # of these types, only this one has changed between ROS releases
        raise InputError(f"{source}: {error}; vision_msgs of ROS 2 Galactic or later is required") from None


def _track_of(text: str) -> int:
    """Number of a track with any text as its id, the same in every message; ``NO_TRACK`` without a text."""
    return int.from_bytes(blake2b(text.encode(), digest_size=7).digest(), "big") if text else NO_TRACK


def _box_columns(poses: list[tuple[Any, Any]], scores: list[float], classes: list[str], source: str) -> _Columns:
    """Columns and labels from (pose, size) pairs."""
    rows = Rows(source, np.arange(len(poses)))
    vectors = np.array([(p.position.x, p.position.y, p.position.z, s.x, s.y, s.z) for p, s in poses]).reshape(-1, 6)
    orientations = [(p.orientation.x, p.orientation.y, p.orientation.z, p.orientation.w) for p, _ in poses]
    code = {name: index for index, name in enumerate(dict.fromkeys(classes))}
    label = named_labels([*code], np.array([code[name] for name in classes], np.int64), rows, may_be_empty=False)
    columns = dict(zip(("x", "y", "z", "length", "width", "height"), vectors.T, strict=True))
    yaw_rad = _yaws_rad(np.array(orientations, np.float64).reshape(-1, 4), rows)
    return {**columns, "score": np.array(scores, np.float64), "yaw": yaw_rad}, label


def _yaws_rad(xyzw: Float64Array, rows: Rows) -> Float64Array:
    """(N,) yaws of (N, 4) quaternions of any length but zero."""
    with np.errstate(over="ignore"):  # an infinite length is refused
        length = np.linalg.norm(xyzw, axis=1)
    rows.require("orientation", np.isfinite(length) & (length > 0), xyzw, "a quaternion x y z w other than 0")
    x, y, z, w = (xyzw / length[:, None]).T
    rows.require("orientation", 1 - 2 * (x * x + y * y) >= UPRIGHT, xyzw, "upright: x y z w of a turn about z")
    return np.arctan2(2 * (w * z + x * y), 1 - 2 * (y * y + z * z))


def _is_box(marker: Any) -> bool:
    return bool(marker.type == _CUBE and marker.action == _ADD)


def _parse_score(text: str, row: int, source: str) -> float:
    try:
        return float(text) if text else 1.0
    except ValueError:
        raise InputError(f"{source}: text: row {row} is {text!r}; it must be the score, or empty for 1.0") from None


MARKERS_TYPE = "visualization_msgs/msg/MarkerArray"
IMAGE_TYPE, OCCUPANCY_TYPE = "sensor_msgs/msg/Image", "nav_msgs/msg/OccupancyGrid"
BOX_TYPES: Mapping[str, Callable[[Any, str], _Columns]] = {
    "sensor_msgs/msg/PointCloud2": _table_columns,
    MARKERS_TYPE: _marker_columns,
    "vision_msgs/msg/Detection3DArray": _detection_columns,
}
"""Function that extracts columns and labels from a message, by message type."""
