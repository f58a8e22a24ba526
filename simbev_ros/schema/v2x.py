"""Table of messages between agents (V2X)."""

from typing import Final

import numpy as np

from simbev_ros.schema.boxes import BOX_DTYPE

_BOX_COLUMNS = (
    *("id", "class", "x", "y", "z", "roll", "pitch", "yaw", "length", "width", "height", "vx", "vy", "vz"),
    *("lidar_points", "radar_points", "visibility"),
)

V2X_DTYPE = np.dtype(
    [
        ("sender", "<u4"),  # actor id of the sender's vehicle; a roadside unit has an id of its own, from 0x30000 on
        *((name, BOX_DTYPE[name]) for name in _BOX_COLUMNS),
        ("tick", "<i4"),  # tick at which the message was sent, counted from the first frame of the scene
    ]
)
"""Row of a message, and of the table of all messages that arrive at a tick.

The other columns are those of boxes, with points and visibility as the sender has them. The first row of a message is
the sender itself: its id is ``OWN_POSE``, x, y and z are those of its ego frame's origin, on the ground, and it has no
points and no visibility. A roadside unit has the class ``NO_CLASS`` and no size.
"""


OWN_POSE: Final = 0
"""Id in the row that tells the sender's pose."""
