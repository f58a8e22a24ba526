"""Converts rows of /ego/boxes to the box dictionaries of the SimBEV layout, one file for each frame.

Boxes, signals and the legend of a scene enter; the bytes of a ground-truth file leave. Vectors are in the map frame,
right-handed; angles are degrees. ``location`` is the center of the box's lower face. ``opendrive_id`` is that of the
signal in /world/map whose state a head shows: the one of the straightest movement, as several signals of the file may
share a head. It is None where an imported map has no signal for a controlled lane. The numbers of points are 0 for a
box for which no lidar or radar data were received.
"""

from collections import Counter
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from simbev_ros.export.simbev.encodings import npy_of_records
from simbev_ros.foundation.geometry.transforms import rotations_from_rpy
from simbev_ros.foundation.semantics import BOX_CLASSES, DIFFICULTIES, SIGN_TYPES, Tag
from simbev_ros.foundation.types import Float64Array, Table
from simbev_ros.schema.boxes import LIGHT_IDS, NO_BLUEPRINT
from simbev_ros.schema.scene.spec import ALL_RED_S, YELLOW_S
from simbev_ros.schema.scene.state import SignalState

_UNIT_CORNERS = np.array([(x, -y, z) for x in (-0.5, 0.5) for y in (-0.5, 0.5) for z in (-0.5, 0.5)])
"""(8, 3) corners of the unit box in CARLA's order: index 4·ix + 2·iy + iz along its axes, with y to the right."""

_STATES = {
    SignalState.OFF: "Off",
    SignalState.RED: "Red",
    SignalState.YELLOW: "Yellow",
    SignalState.GREEN: "Green",
    SignalState.RED_YELLOW: "Red",
}
"""CARLA's names of signal states; it has no red with yellow, which still forbids driving."""

_CARLA_KINDS = {"pedestrian": "walker.pedestrian", "prop": "static.prop", "trailer": "vehicle.trailer"}
"""First words of CARLA's type names that differ from those of our blueprints."""

_MPS_TO_KMH = 3.6


def box_file(boxes: Table, signals: Table, legend: Mapping[str, Any]) -> bytes:
    """Content of a frame's box file: an array of dictionaries in numpy's format; arguments as for ``box_records``."""
    return npy_of_records(box_records(boxes, signals, legend))


def box_records(boxes: Table, signals: Table, legend: Mapping[str, Any]) -> list[dict[str, Any]]:
    """The boxes of a frame as dictionaries of the SimBEV layout, one for each box.

    Args:
        boxes: (N,) rows of /ego/boxes.
        signals: Rows of /world/signals of the same tick.
        legend: Content of /world/legend.
    """
    rpy_rad = np.stack([boxes[name] for name in ("roll", "pitch", "yaw")], axis=1).astype(np.float64)
    size_m = np.stack([boxes[name] for name in ("length", "width", "height")], axis=1).astype(np.float64)
    center_m = _vectors(boxes, "x", "y", "z")
    map_from_box = rotations_from_rpy(rpy_rad)
    corners_m = np.einsum("nij,nkj->nki", map_from_box, _UNIT_CORNERS * size_m[:, None]) + center_m[:, None]
    vectors = {
        "bounding_box": corners_m,
        "location": center_m - map_from_box[:, :, 2] * size_m[:, 2:] / 2.0,
        "rotation": np.degrees(rpy_rad),
        "linear_velocity": _vectors(boxes, "vx", "vy", "vz"),
        "angular_velocity": np.degrees(_vectors(boxes, "wx", "wy", "wz")),
    }
    heads = _heads(legend["signals"])
    records = []
    for index, row in enumerate(boxes):
        record = {
            **_identity(row, legend["blueprints"]),
            **{name: values[index] for name, values in vectors.items()},
            **_labels(row),
        }
        if row["tag"] == Tag.TRAFFIC_LIGHT:
            signal_row = int(row["id"]) - LIGHT_IDS - 1
            record |= _light(row, signals[signal_row]) | heads[signal_row]
        elif row["tag"] == Tag.TRAFFIC_SIGN:
            record["sign_type"] = SIGN_TYPES[row["sign"]]
        records.append(record)
    return records


def _heads(signals: Sequence[Mapping[str, Any]]) -> list[dict[str, Any]]:
    """For each signal of a legend its OpenDRIVE id, and its index among the heads of its signal program."""
    counts, heads = Counter[str](), []
    for signal in signals:
        heads.append({"opendrive_id": signal["opendrive_id"], "pole_index": counts[signal["programme"]]})
        counts[signal["programme"]] += 1
    return heads


def _identity(row: Table, blueprints: Sequence[Mapping[str, Any]]) -> dict[str, Any]:
    blueprint = blueprints[int(row["blueprint"])] if row["blueprint"] != NO_BLUEPRINT else None
    return {
        "id": int(row["id"]),
        "type": _actor_type(blueprint) if blueprint else _static_type(row),
        "is_alive": True,
        "is_active": True,
        "is_dormant": False,
        "parent": int(row["parent"]) or None,
        "attributes": _attributes(row, blueprint) if blueprint else {},
        "semantic_tags": [int(row["tag"])],
    }


def _actor_type(blueprint: Mapping[str, Any]) -> str:
    """Type name of an actor in CARLA's form, in which filters look for ``vehicle.``, ``walker.`` and ``static.``."""
    kind, _, name = blueprint["name"].partition(".")
    kind = "pedestrian" if blueprint["class"] == "pedestrian" else kind  # workers are props that stand
    return f"{_CARLA_KINDS.get(kind, kind)}.{name}"


def _static_type(row: Table) -> str:
    """CARLA's type name of a traffic light or sign."""
    if row["tag"] == Tag.TRAFFIC_LIGHT:
        return "traffic.traffic_light"
    kind = SIGN_TYPES[row["sign"]]
    return f"traffic.{kind}.{row['limit'] * _MPS_TO_KMH:.0f}" if row["limit"] > 0 else f"traffic.{kind}"


def _attributes(row: Table, blueprint: Mapping[str, Any]) -> dict[str, str]:
    """Attributes of an actor as strings, like CARLA's; the bits are explained in /world/legend."""
    color = int(row["color"])
    return {
        "role_name": "autopilot",
        "base_type": blueprint["class"],
        "special_type": "emergency" if blueprint["emergency"] else "",
        "color": f"{color >> 16},{color >> 8 & 255},{color & 255}",
        "light_bits": str(row["lights"]),
        "behavior_bits": str(row["behavior"]),
        "open_doors": str(row["doors"]),
    }


def _labels(row: Table) -> dict[str, Any]:
    return {
        "distance_to_ego": float(row["distance"]),
        "angle_to_ego": float(np.degrees(row["angle"])),
        "num_lidar_pts": max(int(row["lidar_points"]), 0),
        "num_radar_pts": max(int(row["radar_points"]), 0),
        "valid_flag": bool(row["valid"]),
        "class": BOX_CLASSES[row["class"]],
        "difficulty": DIFFICULTIES[row["difficulty"]],
    }


def _light(row: Table, signal: Table) -> dict[str, Any]:
    return {
        "green_time": float(signal["green_time"]),
        "yellow_time": YELLOW_S,
        "red_time": ALL_RED_S,
        "state": _STATES[SignalState(int(row["state"]))],
    }


def _vectors(boxes: Table, *names: str) -> Float64Array:
    return np.stack([boxes[name] for name in names], axis=1).astype(np.float64)
