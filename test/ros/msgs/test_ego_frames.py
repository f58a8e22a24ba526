"""Trees of coordinate frames: each leads to the true pose of the ego and of every sensor, whichever one is chosen."""

import numpy as np
import pytest
from analytic_motion import CAR, TICK_S, hilly, state_at
from ego_frames import edges, pose_in_tree, with_frames
from made_up_scene import SENSORS, made_up_spec
from synthetic_world import actor

from simbev_ros.foundation.geometry.transforms import inverse, rpy_from_rotation
from simbev_ros.ros.msgs.topics import manifest
from simbev_ros.ros.msgs.transforms import EgoTransforms, static_transforms
from simbev_ros.ros.msgs.world import map_from_base_link, odometry_message
from simbev_ros.scene.frames import ego_frame, ego_from_base_link
from simbev_ros.schema.scene.agents import agent_view
from simbev_ros.schema.scene.spec import SceneSpec
from simbev_ros.schema.scene.state import WorldState, map_from_actors

TICKS = 400
SPEC = made_up_spec(SENSORS, number=1, ticks=TICKS)
AXLE_M = 1.4
"""Half of the sedan's wheelbase of 2.8 m."""


def odometries(spec: SceneSpec, first_tick: int = 0) -> list[tuple[WorldState, object]]:
    states = [state_at(hilly, tick) for tick in range(first_tick, TICKS)]
    return [
        (state, odometry_message(state.ego, spec.stamp_ns(state.tick), "ego/base_link", spec.agents[0].base_link_x_m))
        for state in states
    ]


@pytest.mark.parametrize("base_link", ["footprint", "rear_axle"])
def test_map_odom_base_link_compose_to_the_true_odometry(base_link: str) -> None:
    spec = with_frames(SPEC, odom=True, base_link=base_link)
    transforms = EgoTransforms(agent_view(spec))
    drifts = []
    for state, odometry in odometries(spec):
        tree = edges(transforms.at(odometry))
        assert list(tree) == [("map", "ego/odom"), ("ego/odom", "ego/base_link")]
        truth = map_from_base_link(odometry)
        np.testing.assert_allclose(pose_in_tree(tree, "ego/base_link"), truth, rtol=0, atol=1e-9)
        np.testing.assert_allclose(
            truth, map_from_actors(state.ego[None])[0] @ ego_from_base_link(agent_view(spec)), rtol=0, atol=1e-9
        )
        drifts.append(tree["map", "ego/odom"])
    errors_m = np.linalg.norm([drift[:2, 3] - drifts[0][:2, 3] for drift in drifts], axis=1)
    assert 0.5 < errors_m.max() < 20, "of 190 m"


def test_odometry_begins_at_the_first_tick_and_moves_without_jumps() -> None:
    spec = with_frames(SPEC, odom=True)
    transforms = EgoTransforms(agent_view(spec))
    poses = {
        state.tick: edges(transforms.at(odometry))["ego/odom", "ego/base_link"]
        for state, odometry in odometries(spec, first_tick=-3)
    }
    for tick in range(-3, 1):
        np.testing.assert_array_equal(poses[tick], np.eye(4))
    steps_m = [np.linalg.norm(poses[tick][:3, 3] - poses[tick - 1][:3, 3]) for tick in range(1, TICKS)]
    assert max(steps_m) < 12 * TICK_S and min(steps_m) > 8 * TICK_S
    assert all(pose[2, 3] == 0 and not rpy_from_rotation(pose[:3, :3])[:2].any() for pose in poses.values())


def test_a_recorder_that_misses_the_lead_in_makes_the_same_transforms() -> None:
    spec = with_frames(SPEC, odom=True, base_link="rear_axle")
    world_node, recorder = EgoTransforms(agent_view(spec)), EgoTransforms(agent_view(spec))
    for state, odometry in odometries(spec, first_tick=-2)[:50]:
        published = world_node.at(odometry)
        if state.tick >= 0:
            assert recorder.at(odometry) == published


