"""Recordings in the layouts of others: points, poses, images and labels come to where they belong."""

from pathlib import Path

import cv2
import numpy as np
import open3d
import pytest
from made_up_recording import CAR_M, HEIGHT_M, ground_cloud, write_nuscenes

from simbev_ros.baselines.boxes import BOX_DTYPE
from simbev_ros.baselines.recordings.clouds import read_cloud
from simbev_ros.baselines.recordings.folder import folder_frames, read_poses, read_sensors
from simbev_ros.baselines.recordings.ground import ego_from_lidar_in_frame, ego_from_lidar_of
from simbev_ros.baselines.recordings.kitti import kitti_frames
from simbev_ros.baselines.recordings.model_inputs import BODY_M, ground_pose, view_frame
from simbev_ros.baselines.recordings.nuscenes import nuscenes_frames
from simbev_ros.baselines.recordings.recording import OTHER_CLASS, boxes_in_frame
from simbev_ros.foundation.errors import InputError
from simbev_ros.foundation.geometry.transforms import apply, inverse, matrices_from_xyz_rpy, rpy_from_rotation
from simbev_ros.foundation.semantics import BOX_CLASSES

SHARED = Path(__file__).parents[2].parent / "shared/real"
CORPUS = Path(__file__).parents[1] / "fuzz/corpus"
AGES_NS = (0, 250_000_000, 2_000_000_000)
CALIBRATION = """\
P2: 700 0 600 70 0 700 170 0 0 0 1 0
R0_rect: 1 0 0 0 1 0 0 0 1
Tr_velo_to_cam: 0 -1 0 0 0 0 -1 0 1 0 0 -0.3
"""


@pytest.mark.parametrize("path", sorted((CORPUS / "cloud").glob("valid*")), ids=lambda path: path.name)
def test_every_form_of_a_cloud_gives_the_same_points(tmp_path: Path, path: Path) -> None:
    suffix, _, content = path.read_bytes().partition(b"\n")
    (tmp_path / f"a{suffix.decode()}").write_bytes(content)
    points = read_cloud(tmp_path / f"a{suffix.decode()}")
    assert points[:, :3].tolist() == [[1.0, 2.0, -1.5], [4.0, -3.0, 0.5]]
    assert (points[:, 3].tolist()) in ([0.25, 0.5], [1.0, 2.0])


@pytest.mark.parametrize(("suffix", "options"), [(".pcd", {}), (".pcd", {"write_ascii": True}), (".ply", {})])
def test_clouds_that_open3d_wrote_have_the_same_points(tmp_path: Path, suffix: str, options: dict[str, bool]) -> None:
    points = np.random.default_rng(2).uniform(-50, 50, (30, 3)).astype(np.float32)
    cloud = open3d.t.geometry.PointCloud(open3d.core.Tensor(points))
    cloud.point["intensity"] = open3d.core.Tensor(np.arange(30, dtype=np.float32)[:, None])
    open3d.t.io.write_point_cloud(str(tmp_path / f"a{suffix}"), cloud, **options)
    found = read_cloud(tmp_path / f"a{suffix}")
    assert found == pytest.approx(np.column_stack([points, np.arange(30)]), abs=1e-5)


def test_points_that_are_not_finite_are_left_out(tmp_path: Path) -> None:
    np.array([[1, 2, 3], [np.nan, 0, 0], [np.inf, 0, 0]], np.float32).tofile(tmp_path / "a.bin")
    assert read_cloud(tmp_path / "a.bin", columns=3).tolist() == [[1.0, 2.0, 3.0, 0.0]]


@pytest.mark.parametrize(
    ("name", "content", "message"),
    [
        ("a.las", b"", "a.las: is not a cloud; files that are read end in .bin, .npy, .pcd, .ply"),
        ("a.bin", b"12345", "a.bin: cannot be read: its 5 bytes are not points of 4 float32 numbers each"),
        ("a.bin", b"", "a.bin: cannot be read: it has no point with finite numbers"),
        ("a.pcd", b"FIELDS x y z\nPOINTS 9\n", "a.pcd: cannot be read: its header does not end"),
        ("a.ply", b"ply\nformat ascii 1.0\nelement face 1\nend_header\n", "its first element is not vertex"),
    ],
)
def test_files_that_are_not_clouds_are_refused(tmp_path: Path, name: str, content: bytes, message: str) -> None:
    (tmp_path / name).write_bytes(content)
    with pytest.raises(InputError) as caught:
        read_cloud(tmp_path / name)
    assert message in str(caught.value)


