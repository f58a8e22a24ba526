"""An export to OPV2V's layout has its files and fields, and readers find poses, boxes, points and images in place."""

from collections.abc import Iterator
from functools import partial
from pathlib import Path
from typing import Any

import made_up_scene
import numpy as np
import pytest
import yaml
from made_up_scene import SENSORS, MadeUp, made_up_spec, record_made_up
from opv2v_reader import CORNER_SIGNS, AgentFrame, moved, world_from
from ros_messages import odometry
from scipy.spatial.transform import Rotation
from several_agents import MAST_SENSORS, car, roadside_unit, with_agents

from simbev_exporters.opv2v.carla_frame import carla_pose, mirrored_transform
from simbev_exporters.opv2v.connected_agents import connected_agents
from simbev_exporters.opv2v.export import Exported, export_opv2v
from simbev_exporters.opv2v.frames import FrameSettings
from simbev_exporters.opv2v.pcd import pcd_file
from simbev_ros.dataset import open_dataset
from simbev_ros.foundation.semantics import BOX_CLASSES
from simbev_ros.foundation.types import Float64Array, Table
from simbev_ros.scene.legend import legend
from simbev_ros.schema.scene.agents import agent_view
from simbev_ros.schema.v2x import OWN_POSE, V2X_DTYPE

SETTINGS = FrameSettings()
SCENE, TICKS = "Blocks-0002", 9
FOLDERS = {"ego": "1", "car": "3", "rsu": "-1"}
MIRROR = np.diag([1.0, -1.0, 1.0, 1.0])
CAMERA = {"type": "camera", "width_px": 32, "height_px": 24}


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> Iterator[tuple[Path, MadeUp]]:
    """A folder with a dataset, ``set``, and its export, ``out``; and the content of its scene with three agents.

    The agents are ego, car, whose lidar looks to the left, and rsu. All drive at 5 m/s, as their odometry says.
    """
    folder = tmp_path_factory.mktemp("opv2v")
    turned = [{**each, "pose": {"x_m": -0.4, "z_m": 1.9, "yaw_deg": 90}} for each in SENSORS if each["name"] == "lidar"]
    spec = with_agents(
        made_up_spec(SENSORS, number=2, ticks=TICKS), car("car", 2, [*SENSORS[:2], *turned]), roadside_unit()
    )
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(made_up_scene, "odometry", partial(odometry, velocity_mps=(3.0, 4.0, 0.0)))
        content = record_made_up(folder / f"set/scenes/train/{SCENE}", spec)
    record_made_up(folder / "set/scenes/val/Blocks-0001", made_up_spec(MAST_SENSORS, number=1, split="val"))
    done = export(folder / "set", folder / "out")
    assert (done.scenes, done.made, done.agents, done.frames) == (2, 2, 4, 3 * 5 + 2)
    yield folder, content


def export(dataset: Path, out: Path, settings: FrameSettings = SETTINGS) -> Exported:
    return export_opv2v(open_dataset(dataset, threads=1), out, settings)


def values_of(made: tuple[Path, MadeUp], agent: str, tick: int) -> dict[str, Any]:
    return (made[1].ticks if agent == "ego" else made[1].others[agent])[tick]


def files_of(made: tuple[Path, MadeUp], agent: str, tick: int) -> AgentFrame:
    return AgentFrame(made[0] / "out/train" / SCENE / FOLDERS[agent], tick)


def map_from(xyz_m: Any, rpy_rad: Any) -> Float64Array:
    """(4, 4) pose in our map frame, by SciPy."""
    pose = np.eye(4)
    pose[:3, :3], pose[:3, 3] = Rotation.from_euler("xyz", rpy_rad).as_matrix(), xyz_m
    return pose


def map_from_sensor(made: tuple[Path, MadeUp], agent: str, tick: int, name: str) -> Float64Array:
    """(4, 4) pose of a sensor in our map frame, from what was recorded."""
    rig = agent_view(made[1].spec, agent).rig
    pose = next(sensor for sensor in rig.sensors if sensor.name == name).pose
    mount = map_from([pose.x_m, pose.y_m, pose.z_m], np.radians([pose.roll_deg, pose.pitch_deg, pose.yaw_deg]))
    return map_from(*values_of(made, agent, tick)["odom"]) @ mount


