"""The stack's message conversions agree with the graph's own code; test/ros/graph runs the node itself."""

import numpy as np
import pytest
from ego_frames import with_frames
from made_up_scene import SENSORS, made_up_scene
from several_agents import car, with_agents
from visualization_msgs.msg import Marker

from simbev_ros.config.lidar import Lidar
from simbev_ros.foundation.geometry.transforms import matrices_from_xyz_rpy
from simbev_ros.reference_stack.grid import CHANNELS, GridShape
from simbev_ros.reference_stack.messages import (
    header_of,
    markers_message,
    points_of,
    pose_of,
    scores_message,
    stamp_ns_of,
    table_message,
)
from simbev_ros.reference_stack.pipeline import BOX_DTYPE
from simbev_ros.reference_stack.scene import NoLidarError, read_scene
from simbev_ros.ros.msgs.stamps import header
from simbev_ros.ros.msgs.tables import message_from_table, table_from_message
from simbev_ros.ros.msgs.world import odometry_message
from simbev_ros.schema.points import POINT_DTYPE
from simbev_ros.schema.scene.spec import SceneSpec
from simbev_ros.schema.scene.state import ACTOR_DTYPE

STAMP_NS = 7_204_050_000_001


@pytest.fixture(scope="module")
def spec(tmp_path_factory: pytest.TempPathFactory) -> SceneSpec:
    """A scene with ticks at 20 Hz and a roof lidar at 10 Hz, which is turned left, pitched and rolled."""
    path = tmp_path_factory.mktemp("scene") / "bag"
    pose = {"x_m": 0.5, "y_m": -0.2, "z_m": 2.0, "roll_deg": 5, "pitch_deg": 10, "yaw_deg": 90}
    roof = {"type": "lidar", "name": "roof", "pose": pose, "rate_hz": 10}
    return made_up_scene(path, number=3, ticks=1, sensors=[*SENSORS, roof]).spec


def test_scene_facts_equal_those_of_the_scene_spec(spec: SceneSpec) -> None:
    scene = read_scene(spec.model_dump_json(), "/ego/roof/points")
    (roof,) = (lidar for lidar in spec.agents[0].rig.of_type(Lidar) if lidar.name == "roof")
    assert scene.name == spec.name
    assert scene.start_ns == spec.start_ns
    assert scene.tick_ns == spec.tick_ns
    assert scene.period_ticks == spec.period_ticks(roof.rate_hz) == 2
    assert scene.ego_from_lidar == pytest.approx(roof.pose.ego_from_sensor)
    bev = spec.agents[0].annotation.bev
    assert scene.grid == GridShape(bev.rows, bev.columns, bev.cell_m)


def test_the_stack_finds_the_ego_frame_from_base_link(spec: SceneSpec) -> None:
    same, behind = (
        read_scene(each.model_dump_json(), "/ego/lidar/points")
        for each in (spec, with_frames(spec, base_link="rear_axle"))
    )
    assert (same.ego_frame, behind.ego_frame) == ("ego/base_link", "ego/footprint")
    assert same.base_link_from_ego == pytest.approx(np.eye(4))
    assert behind.base_link_from_ego[:3, 3] == pytest.approx([1.4, 0, 0])


def test_clouds_are_due_every_nth_tick_from_tick_0(spec: SceneSpec) -> None:
    slow, fast = (read_scene(spec.model_dump_json(), f"/ego/{name}/points") for name in ("roof", "lidar"))
    stamps_ns = [spec.stamp_ns(tick) for tick in range(-2, 5)]
    assert [slow.has_cloud(stamp_ns) for stamp_ns in stamps_ns] == [False, False, True, False, True, False, True]
    assert [fast.has_cloud(stamp_ns) for stamp_ns in stamps_ns] == [False, False, True, True, True, True, True]


def test_rig_without_the_lidar_is_refused_and_its_lidars_are_named(spec: SceneSpec) -> None:
    with pytest.raises(
        NoLidarError,
        match="no lidar of the scene publishes /ego/top/points; "
        "remap it to one of: /ego/lidar/points, /ego/roof/points",
    ):
        read_scene(spec.model_dump_json(), "/ego/top/points")


