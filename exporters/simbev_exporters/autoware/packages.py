"""Autoware's packages that describe a vehicle and its sensors, in the layout of its sample packages.

A rig and a blueprint enter; contents of files by path leave. base_link is at the rear axle on the ground, whatever the
configuration says. Frames of sensors have the names that the graph's messages have, such as ``ego/lidar``.
"""

from collections.abc import Iterator, Mapping
from xml.etree import ElementTree
from xml.etree.ElementTree import Element, SubElement

import numpy as np
import yaml

from simbev_ros import __version__
from simbev_ros.assets.actors.catalog import load_models
from simbev_ros.assets.actors.silhouette import wheel_cylinders
from simbev_ros.config.camera import Camera
from simbev_ros.config.lidar import Lidar
from simbev_ros.config.rig import Rig
from simbev_ros.foundation.geometry.transforms import SENSOR_FROM_OPTICAL, inverse, rpy_from_rotation
from simbev_ros.foundation.types import Float64Array
from simbev_ros.ros.msgs.robot_description import add_car
from simbev_ros.scene.blueprints import Blueprint, blueprint_index
from simbev_ros.simulation.world.driving.vehicle_model import Dynamics

KIT = "sensor_kit_base_link"
_XACRO = "http://ros.org/wiki/xacro"
_DECIMALS = 9
_AXES = ("x", "y", "z", "roll", "pitch", "yaw")
_PAINT = 0x8A8F98

Calibration = dict[str, dict[str, dict[str, float]]]
"""Pose of each frame about another one: x, y, z in meters, roll, pitch, yaw in radians."""

_CMAKE = """cmake_minimum_required(VERSION 3.14)
project({name})

find_package(ament_cmake_auto REQUIRED)
ament_auto_find_build_dependencies()
ament_auto_package(INSTALL_TO_SHARE config urdf)
"""


def description_packages(rig: Rig, blueprint: Blueprint, name: str) -> dict[str, bytes]:
    """Files of ``<name>_vehicle_description`` and ``<name>_sensor_kit_description``, by path.

    Args:
        rig: The sensors.
        blueprint: The vehicle that carries them.
        name: Begin of the names of the packages, Autoware's ``vehicle_model`` and ``sensor_model``.
    """
    vehicle, kit = f"{name}_vehicle_description", f"{name}_sensor_kit_description"
    info = {"/**": {"ros__parameters": vehicle_info(blueprint)}}
    to_kit, to_sensors = calibrations(rig, blueprint)
    return {
        **dict(_package_files(vehicle, f"Measures and shape of {blueprint.name}")),
        f"{vehicle}/config/vehicle_info.param.yaml": _yaml(info),
        f"{vehicle}/urdf/vehicle.xacro": _xml(_vehicle_xacro(blueprint)),
        **dict(_package_files(kit, f"Sensors of {rig.agent}")),
        f"{kit}/config/sensors_calibration.yaml": _yaml(to_kit),
        f"{kit}/config/sensor_kit_calibration.yaml": _yaml(to_sensors),
        f"{kit}/urdf/sensor_kit.xacro": _xml(_kit_xacro(rig, kit)),
        f"{kit}/urdf/sensors.xacro": _xml(_sensors_xacro(kit)),
    }


def vehicle_info(blueprint: Blueprint) -> dict[str, float]:
    """Autoware's parameters of a vehicle: meters, radians. Overhangs begin at the axles and the wheels' middles."""
    length_m, width_m, height_m = blueprint.size_m
    wheels = wheel_cylinders(load_models()[blueprint_index()[blueprint.name]])
    tread_m = 2.0 * max(abs(wheel.center_m[1]) for wheel in wheels)
    ahead_m, aside_m = length_m / 2.0 - blueprint.footprint.axle_m, (width_m - tread_m) / 2.0
    values = {
        "wheel_radius": blueprint.wheel_radius_m,
        "wheel_width": wheels[0].width_m,
        "wheel_base": blueprint.wheelbase_m,
        "wheel_tread": tread_m,
        "front_overhang": ahead_m,
        "rear_overhang": ahead_m,
        "left_overhang": aside_m,
        "right_overhang": aside_m,
        "vehicle_height": height_m,
        "max_steer_angle": Dynamics.of(blueprint).max_steer_rad,
    }
    return {name: round(float(value), 4) for name, value in values.items()}


def calibrations(rig: Rig, blueprint: Blueprint) -> tuple[Calibration, Calibration]:
    """Pose of the sensor kit about base_link, and those of the sensors about the kit.

    The kit's frame is where the first lidar is, without rotation; without one it is base_link.
    """
    base_from_ego = np.eye(4)
    base_from_ego[0, 3] = blueprint.footprint.axle_m
    base_from_kit = np.eye(4)
    for lidar in rig.of_type(Lidar)[:1]:
        base_from_kit[:3, 3] = (base_from_ego @ lidar.pose.ego_from_sensor)[:3, 3]
    kit_from_ego = inverse(base_from_kit) @ base_from_ego
    sensors = {
        _frame(rig, sensor.name): _pose(kit_from_ego @ sensor.pose.ego_from_sensor)
        for sensor in rig.sensors
        if sensor.has_frame
    }
    return {"base_link": {KIT: _pose(base_from_kit)}}, {KIT: sensors}