def xyz(table: Table) -> Float64Array:
    return np.stack([table[name] for name in "xyz"], axis=1).astype(np.float64)


def test_the_layout_has_a_folder_for_each_agent_of_each_scene(made: tuple[Path, MadeUp]) -> None:
    out = made[0] / "out"
    assert {path.name for path in out.iterdir()} == {"train", "validate", ".parts", ".lock"}
    assert {path.name for path in (out / "train").iterdir()} == {SCENE}
    assert {path.name for path in (out / "train" / SCENE).iterdir()} == {*FOLDERS.values(), "data_protocol.yaml"}
    assert {path.name for path in (out / "validate/Blocks-0001").iterdir()} == {"1", "data_protocol.yaml"}
    stems = [f"{tick:06d}" for tick in range(0, TICKS, 2)]
    for agent, cameras in (("ego", (0, 2)), ("car", (0, 2)), ("rsu", (0,))):
        ends = [".yaml", ".pcd", *(f"_camera{number}.png" for number in cameras)]
        files = {path.name for path in (out / "train" / SCENE / FOLDERS[agent]).iterdir()}
        assert files == {f"{stem}{end}" for stem in stems for end in ends}


def test_the_protocol_says_whose_folders_are_which(made: tuple[Path, MadeUp]) -> None:
    record = yaml.safe_load((made[0] / "out/train" / SCENE / "data_protocol.yaml").read_text())
    assert record["world"]["town"] == "Blocks" and record["world"]["fixed_delta_seconds"] == 0.05
    assert {str(folder): each["name"] for folder, each in record["agents"].items()} == {
        folder: name for name, folder in FOLDERS.items()
    }
    assert record["agents"][-1] == {
        "name": "rsu",
        "carrier": "roadside unit",
        "lidar": "lidar",
        "cameras": {"camera0": "cam"},
    }


@pytest.mark.parametrize("agent", list(FOLDERS))
def test_a_yaml_file_has_the_documented_fields(made: tuple[Path, MadeUp], agent: str) -> None:
    meta = files_of(made, agent, 2).meta
    cameras = {"camera0"} if agent == "rsu" else {"camera0", "camera2"}
    poses = {"lidar_pose", "true_ego_pos", "predicted_ego_pos"}
    assert set(meta) == {"RSU", "ego_speed", "plan_trajectory", "vehicles", *poses, *cameras}
    assert meta["RSU"] is (agent == "rsu")
    for name in poses:
        assert len(meta[name]) == 6 and all(type(value) is float for value in meta[name])
    for name in cameras:
        assert set(meta[name]) == {"cords", "extrinsic", "intrinsic"} and len(meta[name]["cords"]) == 6
        assert np.shape(meta[name]["extrinsic"]) == (4, 4) and np.shape(meta[name]["intrinsic"]) == (3, 3)
    for number, box in meta["vehicles"].items():
        vectors = {"location", "center", "angle", "extent"}
        assert type(number) is int and set(box) == {*vectors, "speed", "bp_id", "color", "class"}
        assert all(len(box[name]) == 3 for name in vectors) and type(box["speed"]) is float


@pytest.mark.parametrize("agent", list(FOLDERS))
@pytest.mark.parametrize("tick", [0, 4])
def test_poses_are_those_of_the_agent_and_its_sensors(made: tuple[Path, MadeUp], agent: str, tick: int) -> None:
    meta = files_of(made, agent, tick).meta
    expected = {
        "true_ego_pos": map_from(*values_of(made, agent, tick)["odom"]),
        "predicted_ego_pos": map_from(*values_of(made, agent, tick)["odom"]),
        "lidar_pose": map_from_sensor(made, agent, tick, "lidar"),
    }
    for name, pose in expected.items():
        np.testing.assert_allclose(world_from(meta[name]), MIRROR @ pose @ MIRROR, atol=1e-7)
    names = {"camera0": "cam"} if agent == "rsu" else {"camera0": "cam_front", "camera2": "cam_back_left"}
    for number, name in names.items():
        pose = map_from_sensor(made, agent, tick, name)
        np.testing.assert_allclose(world_from(meta[number]["cords"]), MIRROR @ pose @ MIRROR, atol=1e-7)


