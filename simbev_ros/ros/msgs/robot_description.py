"""URDF of an agent with its rig, for /robot_description: one link per frame of /tf_static.

All geometry is boxes and cylinders in the text itself. A mesh would be a file that RViz and Foxglove look for on their
own machine, where it is only if this package is installed there; neither accepts meshes inside the text.

Pure: imports no ROS.
"""

import math
from collections.abc import Iterable, Mapping, Sequence
from xml.etree import ElementTree
from xml.etree.ElementTree import Element, SubElement

from simbev_ros.assets.actors.catalog import load_models
from simbev_ros.assets.actors.silhouette import silhouette_boxes, wheel_cylinders
from simbev_ros.config.camera import Camera
from simbev_ros.config.lidar import Lidar
from simbev_ros.config.positioning import Gnss
from simbev_ros.config.radar import Radar
from simbev_ros.config.sensor import Sensor
from simbev_ros.foundation.geometry.transforms import rpy_from_rotation
from simbev_ros.foundation.types import Float64Array
from simbev_ros.scene.blueprints import blueprint_index
from simbev_ros.scene.frames import base_link_frame, ego_frame, fixed_frames
from simbev_ros.schema.scene.agents import AgentView

_TIRE_RGB, _SENSOR_RGB = (24, 24, 26), (230, 90, 30)
_SMALL_BODY = "box", {"size": "0.06 0.06 0.03"}
_BODIES: Mapping[type[Sensor], tuple[str, dict[str, str]]] = {
    Camera: ("box", {"size": "0.08 0.10 0.06"}),
    Lidar: ("cylinder", {"radius": "0.06", "length": "0.09"}),
    Radar: ("box", {"size": "0.04 0.14 0.08"}),
    Gnss: ("cylinder", {"radius": "0.05", "length": "0.03"}),
}
"""Shape of each kind of sensor in its frame (x forward, z up), m; other kinds are small boxes."""
_LYING_RPY_RAD = (math.pi / 2.0, 0.0, 0.0)
"""Turns a cylinder's axis from z to y."""


def robot_description(view: AgentView) -> str:
    """URDF of an agent.

    The root link is ``<agent>/base_link``. Fixed joints lead to the frame of every sensor, from a camera's body to its
    optical frame, and to the ego frame if that is another one. The car itself belongs to the ego frame: boxes from cuts
    through the blueprint's mesh, in the ego's color, and a cylinder per wheel. A roadside unit has sensors only.
    """
    vehicle = view.vehicle
    robot = Element("robot", name=view.agent if vehicle is None else vehicle.blueprint)
    links = {(root := base_link_frame(view.agent)): SubElement(robot, "link", name=root)}
    for frame in fixed_frames(view):
        links[frame.name] = link = _child_link(robot, frame.parent, frame.name, frame.parent_from_frame)
        if frame.sensor is not None:
            _add_visual(link, *_BODIES.get(type(frame.sensor), _SMALL_BODY), _SENSOR_RGB)
    if vehicle is not None:
        add_car(links[ego_frame(view)], vehicle.blueprint, vehicle.color)
    ElementTree.indent(robot)
    return ElementTree.tostring(robot, encoding="unicode", xml_declaration=False) + "\n"


def add_car(link: Element, blueprint: str, paint: int) -> None:
    """Add the shape of a vehicle with a paint, 0xRRGGBB, to the link of its ego frame."""
    model = load_models()[blueprint_index()[blueprint]]
    for box in silhouette_boxes(model, paint):
        _add_visual(link, "box", {"size": _text(box.size_m, 3)}, box.rgb, box.center_m)
    for wheel in wheel_cylinders(model):
        shape = {"radius": _text([wheel.radius_m], 3), "length": _text([wheel.width_m], 3)}
        _add_visual(link, "cylinder", shape, _TIRE_RGB, wheel.center_m, _LYING_RPY_RAD)


def _child_link(robot: Element, parent: str, child: str, parent_from_child: Float64Array) -> Element:
    """Add a link that is fixed to another one."""
    joint = SubElement(robot, "joint", name=f"{child}_joint", type="fixed")
    SubElement(joint, "parent", link=parent)
    SubElement(joint, "child", link=child)
    rpy_rad = rpy_from_rotation(parent_from_child[:3, :3])
    SubElement(joint, "origin", xyz=_text(parent_from_child[:3, 3].tolist(), 9), rpy=_text(rpy_rad.tolist(), 9))
    return SubElement(robot, "link", name=child)


def _add_visual(
    link: Element,
    shape: str,
    dimensions: dict[str, str],
    rgb: tuple[int, int, int],
    center_m: Sequence[float] = (0.0, 0.0, 0.0),
    rpy_rad: Sequence[float] = (0.0, 0.0, 0.0),
) -> None:
    visual = SubElement(link, "visual")
    SubElement(visual, "origin", xyz=_text(center_m, 3), rpy=_text(rpy_rad, 9))
    SubElement(SubElement(visual, "geometry"), shape, dimensions)
    material = SubElement(visual, "material", name="rgb{:02x}{:02x}{:02x}".format(*rgb))
    SubElement(material, "color", rgba=_text([*(channel / 255.0 for channel in rgb), 1.0], 3))


def _text(numbers: Iterable[float], digits: int) -> str:
    """Numbers as URDF writes them, without signs of zeros."""
    return " ".join(f"{round(number, digits) + 0.0:.{digits}f}".rstrip("0").rstrip(".") for number in numbers)