@pytest.mark.parametrize(
    ("publish", "left"),
    [
        (["odom_to_base_link"], [("ego/odom", "ego/base_link")]),
        (["map_to_odom"], [("map", "ego/odom")]),
        ([], []),
    ],
)
def test_what_a_node_under_test_publishes_is_left_to_it(publish: list[str], left: list[tuple[str, str]]) -> None:
    spec = with_frames(SPEC, odom=True, publish=publish)
    ((_, odometry), *_) = odometries(spec)
    assert list(edges(EgoTransforms(agent_view(spec)).at(odometry))) == left
    names = [topic.name for topic in manifest(spec, compressed_images=True)]
    assert ("/tf" in names) == bool(left) and "/tf_static" in names


def test_the_odom_frame_is_that_of_the_rigs_wheel_odometry() -> None:
    worn = {"type": "odometry", "name": "wheel", "speed_scale_sigma": 0.2}
    plain, exact = (with_frames(made_up_spec(rig, number=1, ticks=TICKS), odom=True) for rig in ([], [worn]))
    last = [
        [edges(transforms.at(odometry)) for _, odometry in odometries(spec)[:100]][-1]["ego/odom", "ego/base_link"]
        for spec, transforms in ((spec, EgoTransforms(agent_view(spec))) for spec in (plain, exact))
    ]
    assert not np.allclose(last[0][:2, 3], last[1][:2, 3], atol=0.5)


@pytest.mark.parametrize("odom", [False, True])
def test_sensors_are_at_the_same_points_of_the_map_whichever_point_base_link_is(odom: bool) -> None:
    poses = []
    for base_link in ("footprint", "rear_axle"):
        spec = with_frames(SPEC, odom=odom, base_link=base_link)
        _, odometry = odometries(spec)[0]
        tree = edges([*static_transforms(spec), *EgoTransforms(agent_view(spec)).at(odometry)])
        names = [f"ego/{sensor.name}" for sensor in spec.agents[0].rig.sensors]
        frames = ego_frame(agent_view(spec)), *names, "ego/cam_front_optical"
        poses.append([pose_in_tree(tree, name) for name in frames])
    np.testing.assert_allclose(poses[1], poses[0], rtol=0, atol=1e-9)


def test_at_the_rear_axle_the_ego_frame_is_called_footprint() -> None:
    tree = edges(static_transforms(with_frames(SPEC, base_link="rear_axle")))
    np.testing.assert_allclose(tree["ego/base_link", "ego/footprint"][:3, 3], [AXLE_M, 0, 0])
    np.testing.assert_allclose(tree["ego/base_link", "ego/lidar"][:3, 3], [AXLE_M, 0, 1.8])
    assert "ego/footprint" not in {name for edge in edges(static_transforms(SPEC)) for name in edge}


def test_the_rear_axle_moves_on_its_own_circle() -> None:
    ego = actor(CAR, x=10.0, yaw=np.pi / 2, vy=5.0, wz=0.5)[0]
    message = odometry_message(ego, SPEC.start_ns, "ego/base_link", -AXLE_M)
    position, velocity = message.pose.pose.position, message.twist.twist.linear
    assert (position.x, position.y) == pytest.approx((10.0, -AXLE_M), abs=1e-6)
    assert (velocity.x, velocity.y, velocity.z) == pytest.approx((5.0, -0.5 * AXLE_M, 0.0), abs=1e-6)
    assert message.twist.twist.angular.z == 0.5


def test_the_velocity_at_the_rear_axle_is_the_change_of_its_position() -> None:
    spec = with_frames(SPEC, base_link="rear_axle")
    (_, before), (_, now), (_, after) = odometries(spec)[10:13]
    first, middle, last = (map_from_base_link(odometry) for odometry in (before, now, after))
    moved_mps = middle[:3, :3].T @ (last[:3, 3] - first[:3, 3]) / (2 * TICK_S)
    twist = now.twist.twist.linear
    np.testing.assert_allclose([twist.x, twist.y, twist.z], moved_mps, atol=1e-3)


def test_default_frames_leave_the_specification_as_it_was() -> None:
    assert {"frames", "base_link_x_m"}.isdisjoint(SPEC.model_dump())
    spec = with_frames(SPEC, base_link="rear_axle")
    assert spec.agents[0].base_link_x_m == -AXLE_M and '"base_link":"rear_axle"' in spec.model_dump_json()


def test_wheel_odometry_has_no_frame_of_its_own() -> None:
    spec = made_up_spec([{"type": "odometry", "name": "wheel"}])
    assert list(static_transforms(spec)) == []
    np.testing.assert_array_equal(inverse(ego_from_base_link(agent_view(spec))), np.eye(4))