@pytest.mark.parametrize("agent", list(FOLDERS))
def test_readers_find_the_corners_of_boxes_in_the_frame_of_the_lidar(made: tuple[Path, MadeUp], agent: str) -> None:
    files, boxes = files_of(made, agent, 4), values_of(made, agent, 4)["boxes"]
    lidar_from_map = np.linalg.inv(map_from_sensor(made, agent, 4, "lidar"))
    assert len(files.meta["vehicles"]) > 2
    for number in files.meta["vehicles"]:
        (row,) = boxes[boxes["id"] == number]
        pose = map_from(xyz(row[None])[0], [row["roll"], row["pitch"], row["yaw"]])
        half_m = np.array([row["length"], row["width"], row["height"]], np.float64) / 2
        corners = moved(lidar_from_map @ pose, CORNER_SIGNS * [1, -1, 1] * half_m)
        np.testing.assert_allclose(files.corners_in_lidar(number), corners * [1, -1, 1], atol=1e-4)


def test_vehicles_are_those_of_chosen_classes_with_points(made: tuple[Path, MadeUp], tmp_path: Path) -> None:
    blueprints = legend()["blueprints"]
    boxes, vehicles = values_of(made, "car", 2)["boxes"], files_of(made, "car", 2).meta["vehicles"]
    wanted = np.isin(boxes["class"], range(4)) & (boxes["lidar_points"] > 0)
    assert list(vehicles) == boxes["id"][wanted].tolist()
    for row, box in zip(boxes[wanted], vehicles.values(), strict=True):
        assert box["class"] == BOX_CLASSES[row["class"]] and box["bp_id"] == blueprints[row["blueprint"]]["name"]
        assert box["speed"] == pytest.approx(3.6 * np.linalg.norm([row[name] for name in ("vx", "vy", "vz")]), abs=1e-5)
        assert [int(value) for value in box["color"].split(", ")] == list(int(row["color"]).to_bytes(3, "big"))
    settings = FrameSettings(classes=("pedestrian", *FrameSettings().classes), min_points=0)
    export(made[0] / "set", tmp_path, settings)
    unseen = 0
    for tick in range(0, TICKS, 2):
        boxes = values_of(made, "car", tick)["boxes"]
        boxes = boxes[np.isin(boxes["class"], [0, 1, 2, 3, BOX_CLASSES.index("pedestrian")])]
        assert list(AgentFrame(tmp_path / "train" / SCENE / "3", tick).meta["vehicles"]) == boxes["id"].tolist()
        unseen += np.count_nonzero(boxes["lidar_points"] < 0)
    assert unseen, "those without a count of points have none"


@pytest.mark.parametrize("agent", list(FOLDERS))
def test_clouds_come_out_as_they_went_in(made: tuple[Path, MadeUp], agent: str) -> None:
    points, intensity = files_of(made, agent, 6).cloud()
    cloud = values_of(made, agent, 6)["lidar/points"]
    np.testing.assert_allclose(points, xyz(cloud) * [1, -1, 1], atol=1e-5)
    np.testing.assert_allclose(intensity, np.clip(cloud["intensity"], 0, 1), atol=0.5 / 255 + 1e-6)


def test_clouds_of_all_agents_meet_in_the_frame_of_the_first_ones_lidar(made: tuple[Path, MadeUp]) -> None:
    first = files_of(made, "ego", 6)
    ours = np.linalg.inv(map_from_sensor(made, "ego", 6, "lidar"))
    for agent in ("car", "rsu"):
        files = files_of(made, agent, 6)
        read = moved(np.linalg.inv(first.world_from_lidar) @ files.world_from_lidar, files.cloud()[0])
        recorded = xyz(values_of(made, agent, 6)["lidar/points"])
        expected = moved(ours @ map_from_sensor(made, agent, 6, "lidar"), recorded)
        np.testing.assert_allclose(read, expected * [1, -1, 1], atol=1e-4)


