"""Table of messages between agents (V2X)."""

from typing import Final

import numpy as np

from simbev_ros.foundation.geometry.transforms import matrices_from_xyz_rpy
from simbev_ros.foundation.types import Table
from simbev_ros.schema.boxes import NO_CLASS

V2X_DTYPE = np.dtype(
    [
        ("sender", "<u4"),  # actor id of the sender's vehicle; a roadside unit has an id of its own, from 0x30000 on
        ("id", "<u4"),  # id of the box; 0: the row is the sender's own pose
        ("class", "u1"),  # index into BOX_CLASSES; 255: a roadside unit
        ("x", "<f8"),  # m, map frame: center of the box; of the sender the origin of its ego frame, on the ground
        ("y", "<f8"),
        ("z", "<f8"),
        ("roll", "<f4"),  # rad, as in boxes
        ("pitch", "<f4"),
        ("yaw", "<f4"),
        ("length", "<f4"),  # m, along x, y, z of the box; 0: a roadside unit
        ("width", "<f4"),
        ("height", "<f4"),
        ("vx", "<f4"),  # m/s, map frame
        ("vy", "<f4"),
        ("vz", "<f4"),
        ("lidar_points", "<i4"),  # of the sender; -1: none received, or the row is the sender itself
        ("radar_points", "<i4"),
        ("visibility", "<f4"),  # to the sender's cameras; NaN: in no image, or the row is the sender itself
        ("tick", "<i4"),  # tick at which the message was sent, counted from the first frame of the scene
    ]
)
"""Row of a message, and of the table of all messages that arrive at a tick."""


OWN_POSE: Final = 0
"""Id of the row with the sender's own pose."""


def boxes_of_messages(rows: Table) -> Table:
    """Rows of messages as boxes: with the centers of the senders' own boxes and their ids, without roadside units."""
    result: Table = rows[(rows["id"] != OWN_POSE) | (rows["class"] != NO_CLASS)].copy()
    own = result["id"] == OWN_POSE
    xyz, rpy = (
        np.stack([result[own][name] for name in names], axis=-1)
        for names in (("x", "y", "z"), ("roll", "pitch", "yaw"))
    )
    up = matrices_from_xyz_rpy(xyz, rpy.astype(np.float64))[:, :3, 2]
    for axis, name in enumerate("xyz"):
        result[name][own] += up[:, axis] * result["height"][own] / 2.0
    result["id"][own] = result["sender"][own]
    return result
