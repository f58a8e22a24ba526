"""Topics, transforms and URDFs of a scene with several agents: those of the first one as ever, then the others' own."""

from collections.abc import Callable
from xml.etree import ElementTree

import numpy as np
import pytest
from analytic_motion import circle, hilly, state_at
from display_topics import display_topics
from ego_frames import edges, pose_in_tree
from made_up_scene import SENSORS, made_up_spec
from ros_messages import point_cloud
from scene_edits import with_ego
from several_agents import blocks_agents, car, made_up_agents, roadside_unit, with_agents

from simbev_ros.config.frames import Frames
from simbev_ros.foundation.geometry.transforms import matrices_from_xyz_rpy
from simbev_ros.foundation.types import Table
from simbev_ros.ros.msgs import topics
from simbev_ros.ros.msgs.derived_messages import message_makers
from simbev_ros.ros.msgs.joint_topics import joint_topics
from simbev_ros.ros.msgs.robot_description import robot_description
from simbev_ros.ros.msgs.topic import Topic
from simbev_ros.ros.msgs.transforms import SceneTransforms, serialize_transforms, static_transforms
from simbev_ros.ros.msgs.typed_topics import typed_topics
from simbev_ros.ros.msgs.world import agent_odometry
from simbev_ros.scene.frames import fixed_frames
from simbev_ros.schema.scene.agents import agent_view, agent_views
from simbev_ros.schema.scene.spec import SceneSpec

SPEC = made_up_agents()
FIRST = made_up_spec(SENSORS, number=2)
"""The same scene with its first agent alone."""

REAR_AXLE = {"frames": {"odom": True, "base_link": "rear_axle"}, "base_link_x_m": -1.4}


def names_of(found: list[Topic]) -> list[str]:
    return [topic.name for topic in found]


def actors_at(tick: int) -> Table:
    """The first vehicle on a winding road over hills, the third on a circle."""
    rows = [state_at(path, tick).actors for path in (hilly, circle(5.0, 20.0))]
    actors = np.concatenate(rows)
    actors["id"] = 1, 3
    return actors


@pytest.mark.parametrize("compressed", [True, False])
def test_the_manifest_is_that_of_the_first_agent_then_the_others_own_and_the_joint_topics(compressed: bool) -> None:
    expected = [*topics.manifest(FIRST, compressed_images=compressed)]
    for agent in SPEC.agents[1:]:
        name = agent.name
        alone = with_ego(FIRST, rig=agent.rig, annotation=agent.annotation)
        own = [each for each in topics.manifest(alone, compressed_images=compressed) if f"/{name}/" in each.name]
        expected += [Topic(f"/{name}/robot_description", "std_msgs/msg/String", 0), *own]
    expected += joint_topics(SPEC)
    assert [*topics.manifest(SPEC, compressed_images=compressed)] == expected
    assert [*joint_topics(FIRST)] == []


@pytest.mark.parametrize("spec", [made_up_agents, blocks_agents])
def test_no_name_is_used_twice(spec: Callable[[], SceneSpec]) -> None:
    found = [
        *topics.manifest(spec(), compressed_images=True),
        topics.end_topic(),
        *(each.topic for each in typed_topics(spec())),
    ]
    assert len(set(names_of(found))) == len(found)
    displays = names_of([*display_topics(spec())])
    assert len(set(displays)) == len(displays)


def test_the_world_node_publishes_the_motion_and_the_model_of_every_agent() -> None:
    found = [*topics.world_topics(SPEC)]
    assert found[:-4] == [*topics.world_topics(FIRST)]
    assert names_of(found[-4:]) == ["/car/robot_description", "/car/odom", "/rsu/robot_description", "/rsu/odom"]
    paths = [name for name in names_of([*display_topics(SPEC)]) if name.endswith("/path")]
    assert paths == ["/ego/path", "/car/path", "/rsu/path"]


def test_typed_messages_and_displays_come_with_the_labels_of_every_agent() -> None:
    typed = {each.source.name for each in typed_topics(SPEC)} - {each.source.name for each in typed_topics(FIRST)}
    cameras = {f"/car/{name}/boxes" for name in ("cam_front", "cam_back_left")} | {"/rsu/cam/boxes"}
    assert typed == {"/car/boxes", "/car/hd_map", "/rsu/boxes", "/rsu/hd_map", *cameras}
    displays = names_of([*display_topics(SPEC)])
    assert {"/car/cam_front/depth/color", "/rsu/cam/semantic/label_info", "/rsu/boxes/points"} <= set(displays)