@pytest.mark.parametrize(
    ("agent", "number", "name"), [("car", 0, "cam_front"), ("car", 2, "cam_back_left"), ("rsu", 0, "cam")]
)
def test_points_of_the_lidar_are_in_place_in_images(
    made: tuple[Path, MadeUp], agent: str, number: int, name: str
) -> None:
    camera = files_of(made, agent, 2).meta[f"camera{number}"]
    pose = map_from_sensor(made, agent, 2, name)
    ahead = moved(pose, np.array([[10.0, 2.0, 1.0], [25.0, -6.0, 0.5]]))
    seen = moved(np.linalg.inv(map_from_sensor(made, agent, 2, "lidar")), ahead) * [1, -1, 1]
    forward, right, up = moved(np.array(camera["extrinsic"]), seen).T
    pixels = np.array(camera["intrinsic"]) @ np.array([right, -up, forward])
    np.testing.assert_allclose(pixels[2], [10, 25], atol=1e-6)
    focal_px = 16 / np.tan(np.radians(80) / 2)
    expected = [[15.5 - focal_px * 0.2, 15.5 + focal_px * 0.24], [11.5 - focal_px * 0.1, 11.5 - focal_px * 0.02]]
    np.testing.assert_allclose(pixels[:2] / pixels[2], expected, atol=1e-5)


def test_images_are_equal_to_the_pixel(made: tuple[Path, MadeUp]) -> None:
    for agent, number, name in (("ego", 0, "cam_front"), ("car", 2, "cam_back_left"), ("rsu", 0, "cam")):
        np.testing.assert_array_equal(files_of(made, agent, 4).image(number), values_of(made, agent, 4)[f"{name}/rgb"])


def test_the_predicted_position_is_what_the_agent_tells_the_others(tmp_path: Path) -> None:
    sent = np.zeros(2, V2X_DTYPE)
    sent["id"], sent["x"], sent["y"], sent["z"] = [5, OWN_POSE], [9, 1], [9, -2], [9, 3]
    sent["roll"][1], sent["pitch"][1], sent["yaw"][1] = 0.1, 0.2, 0.3
    spec = with_agents(made_up_spec(SENSORS, number=2, ticks=1), car("car", 2))
    made = record_made_up(tmp_path / SCENE, spec, tables={"/v2x/car": sent})
    export(tmp_path / SCENE, tmp_path / "out")
    ego, other = (AgentFrame(tmp_path / "out/train" / SCENE / folder, 0).meta for folder in ("1", "3"))
    expected = MIRROR @ map_from([1, -2, 3], [0.1, 0.2, 0.3]) @ MIRROR
    np.testing.assert_allclose(world_from(other["predicted_ego_pos"]), expected, atol=1e-6)
    np.testing.assert_allclose(other["true_ego_pos"][:3], made.others["car"][0]["odom"][0] * [1, -1, 1])
    assert ego["predicted_ego_pos"] == ego["true_ego_pos"]


def test_the_plan_is_where_the_agent_drives_at_the_next_frames(made: tuple[Path, MadeUp]) -> None:
    meta = files_of(made, "car", 2).meta
    assert meta["ego_speed"] == 18.0
    places = [values_of(made, "car", tick)["odom"][0] for tick in (4, 6, 8)]
    np.testing.assert_allclose(meta["plan_trajectory"], [[x, -y, 18.0] for x, y, _ in places])
    assert files_of(made, "car", 8).meta["plan_trajectory"] == [] == files_of(made, "rsu", 2).meta["plan_trajectory"]


def test_extrinsics_are_those_of_published_files() -> None:
    """Of a frame in the annotation tutorial of Adver-City, a data set in OPV2V's layout that was recorded in CARLA."""
    cords = [213.1973419189453, -5.52460241317749, 1.483937382698059]
    lidar = [214.1405487060547, -5.427590370178223, 1.9377721548080444]
    angles = [-0.00433349609375, -174.12957763671875, -0.2315092533826828]
    camera, scanner = (MIRROR @ world_from([*place, *angles]) @ MIRROR for place in (cords, lidar))
    expected = np.eye(4)
    expected[:3, 3] = [-0.9500086905572118, 1.0234670639874821e-06, 0.44999985330774583]
    np.testing.assert_allclose(mirrored_transform(np.linalg.inv(camera) @ scanner), expected, atol=2e-5)
    np.testing.assert_allclose(carla_pose(camera), [*cords, *angles], atol=1e-9)


