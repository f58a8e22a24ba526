"""The URDF has the frames of /tf_static at their poses, and a car of the blueprint's size."""

from xml.etree import ElementTree

import numpy as np
import pytest
from ego_frames import edges, with_frames
from made_up_scene import SENSORS, made_up_spec

from simbev_ros.assets.actors.catalog import load_models
from simbev_ros.assets.actors.silhouette import silhouette_boxes, wheel_cylinders
from simbev_ros.foundation.geometry.transforms import matrices_from_xyz_rpy
from simbev_ros.foundation.types import Float64Array
from simbev_ros.ros.msgs.robot_description import robot_description
from simbev_ros.ros.msgs.transforms import static_transforms
from simbev_ros.scene.blueprints import blueprint_index, load_blueprints
from simbev_ros.scene.frames import ego_frame
from simbev_ros.schema.scene.agents import agent_view

SPEC = made_up_spec(
    [
        *SENSORS,
        {"type": "camera", "name": "tilted", "pose": {"x_m": -1, "roll_deg": 20, "pitch_deg": -35, "yaw_deg": 140}},
    ]
)
SPECS = {"footprint": SPEC, "rear_axle": with_frames(SPEC, base_link="rear_axle")}
ROBOTS = {name: ElementTree.fromstring(robot_description(agent_view(spec))) for name, spec in SPECS.items()}
ROBOT = ROBOTS["footprint"]
BOTH = pytest.mark.parametrize("base_link", SPECS)


def numbers(element: ElementTree.Element, attribute: str) -> Float64Array:
    return np.array([float(text) for text in element.attrib[attribute].split()])


@BOTH
def test_joints_are_the_static_transforms(base_link: str) -> None:
    expected = edges(static_transforms(SPECS[base_link]))
    found = {}
    for joint in ROBOTS[base_link].iter("joint"):
        parent, child, origin = (joint.find(tag) for tag in ("parent", "child", "origin"))
        assert parent is not None and child is not None and origin is not None
        pose = matrices_from_xyz_rpy(numbers(origin, "xyz"), numbers(origin, "rpy"))
        found[parent.attrib["link"], child.attrib["link"]] = pose
    assert found.keys() == expected.keys()
    for frames, pose in expected.items():
        np.testing.assert_allclose(found[frames], pose, atol=1e-8, err_msg=str(frames))


@BOTH
def test_each_frame_is_one_link_below_base_link(base_link: str) -> None:
    links = [link.attrib["name"] for link in ROBOTS[base_link].iter("link")]
    children = [child.attrib["link"] for child in ROBOTS[base_link].iter("child")]
    assert len(links) == len(set(links)) and set(links) - set(children) == {"ego/base_link"}


def test_geometry_needs_no_file() -> None:
    shapes = {shape.tag for geometry in ROBOT.iter("geometry") for shape in geometry}
    assert shapes == {"box", "cylinder"}


@BOTH
def test_the_car_is_drawn_in_the_ego_frame_and_every_sensor_in_its_own(base_link: str) -> None:
    spec = SPECS[base_link]
    seen = {link.attrib["name"] for link in ROBOTS[base_link].iter("link") if link.find("visual") is not None}
    assert seen == {ego_frame(agent_view(spec)), *(f"ego/{sensor.name}" for sensor in SPEC.agents[0].rig.sensors)}


@pytest.mark.parametrize("name", [each.name for each in load_blueprints() if each.kind == "vehicle"])
def test_boxes_and_wheels_fill_the_box_of_the_vehicle(name: str) -> None:
    model = load_models()[blueprint_index()[name]]
    boxes = silhouette_boxes(model, 0x123456)
    low = np.min([np.subtract(box.center_m, np.divide(box.size_m, 2)) for box in boxes], axis=0)
    high = np.max([np.add(box.center_m, np.divide(box.size_m, 2)) for box in boxes], axis=0)
    for wheel in wheel_cylinders(model):
        low[[0, 2]] = np.minimum(low[[0, 2]], np.array(wheel.center_m)[[0, 2]] - wheel.radius_m)
        high[0] = max(high[0], wheel.center_m[0] + wheel.radius_m)
    size_m = high - low
    np.testing.assert_allclose(size_m, model.size_m, rtol=0.1, atol=0.1)
    assert 15 < len(boxes) < 150
    assert all((box.rgb == (0x12, 0x34, 0x56)) or max(box.rgb) < 50 for box in boxes)


def test_boxes_follow_the_outline_of_a_car() -> None:
    boxes = silhouette_boxes(load_models()[blueprint_index()["vehicle.sedan"]], 0)
    lengths_m: dict[float, float] = {}
    for box in boxes:
        lengths_m[box.center_m[2]] = lengths_m.get(box.center_m[2], 0.0) + box.size_m[0]
    roof_m, sill_m = lengths_m[max(lengths_m)], lengths_m[sorted(lengths_m)[4]]
    assert 0.5 < roof_m < 0.5 * sill_m, "the roof is shorter than the body"
    assert sill_m == pytest.approx(4.73, abs=0.3)