def test_clouds_of_the_graph_are_read() -> None:
    table = np.zeros(3, POINT_DTYPE)
    table["x"], table["z"], table["ring"] = [1.0, np.nan, 3.0], 0.5, [7, 0, 31]
    points, ring = points_of(message_from_table(table, STAMP_NS, "ego/lidar"))
    assert points == pytest.approx(np.array([[1.0, 0.0, 0.5], [np.nan, 0.0, 0.5], [3.0, 0.0, 0.5]]), nan_ok=True)
    assert ring.tolist() == [7, 0, 31]


def test_odometry_of_the_graph_is_read() -> None:
    actor = np.zeros((), ACTOR_DTYPE)
    values = {"x": 10.0, "y": -4.0, "z": 2.0, "roll": 0.1, "pitch": -0.2, "yaw": 2.5}
    for name, value in values.items():
        actor[name] = value
    expected = matrices_from_xyz_rpy(*np.split(np.array([*values.values()]), 2))
    assert pose_of(odometry_message(actor, STAMP_NS, "ego/base_link")) == pytest.approx(expected, abs=1e-6)


def test_stamps_are_exact_both_ways() -> None:
    assert header_of(STAMP_NS, "map") == header(STAMP_NS, "map")
    assert stamp_ns_of(header_of(STAMP_NS, "map")) == STAMP_NS


def test_box_message_can_be_read_by_the_graph() -> None:
    boxes = np.frombuffer(np.random.default_rng(0).bytes(4 * BOX_DTYPE.itemsize), BOX_DTYPE)
    message = table_message(boxes, header_of(STAMP_NS, "map"))
    assert table_from_message(message).tobytes() == boxes.tobytes()
    assert (message.row_step, len(message.data)) == (4 * message.point_step, 4 * BOX_DTYPE.itemsize)
    assert table_message(boxes[:0], header_of(STAMP_NS, "map")).width == 0


def test_score_message_is_an_image_of_all_channels() -> None:
    scores = np.arange(2 * 3 * len(CHANNELS), dtype=np.uint8).reshape(2, 3, -1)
    message = scores_message(scores, header_of(STAMP_NS, "ego/base_link"))
    assert (message.height, message.width, message.encoding, message.step) == (2, 3, "8UC14", 42)
    assert bytes(message.data) == scores.tobytes()


def test_markers_show_likely_boxes_after_deleting_earlier_ones() -> None:
    boxes = np.zeros(2, BOX_DTYPE)
    boxes["class"], boxes["score"], boxes["id"], boxes["yaw"] = [0, 5], [0.9, 0.1], [4, 5], np.pi / 2
    boxes["x"], boxes["length"] = 3.0, 4.4
    clear, car = markers_message(boxes, header_of(STAMP_NS, "map")).markers
    assert clear.action == Marker.DELETEALL
    assert (car.type, car.action, car.ns, car.id, car.text) == (Marker.CUBE, Marker.ADD, "car", 4, "0.90")
    assert (car.pose.position.x, car.scale.x) == pytest.approx((3.0, 4.4))
    assert (car.pose.orientation.z, car.pose.orientation.w) == pytest.approx((np.sqrt(0.5), np.sqrt(0.5)))


def test_markers_of_boxes_without_a_track_have_numbers_of_their_own() -> None:
    boxes = np.zeros(3, BOX_DTYPE)
    boxes["score"], boxes["id"] = 0.9, [-1, 4, -1]
    _, *cars = markers_message(boxes, header_of(STAMP_NS, "map")).markers
    assert [car.id for car in cars] == [-1, 4, -3]


def test_the_stack_finds_the_lidar_of_another_agent(spec: SceneSpec) -> None:
    agent = car("car", 2, [SENSORS[2]], frames={"base_link": "rear_axle"}, base_link_x_m=-1.25)
    agent["annotation"] = {"bev": {"rows": 10, "columns": 12, "cell_m": 2.0}}
    text = with_agents(spec, agent).model_dump_json()
    scene = read_scene(text, "/car/lidar/points")
    assert (scene.ego_frame, scene.grid) == ("car/footprint", GridShape(10, 12, 2.0))
    assert scene.base_link_from_ego[:3, 3] == pytest.approx([1.25, 0, 0])
    assert read_scene(text, "/ego/lidar/points").ego_frame == "ego/base_link"
    with pytest.raises(NoLidarError, match=r"/ego/roof/points, /car/lidar/points$"):
        read_scene(text, "/bus/lidar/points")