def test_transforms_are_published_if_any_agent_publishes_some() -> None:
    silent = {"odom": True, "publish": []}
    spec = with_ego(FIRST, frames=Frames.model_validate(silent))
    assert topics.TF not in names_of([*topics.transform_topics(with_agents(spec, car("car", 1, frames=silent)))])
    assert topics.TF in names_of([*topics.transform_topics(with_agents(spec, car("car", 1)))])


def test_one_message_of_transforms_leads_to_every_agent() -> None:
    spec = with_agents(FIRST, car("car", 2, **REAR_AXLE), roadside_unit())
    transforms = SceneTransforms(spec)
    for tick in range(20):
        actors = actors_at(tick)
        moving = transforms.at([agent_odometry(view, actors, spec.stamp_ns(tick)) for view in agent_views(spec)])
        tree = edges([*static_transforms(spec), *moving])
        assert [each.child_frame_id for each in moving] == [
            "ego/base_link",
            "car/odom",
            "car/base_link",
            "rsu/base_link",
        ]
        for frame, row in (("ego/base_link", 0), ("car/footprint", 1)):
            pose = [np.array([actors[row][name] for name in names.split()]) for names in ("x y z", "roll pitch yaw")]
            expected = matrices_from_xyz_rpy(pose[0], pose[1].astype(np.float64))
            np.testing.assert_allclose(pose_in_tree(tree, frame), expected, atol=1e-9)
        mast = matrices_from_xyz_rpy(np.array([12.0, -3.0, 1.0]), np.array([0.0, 0.0, 1.5]))
        np.testing.assert_allclose(pose_in_tree(tree, "rsu/base_link"), mast, atol=1e-9)


def test_every_rig_has_its_static_transforms() -> None:
    found = [each.child_frame_id for each in static_transforms(SPEC)]
    assert found == [frame.name for view in agent_views(SPEC) for frame in fixed_frames(view)]
    assert {"ego/lidar", "car/lidar", "rsu/lidar", "rsu/cam_optical"} <= set(found)


def test_agents_with_equal_wheels_drift_apart_from_each_other() -> None:
    spec = with_agents(with_ego(FIRST, frames=Frames(odom=True)), car("car", 2, frames={"odom": True}))
    views, transforms = agent_views(spec), SceneTransforms(spec)
    for tick in range(100):
        actors = state_at(hilly, tick).actors[[0, 0]]
        actors["id"] = 1, 3
        tree = edges(transforms.at([agent_odometry(view, actors, spec.stamp_ns(tick)) for view in views]))
    apart_m = (tree["ego/odom", "ego/base_link"] - tree["car/odom", "car/base_link"])[:3, 3]
    assert 0.01 < np.linalg.norm(apart_m) < 5, "of 46 m"


def recorded_transforms(spec: SceneSpec) -> Callable[[bytes, int], bytes]:
    return message_makers(spec, (), {topics.TF})[topics.ACTORS][topics.TF]


def test_the_recorder_makes_the_transforms_that_the_world_node_publishes() -> None:
    spec = with_agents(FIRST, car("car", 2, **REAR_AXLE), roadside_unit())
    published, make = SceneTransforms(spec), recorded_transforms(spec)
    for tick in range(-2, 30):
        odometries = [agent_odometry(view, actors_at(tick), spec.stamp_ns(tick)) for view in agent_views(spec)]
        expected = serialize_transforms(published.at(odometries))
        if tick >= 0:  # the recorder misses the lead-in
            stamp_ns = spec.stamp_ns(tick)
            assert make(point_cloud(stamp_ns, actors_at(tick)), stamp_ns) == expected


def test_transforms_are_not_made_of_a_table_without_the_vehicle_of_an_agent() -> None:
    with pytest.raises(ValueError, match="actor 3, which carries car, is missing"):
        recorded_transforms(SPEC)(point_cloud(SPEC.start_ns, actors_at(0)[:1]), SPEC.start_ns)


def test_transforms_that_are_not_recorded_are_not_made() -> None:
    assert message_makers(SPEC, (), {topics.ACTORS}) == {}


def test_the_description_of_a_car_is_that_of_a_first_agent_with_other_names() -> None:
    (car_alone, _), expected = agent_views(SPEC)[1:], robot_description(agent_view(FIRST))
    assert robot_description(car_alone) == expected.replace("ego/", "car/")


def test_the_description_of_a_roadside_unit_has_sensors_and_no_car() -> None:
    robot = ElementTree.fromstring(robot_description(agent_view(SPEC, "rsu")))
    links = {link.attrib["name"]: link.find("visual") is not None for link in robot.iter("link")}
    assert robot.attrib["name"] == "rsu"
    assert links == {"rsu/base_link": False, "rsu/cam": True, "rsu/cam_optical": False, "rsu/lidar": True}