def test_the_ground_gives_height_and_tilt_of_the_lidar() -> None:
    tilted = [ground_cloud(height_m, 0.03, -0.02).astype(np.float32) for height_m in (1.88, 1.9, 1.97)]
    ego_from_lidar = ego_from_lidar_of(tilted)
    ground = np.array([[10.0, 0.0, 0.3 - 1.9], [-5.0, 8.0, -0.15 - 0.16 - 1.9]])
    assert apply(ego_from_lidar, ground)[:, 2] == pytest.approx([0, 0], abs=0.01)
    roll_rad, pitch_rad, yaw_rad = rpy_from_rotation(ego_from_lidar[:3, :3])
    # The ground rises ahead and falls to the left in the lidar's frame: it looks down, and leans to the left.
    assert (roll_rad, pitch_rad, yaw_rad) == pytest.approx((0.02, 0.03, 0.0), abs=0.002)


@pytest.mark.parametrize(("ahead", "height_m", "is_own"), [(0.04, 1.8, True), (0.1, 1.9, False), (0.0, 2.4, False)])
def test_a_frame_has_its_own_ground_if_it_is_near_the_usual_one(ahead: float, height_m: float, is_own: bool) -> None:
    usual = ego_from_lidar_of([ground_cloud().astype(np.float32)])
    found = ego_from_lidar_in_frame(usual, ground_cloud(height_m, ahead).astype(np.float32))
    assert found[2, 3] == pytest.approx(height_m if is_own else HEIGHT_M, abs=0.02)
    assert (found is usual) == (not is_own)


def test_a_recording_without_ground_is_refused() -> None:
    with pytest.raises(InputError, match="no cloud shows ground"):
        ego_from_lidar_of([np.zeros((100, 4), np.float32)])