@pytest.mark.parametrize("pitch_deg", [90.0, -90.0])
def test_a_camera_that_looks_straight_down_has_its_orientation(pitch_deg: float) -> None:
    pose = map_from([1, 2, 3], [0.01, 0.0, 1.5]) @ map_from([0, 0, 9], np.radians([0, pitch_deg, 35]))
    level = map_from([1, 2, 3], [0.0, 0.0, 1.5]) @ map_from([0, 0, 9], np.radians([0, pitch_deg, 35]))
    for each in (pose, level):
        np.testing.assert_allclose(world_from(carla_pose(each).tolist()), MIRROR @ each @ MIRROR, atol=1e-7)


def test_an_empty_cloud_and_intensities_beyond_their_range_are_written(tmp_path: Path) -> None:
    import open3d

    (tmp_path / "a.pcd").write_bytes(pcd_file(np.zeros((0, 3)), np.zeros(0)))
    (tmp_path / "b.pcd").write_bytes(pcd_file(np.array([[1.5, -2.25, 1e3]] * 3), np.array([-0.5, 0.2, 2.0])))
    assert len(open3d.io.read_point_cloud(str(tmp_path / "a.pcd"), remove_nan_points=False).points) == 0
    cloud = open3d.io.read_point_cloud(str(tmp_path / "b.pcd"))
    np.testing.assert_array_equal(cloud.points, [[1.5, -2.25, 1e3]] * 3)
    np.testing.assert_allclose(np.asarray(cloud.colors)[:, 0], [0.0, 0.2, 1.0], atol=1e-9)


@pytest.mark.parametrize(
    ("yaws_deg", "expected"),
    [
        ([60, 0, -60, 110, 180, -110], {0: 1, 1: 5, 2: 3, 3: 4}),  # as nuScenes
        ([0, -100, 100, 180], {0: 0, 1: 1, 2: 2, 3: 3}),  # as OPV2V
        ([40, 140, -50, -140], {0: 0, 2: 1, 1: 2, 3: 3}),
        ([0], {0: 0}),
        ([-90, 90], {1: 0, 2: 1}),
        ([], {}),
    ],
)
def test_cameras_are_chosen_by_their_directions(
    tmp_path: Path, yaws_deg: list[float], expected: dict[int, int]
) -> None:
    sensors: list[dict[str, Any]] = [
        {**CAMERA, "name": f"cam_{k}", "pose": {"yaw_deg": yaw_deg}} for k, yaw_deg in enumerate(yaws_deg)
    ]
    record_made_up(tmp_path / "Blocks-0000", made_up_spec([*sensors, {"type": "lidar", "name": "lidar"}], ticks=1))
    (agent,) = connected_agents(open_dataset(tmp_path / "Blocks-0000").scenes[0], None)
    assert agent.cameras == {number: f"cam_{k}" for number, k in expected.items()}


def test_rolling_scans_are_moved_to_the_stamp(tmp_path: Path) -> None:
    lidar = {"type": "lidar", "name": "lidar", "pose": {"z_m": 1.8}}
    for name, changes in (("at_once", {}), ("rolling", {"rolling": True})):
        record_made_up(tmp_path / f"{name}/Blocks-0000", made_up_spec([{**lidar, **changes}], ticks=1))
        export(tmp_path / f"{name}/Blocks-0000", tmp_path / f"{name}/out")
    frame = open_dataset(tmp_path / "rolling/Blocks-0000").scenes[0][0]
    at_once, rolling = (AgentFrame(tmp_path / f"{name}/out/train/Blocks-0000/1", 0) for name in ("at_once", "rolling"))
    (ego,) = frame["world/actors"][frame["world/actors"]["id"] == 1]
    rate = np.array([ego[name] for name in ("wx", "wy", "wz")], np.float64)
    velocity = np.array([ego[name] for name in ("vx", "vy", "vz")], np.float64)
    place = np.array([ego[name] for name in "xyz"])
    world = moved(MIRROR @ at_once.world_from_lidar @ MIRROR, at_once.cloud()[0] * [1, -1, 1])
    times = frame["lidar/points"]["time"].astype(np.float64)
    expected = [
        place + velocity * time + Rotation.from_rotvec(rate * time).apply(point - place)
        for point, time in zip(world, times, strict=True)
    ]
    read = moved(MIRROR @ rolling.world_from_lidar @ MIRROR, rolling.cloud()[0] * [1, -1, 1])
    np.testing.assert_allclose(read, expected, atol=1e-3)
