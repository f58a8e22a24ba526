"""Radii of points and lines as Rerun draws them: in UI points, so that they are as large far away as close by.

A UI point is a pixel of a screen that is not scaled. A line is two radii wide.
"""

from typing import Final

import rerun as rr

HAIRLINE: Final = rr.Radius.ui_points(0.5)
"""2D boxes of what is hidden."""
THIN_LINE: Final = rr.Radius.ui_points(0.75)
"""Boxes and lines of the map, of which many are shown."""
LINE: Final = rr.Radius.ui_points(1.0)
"""The ego's outline and its path."""
LIDAR_POINT: Final = rr.Radius.ui_points(1.0)
RADAR_POINT: Final = rr.Radius.ui_points(1.5)
FIX: Final = rr.Radius.ui_points(8.0)
"""The GNSS receiver's newest position."""
TRACK: Final = rr.Radius.ui_points(2.0)
"""The positions before it, on the same map."""