@pytest.fixture(scope="module")
def nuscenes(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("nuscenes")
    write_nuscenes(folder)
    return folder


def test_key_frames_of_nuscenes_have_earlier_sweeps_where_the_world_was(nuscenes: Path) -> None:
    frames = nuscenes_frames(nuscenes, "v1.0-mini")
    assert [frame.name for frame in frames] == ["sample0", "sample1"]
    assert ground_pose(frames) is None
    view = view_frame(frames[1], AGES_NS, None)  # the vehicle is 3 m from where it was at first
    assert np.unique(view.points[:, 3]).tolist() == [0, 1]
    for sweep in (0, 1):
        points = view.points[view.points[:, 3] == sweep, :3].astype(np.float64)
        near = np.abs(points - np.subtract(CAR_M, [3.0, 0.0, 0.0])) < [1.2, 2.4, 1.0]
        of_car = points[near.all(1) & (points[:, 2] > 0.1)]
        assert of_car.mean(0) == pytest.approx([9.0, 3.0, 0.85], abs=0.15)
        assert np.abs(points[:, 2]).min() < 0.01


def test_points_of_the_vehicle_itself_are_left_out(nuscenes: Path) -> None:
    view = view_frame(nuscenes_frames(nuscenes, "v1.0-mini")[0], (0,), None)
    assert np.hypot(view.points[:, 0] - 1.0, view.points[:, 1]).min() >= BODY_M - 1e-3


def test_labels_and_images_of_nuscenes_are_in_the_frame_of_the_ego(nuscenes: Path) -> None:
    frame = nuscenes_frames(nuscenes, "v1.0-mini")[1]
    view, labels = view_frame(frame, (0,), None), frame.labels
    assert labels is not None
    (car,) = boxes_in_frame(labels().boxes, view.ego_from_lidar)
    assert [car["x"], car["y"], car["z"]] == pytest.approx([9.0, 3.0, 0.8])
    assert (car["length"], car["width"], car["yaw"]) == pytest.approx((4.2, 1.8, np.pi / 2))
    photo = view.photos["CAM_FRONT"]
    (pixel,) = photo.camera.project(apply(photo.optical_from_ego, np.array([[9.0, 3.0, 0.8]])))
    assert pixel == pytest.approx([31.5 - 60 * 3.0 / 7.5, 23.5 + 60 * 0.7 / 7.5])


def test_only_frames_of_nuscenes_with_clouds_are_there(tmp_path: Path) -> None:
    write_nuscenes(tmp_path)
    (tmp_path / "samples/LIDAR_TOP/1.pcd.bin").unlink()
    assert [frame.name for frame in nuscenes_frames(tmp_path, "v1.0-mini")] == ["sample1"]
    with pytest.raises(InputError, match=r"has no v1\.0-trainval; --version can be v1\.0-mini"):
        nuscenes_frames(tmp_path, "v1.0-trainval")


def write_kitti(folder: Path, label: str | None = None) -> None:
    """One frame of a lidar 1.9 m above the ground."""
    for name in ("velodyne", "calib", "image_2", "label_2"):
        (folder / name).mkdir(parents=True)
    points = ground_cloud()
    np.column_stack([points, np.zeros(len(points))]).astype("<f4").tofile(folder / "velodyne/000007.bin")
    (folder / "calib/000007.txt").write_text(CALIBRATION)
    cv2.imwrite(str(folder / "image_2/000007.png"), np.full((370, 1200, 3), 90, np.uint8))
    if label is not None:
        (folder / "label_2/000007.txt").write_text(label)


def test_a_frame_of_kitti_by_hand(tmp_path: Path) -> None:
    # The car stands 10 m ahead of the camera and 2 m to the right, and looks to the right.
    label = "Car 0 0 0 0 0 9 9 1.5 1.8 4.2 2.0 1.7 10.0 0.0\nTram 0 0 0 0 0 9 9 3 3 9 0 1.7 30 0\n"
    unlabeled = "DontCare -1 -1 -10 1 2 3 4 -1 -1 -1 -1000 -1000 -1000 -10\n"
    write_kitti(tmp_path / "training", label + unlabeled)
    (frame,) = kitti_frames(tmp_path)
    assert frame.labels is not None
    labels = frame.labels()
    assert labels.boxes["class"].tolist() == [BOX_CLASSES.index("car"), OTHER_CLASS]
    assert labels.unlabeled_px.tolist() == [[1, 2, 3, 4]]
    car = labels.boxes[0]
    assert [car["x"], car["y"], car["z"]] == pytest.approx([10.3, -2.0, -1.7 + 0.75])
    assert (car["length"], car["width"], car["height"], car["yaw"]) == pytest.approx((4.2, 1.8, 1.5, -np.pi / 2))
    ground = ground_pose([frame])
    assert ground is not None and ground[2, 3] == pytest.approx(HEIGHT_M, abs=0.01)
    view = view_frame(frame, (0, 250_000_000), ground)
    assert not view.points[:, 3].any()
    photo = view.photos["image_2"]
    (pixel,) = photo.camera.project(apply(photo.optical_from_ego, np.array([[10.3, -2.0, HEIGHT_M]])))
    assert pixel == pytest.approx([600 + 700 * 2.1 / 10, 170], abs=1.0)  # the camera is 10 cm to the left


@pytest.mark.skipif(not (SHARED / "kitti").is_dir(), reason="real frames are not there")
def test_labels_of_real_frames_of_kitti_lie_in_their_boxes_of_the_image(tmp_path: Path) -> None:
    for number in ("000000", "000001", "000002"):
        for place, source in (
            ("velodyne", ".bin"),
            ("image_2", ".png"),
            ("calib", "_calib.txt"),
            ("label_2", "_label.txt"),
        ):
            (tmp_path / place).mkdir(exist_ok=True)
            suffix = source.rpartition(".")[2]
            (tmp_path / place / f"{number}.{suffix}").symlink_to(SHARED / f"kitti/{number}{source}")
    frames = kitti_frames(tmp_path)
    ground = ground_pose(frames)
    assert ground is not None and ground[2, 3] == pytest.approx(1.73, abs=0.06)
    for frame in frames:
        view = view_frame(frame, (0,), ground)
        assert frame.labels is not None
        boxes = boxes_in_frame(frame.labels().boxes, view.ego_from_lidar)
        photo = view.photos["image_2"]
        center = np.stack([boxes["x"], boxes["y"], boxes["z"]], 1)
        rows = [line.split() for line in (tmp_path / f"label_2/{frame.name}.txt").read_text().splitlines()]
        sides = np.array([row[4:8] for row in rows if row[0] != "DontCare"], float)
        pixels = photo.camera.project(apply(photo.optical_from_ego, center))
        assert ((pixels > sides[:, :2]) & (pixels < sides[:, 2:])).all()


def write_folder(folder: Path, sensors: str = "", poses: str = "") -> None:
    """Three clouds with a pole 10 m ahead of the first position, 1 m apart, and two images."""
    folder.mkdir()
    for number in range(3):
        pole = np.stack([np.full(50, 10.0 - number), np.zeros(50), np.linspace(-1.7, 1, 50)], axis=1)
        np.save(folder / f"{number}.npy", np.concatenate([ground_cloud(), pole]))
    (folder / "front").mkdir()
    for number in (0, 2):
        cv2.imwrite(str(folder / f"front/{number}.png"), np.full((48, 64, 3), 120, np.uint8))
    for name, content in (("sensors.yaml", sensors), ("poses.txt", poses)):
        if content:
            (folder / name).write_text(content)


CAMERA = "{images: front, fx_px: 60, cx_px: 31.5, cy_px: 23.5, optical_from_lidar: [[0,-1,0,0],[0,0,-1,0],[1,0,0,0]]}"


def test_poses_of_a_folder_bring_earlier_sweeps_to_the_newest(tmp_path: Path) -> None:
    poses = "".join(f"1 0 0 {number} 0 1 0 0 0 0 1 0\n" for number in range(3))
    write_folder(tmp_path / "a", "lidar: {poses: poses.txt, rate_hz: 4, pose: {z_m: 1.9}}", poses)
    frames = folder_frames(tmp_path / "a")
    assert [frame.name for frame in frames] == ["0", "1", "2"]
    view = view_frame(frames[2], (0, 250_000_000, 500_000_000), None)
    pole = view.points[(np.abs(view.points[:, 1]) < 0.02) & (view.points[:, 2] > 1.0)]
    assert [pole[pole[:, 3] == sweep, 0].mean() for sweep in range(3)] == pytest.approx([8.0, 8.0, 8.0])


def test_without_poses_a_frame_has_one_sweep_and_the_images_of_its_name(tmp_path: Path) -> None:
    write_folder(tmp_path / "a", f"cameras: {{front: {CAMERA}}}")
    frames = folder_frames(tmp_path / "a")
    ground = ground_pose(frames)
    views = [view_frame(frame, AGES_NS, ground) for frame in frames]
    assert [list(view.photos) for view in views] == [["front"], [], ["front"]]
    assert not any(view.points[:, 3].any() for view in views)


def test_poses_of_tum_have_stamps(tmp_path: Path) -> None:
    (tmp_path / "poses.txt").write_text("# stamp x y z qx qy qz qw\n1.5 1 2 3 0 0 0 1\n2.25 0 0 0 0 0 0.6 0.8\n")
    poses, stamps_ns = read_poses(tmp_path / "poses.txt", 10.0)
    assert stamps_ns.tolist() == [1_500_000_000, 2_250_000_000]
    assert poses[1, :2, 0] == pytest.approx([0.28, 0.96])


@pytest.mark.parametrize(
    ("sensors", "message"),
    [
        ("lidar: {columns: 2}", "sensors.yaml:1: lidar.columns: Input should be greater than or equal to 3, not 2"),
        ("lidar:\n  clouds: ../b", "sensors.yaml: cannot be read: '../b' is not the name of a file in"),
        ("lidar: {poses: poses.txt}", "poses.txt: has 1 poses, but there are 3 clouds"),
        ("lidar: {clouds: front}", "front: has no clouds; files that are read end in .bin, .npy, .pcd, .ply"),
        ("cameras: {a: {images: none, fx_px: 1, cx_px: 1, cy_px: 1}}", "cameras.a.optical_from_lidar: Field required"),
        (f"cameras: {{a: {CAMERA.replace('front', 'none')}}}", "none: has no images; files that are read end in .jpg"),
        (f"cameras: {{a: {CAMERA.replace('[1,', '[2,')}}}", "a.optical_from_lidar: a transform is not a rotation"),
    ],
)
def test_wrong_descriptions_of_a_folder_are_refused(tmp_path: Path, sensors: str, message: str) -> None:
    write_folder(tmp_path / "a", sensors, "1 0 0 0 0 1 0 0 0 0 1 0\n")
    with pytest.raises(InputError) as caught:
        folder_frames(tmp_path / "a")
    assert message in str(caught.value)


def test_the_example_on_the_page_is_valid(tmp_path: Path) -> None:
    page = (Path(__file__).parents[2] / "docs/guide/on-real-data.md").read_text()
    (tmp_path / "sensors.yaml").write_text(page.split("```yaml\n")[1].split("```")[0])
    sensors = read_sensors(tmp_path / "sensors.yaml")
    assert (sensors.lidar.columns, list(sensors.cameras)) == (5, ["front"])


def test_boxes_move_with_their_velocity_and_heading() -> None:
    target_from_source = matrices_from_xyz_rpy(np.array([5.0, 0, 1.0]), np.array([0, 0, np.pi / 2]))
    box = np.zeros(1, BOX_DTYPE)
    box["x"], box["yaw"], box["vx"] = 2.0, 0.25, 3.0
    moved = boxes_in_frame(box, target_from_source)
    assert [moved[name][0] for name in ("x", "y", "z")] == pytest.approx([5.0, 2.0, 1.0])
    assert [moved[name][0] for name in ("yaw", "vx", "vy")] == pytest.approx([0.25 + np.pi / 2, 0.0, 3.0], abs=1e-6)
    back = boxes_in_frame(moved, inverse(target_from_source))
    assert back["x"][0] == pytest.approx(2.0) and back["yaw"][0] == pytest.approx(0.25)
