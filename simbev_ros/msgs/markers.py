"""Boxes → markers for RViz and Foxglove."""

import numpy as np
from geometry_msgs.msg import Point, Vector3
from std_msgs.msg import ColorRGBA
from visualization_msgs.msg import Marker, MarkerArray

from simbev_ros.geometry.transforms import quaternion_from_rpy
from simbev_ros.msgs.stamps import header
from simbev_ros.msgs.world import MAP_FRAME, quaternion_message
from simbev_ros.palette import class_color
from simbev_ros.semantics import BOX_CLASSES
from simbev_ros.types import Table


def box_markers(boxes: Table, stamp_ns: int) -> MarkerArray:
    """One cube a box, in the map frame, with the actor's id; a DELETEALL before them removes what has gone.

    Args:
        boxes: (N,) ``BOX_DTYPE``.
        stamp_ns: Stamp of all markers.
    """
    rpy = np.stack([boxes["roll"], boxes["pitch"], boxes["yaw"]], axis=-1)
    markers = [Marker(header=header(stamp_ns, MAP_FRAME), action=Marker.DELETEALL)]
    for box, quaternion in zip(boxes, quaternion_from_rpy(rpy), strict=True):
        name = BOX_CLASSES[box["class"]]
        marker = Marker(header=markers[0].header, ns=name, id=int(box["id"]), type=Marker.CUBE, action=Marker.ADD)
        marker.pose.position = Point(x=float(box["x"]), y=float(box["y"]), z=float(box["z"]))
        marker.pose.orientation = quaternion_message(quaternion)
        marker.scale = Vector3(x=float(box["length"]), y=float(box["width"]), z=float(box["height"]))
        red, green, blue = (channel / 255.0 for channel in class_color(name))
        marker.color = ColorRGBA(r=red, g=green, b=blue, a=0.5)
        markers.append(marker)
    return MarkerArray(markers=markers)
