"""Whichever point of the ego base_link is, a dataset is read alike: poses, points in the map frame, velocities."""

from pathlib import Path

import numpy as np
import pytest
from analytic_motion import hilly, state_at
from ego_frames import with_frames
from made_up_scene import SENSORS, made_up_spec
from rclpy.serialization import serialize_message

from simbev_ros.dataset import Scene, open_dataset
from simbev_ros.dataset.index_row import index_row
from simbev_ros.evaluation.predictions.reference_frames import ReferenceFrames
from simbev_ros.foundation.geometry.transforms import apply
from simbev_ros.recording.bag_writer import SceneBagWriter
from simbev_ros.recording.layout import SCENE_ATTACHMENT, scene_folder
from simbev_ros.recording.qos import QosProfile
from simbev_ros.ros.msgs.topics import odometry_topic
from simbev_ros.ros.msgs.world import odometry_message
from simbev_ros.schema.scene.agents import agent_view
from simbev_ros.schema.scene.state import map_from_actors
from simbev_ros.show.rerun.live.live_frame import LiveFrame, LiveScene, Payloads

TICKS = 5
STATES = [state_at(hilly, tick) for tick in range(TICKS)]
SPECS = {
    base_link: with_frames(made_up_spec(SENSORS, ticks=TICKS), base_link=base_link)
    for base_link in ("footprint", "rear_axle")
}
BOTH = pytest.mark.parametrize("base_link", SPECS)


def payload(base_link: str, tick: int) -> bytes:
    """The odometry that the graph publishes at a tick."""
    spec = SPECS[base_link]
    ahead_m = spec.agents[0].base_link_x_m
    return bytes(serialize_message(odometry_message(STATES[tick].ego, spec.stamp_ns(tick), "ego/base_link", ahead_m)))


@pytest.fixture(scope="module")
def datasets(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    """A dataset with the ego's motion for each base_link."""
    made = {}
    for base_link, spec in SPECS.items():
        made[base_link] = tmp_path_factory.mktemp(base_link)
        with SceneBagWriter(scene_folder(made[base_link], spec.split, spec.name)) as writer:
            writer.add_attachment(SCENE_ATTACHMENT, "application/json", spec.model_dump_json().encode())
            writer.add_topic("/ego/odom", "nav_msgs/msg/Odometry", QosProfile())
            for tick in range(TICKS):
                writer.write("/ego/odom", spec.stamp_ns(tick), payload(base_link, tick))
            writer.finish({"complete": "true", "ticks": str(TICKS)})
    return made


def scene_of(datasets: dict[str, Path], base_link: str) -> Scene:
    return open_dataset(datasets[base_link]).scenes[0]


@BOTH
def test_points_of_every_sensor_are_at_the_same_places_of_the_map(datasets: dict[str, Path], base_link: str) -> None:
    points = np.random.default_rng(0).uniform(-50, 50, (20, 3))
    for frame in scene_of(datasets, base_link):
        map_from_ego = map_from_actors(STATES[frame.tick].ego[None])[0]
        np.testing.assert_allclose(frame.map_from_ego, map_from_ego, rtol=0, atol=1e-9)
        for sensor in SPECS[base_link].agents[0].rig.sensors:
            expected = apply(map_from_ego @ sensor.pose.ego_from_sensor, points)
            np.testing.assert_allclose(apply(frame.map_from_sensor(sensor.name), points), expected, rtol=0, atol=1e-9)
        optical = apply(frame.map_from_optical("cam_front"), np.array([[0.0, 0.0, 7.0]]))
        ahead = apply(map_from_ego, np.array([[0.6 + 7.0, 0.0, 1.6]]))
        np.testing.assert_allclose(optical, ahead, rtol=0, atol=1e-9)


@BOTH
def test_velocities_are_those_of_the_ego_frame(datasets: dict[str, Path], base_link: str) -> None:
    for frame in scene_of(datasets, base_link):
        ego = STATES[frame.tick].ego
        velocity_mps = frame.map_from_ego[:3, :3] @ frame["odom"][-1]["velocity_mps"]
        np.testing.assert_allclose(velocity_mps, [ego["vx"], ego["vy"], ego["vz"]], atol=1e-6)


@BOTH
def test_a_live_frame_has_the_same_motion_as_a_recorded_one(datasets: dict[str, Path], base_link: str) -> None:
    view = agent_view(SPECS[base_link])
    live = LiveFrame(LiveScene(view, 0), 3, [Payloads(odometry_topic(view), [payload(base_link, 3)])], None)
    assert live["odom"].tobytes() == scene_of(datasets, base_link)[3]["odom"].tobytes()


def test_the_path_in_the_index_has_one_length(datasets: dict[str, Path]) -> None:
    lengths = [
        index_row(scene_folder(datasets[name], spec.split, spec.name), datasets[name])["ego_way_m"]
        for name, spec in SPECS.items()
    ]
    assert lengths[0] == pytest.approx(lengths[1], abs=1e-9) and lengths[0] > 1


def test_the_message_itself_describes_base_link(datasets: dict[str, Path]) -> None:
    frame = scene_of(datasets, "rear_axle")[2]
    position = frame.messages("odom")[-1].pose.pose.position
    expected = apply(frame.map_from_ego, np.array([[-1.4, 0.0, 0.0]]))[0]
    np.testing.assert_allclose([position.x, position.y, position.z], expected, rtol=0, atol=1e-9)


def test_answers_of_a_stack_may_be_in_base_link_or_in_the_ego_frame(datasets: dict[str, Path]) -> None:
    scene = scene_of(datasets, "rear_axle")
    frames, map_from_ego = ReferenceFrames.from_scene(scene), scene[2].map_from_ego
    assert frames.names[:3] == ("map", "ego/base_link", "ego/footprint")
    np.testing.assert_array_equal(frames(2, "ego/footprint"), map_from_ego)
    behind = apply(map_from_ego, np.array([[-1.4, 0.0, 0.0]]))[0]
    np.testing.assert_allclose(frames(2, "ego/base_link")[:3, 3], behind, rtol=0, atol=1e-9)
    lidar = map_from_ego @ SPECS["rear_axle"].agents[0].rig.sensors[2].pose.ego_from_sensor
    np.testing.assert_allclose(frames(2, "ego/lidar"), lidar, rtol=0, atol=1e-9)