def _frame(rig: Rig, sensor: str) -> str:
    return f"{rig.agent}/{sensor}"


def _pose(parent_from_frame: Float64Array) -> dict[str, float]:
    values = [*parent_from_frame[:3, 3], *rpy_from_rotation(parent_from_frame[:3, :3])]
    return {axis: round(float(value), _DECIMALS) + 0.0 for axis, value in zip(_AXES, values, strict=True)}


def _vehicle_xacro(blueprint: Blueprint) -> Element:
    robot = Element("robot", {"xmlns:xacro": _XACRO})
    SubElement(robot, "link", name="base_link")
    middle_m = f"{blueprint.footprint.axle_m:g} 0 0"
    _add_fixed_link(robot, "base_link", "vehicle_body", {"xyz": middle_m, "rpy": "0 0 0"})
    add_car(robot[-1], blueprint.name, _PAINT)
    return robot


def _kit_xacro(rig: Rig, package: str) -> Element:
    robot = Element("robot", {"xmlns:xacro": _XACRO})
    SubElement(robot, "xacro:arg", name="config_dir", default=f"$(find {package})/config")
    macro = SubElement(robot, "xacro:macro", name="sensor_kit_macro", params="parent x y z roll pitch yaw")
    _add_fixed_link(macro, "${parent}", KIT, {"xyz": "${x} ${y} ${z}", "rpy": "${roll} ${pitch} ${yaw}"})
    _add_calibration(macro, "sensor_kit_calibration.yaml")
    for sensor in rig.sensors:
        if sensor.has_frame:
            frame = _frame(rig, sensor.name)
            values = {axis: f"${{calibration['{KIT}']['{frame}']['{axis}']}}" for axis in _AXES}
            origin = {
                "xyz": " ".join(map(values.__getitem__, _AXES[:3])),
                "rpy": " ".join(map(values.__getitem__, _AXES[3:])),
            }
            _add_fixed_link(macro, KIT, frame, origin)
            if isinstance(sensor, Camera):
                rpy = " ".join(f"{angle + 0.0:.9g}" for angle in rpy_from_rotation(SENSOR_FROM_OPTICAL[:3, :3]))
                _add_fixed_link(macro, frame, f"{frame}_optical", {"xyz": "0 0 0", "rpy": rpy})
    return robot


def _sensors_xacro(package: str) -> Element:
    robot = Element("robot", {"name": "vehicle", "xmlns:xacro": _XACRO})
    SubElement(robot, "xacro:arg", name="config_dir", default=f"$(find {package})/config")
    SubElement(robot, "xacro:include", filename=f"$(find {package})/urdf/sensor_kit.xacro")
    _add_calibration(robot, "sensors_calibration.yaml")
    values = {axis: f"${{calibration['base_link']['{KIT}']['{axis}']}}" for axis in _AXES}
    SubElement(robot, "xacro:sensor_kit_macro", {"parent": "base_link", **values})
    return robot


def _add_calibration(parent: Element, file: str) -> None:
    SubElement(parent, "xacro:property", name="calibration", value=f"${{xacro.load_yaml('$(arg config_dir)/{file}')}}")


def _add_fixed_link(robot: Element, parent: str, child: str, origin: Mapping[str, str]) -> None:
    joint = SubElement(robot, "joint", name=f"{child}_joint", type="fixed")
    SubElement(joint, "parent", link=parent)
    SubElement(joint, "child", link=child)
    SubElement(joint, "origin", dict(origin))
    SubElement(robot, "link", name=child)


def _package_files(name: str, description: str) -> Iterator[tuple[str, bytes]]:
    package = Element("package", format="3")
    for tag, text in (
        ("name", name),
        ("version", "0.1.0"),
        ("description", f"{description}, by simbev_ros {__version__}"),
    ):
        SubElement(package, tag).text = text
    SubElement(package, "maintainer", email="user@example.com").text = "user"
    for tag, text in (("license", "Apache-2.0"), ("buildtool_depend", "ament_cmake_auto"), ("exec_depend", "xacro")):
        SubElement(package, tag).text = text
    SubElement(SubElement(package, "export"), "build_type").text = "ament_cmake"
    yield f"{name}/package.xml", _xml(package)
    yield f"{name}/CMakeLists.txt", _CMAKE.format(name=name).encode()


def _xml(root: Element) -> bytes:
    ElementTree.indent(root)
    return b'<?xml version="1.0"?>\n' + ElementTree.tostring(root) + b"\n"


def _yaml(content: object) -> bytes:
    return yaml.safe_dump(content, sort_keys=False).encode()
