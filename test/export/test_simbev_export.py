"""Tests that the SimBEV layout, read back by its description, contains what was recorded, and that exports resume."""

import io
import json
import os
import pickletools
import weakref
from collections.abc import Iterator
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import cv2
import numpy as np
import pytest
from made_up_scene import SENSORS, MadeUp, labeled_at, made_up_scene, made_up_spec, record_made_up
from PIL import Image
from scipy.spatial.transform import Rotation
from typer.testing import CliRunner

from simbev_ros.cli.main import app
from simbev_ros.dataset import open_dataset
from simbev_ros.dataset.frame import Frame
from simbev_ros.export.parts import Part
from simbev_ros.export.quaternions import continuous
from simbev_ros.export.simbev import encodings, voxels
from simbev_ros.export.simbev.boxes import box_records
from simbev_ros.export.simbev.export import finish, make_part, parts_of, remove_ends
from simbev_ros.foundation.errors import InputError
from simbev_ros.foundation.semantics import BEV_CLASSES
from simbev_ros.foundation.types import AnyArray
from simbev_ros.scene.blueprints import load_blueprints
from simbev_ros.scene.legend import legend
from simbev_ros.schema.boxes import blank_boxes
from simbev_ros.schema.scene.state import SIGNAL_DTYPE


def export(dataset: Path, root: Path, **options: Any) -> list[str]:
    opened = open_dataset(dataset)
    parts = parts_of(opened, root)
    remove_ends(parts)
    for part in parts:
        if part.record() is None:
            make_part(part)
    return finish(opened, parts, **options)


@pytest.fixture(scope="module")
def exported(tmp_path_factory: pytest.TempPathFactory) -> tuple[MadeUp, Path]:
    folder = tmp_path_factory.mktemp("exported")
    made = made_up_scene(folder / "set/scenes/train/Blocks-0000")
    made_up_scene(folder / "set/scenes/val/Blocks-0001", number=1, split="val", ticks=2)
    export(folder / "set", folder / "out/simbev")
    return made, folder / "out/simbev"


def sweep(root: Path, sensor: str, extension: str, frame: int = 1) -> Path:
    return root / f"sweeps/{sensor}/SimBEV-scene-0000-frame-{frame:04d}-{sensor}.{extension}"


def npz(path: Path) -> AnyArray:
    with np.load(path) as file:
        assert file.files == ["data"]
        return file["data"]


def test_cameras_read_back(exported: tuple[MadeUp, Path]) -> None:
    made, root = exported
    tick = made.ticks[1]
    with Image.open(sweep(root, "RGB-CAM_FRONT", "jpg")) as picture:
        assert np.abs(np.asarray(picture).astype(int) - tick["cam_front/rgb"]).mean() < 2
    ids = np.asarray(Image.open(sweep(root, "IST-CAM_BACK_LEFT", "png"))).astype(int)
    np.testing.assert_array_equal(ids[..., 0], tick["cam_back_left/semantic"])
    np.testing.assert_array_equal(ids[..., 1] + 256 * ids[..., 2], tick["cam_back_left/instance"])
    code = np.asarray(Image.open(sweep(root, "DPT-CAM_FRONT", "png"))).astype(float)
    depth_m = 1000 * (code @ [1, 256, 65536]) / (2**24 - 1)
    np.testing.assert_allclose(depth_m, np.minimum(tick["cam_front/depth"], 1000), atol=1000 / 2**24)
    np.testing.assert_array_equal(npz(sweep(root, "FLW-CAM_FRONT", "npz")), tick["cam_front/flow"])


def test_semantic_pictures_have_carlas_colors(exported: tuple[MadeUp, Path]) -> None:
    made, root = exported
    colors = cv2.imread(str(sweep(root, "SEG-CAM_FRONT", "png")))[..., ::-1]
    tags = made.ticks[1]["cam_front/semantic"]
    for tag, color in {1: (128, 64, 128), 10: (152, 251, 152), 14: (0, 0, 142), 24: (157, 234, 50)}.items():
        assert (colors[tags == tag] == color).all() and (tags == tag).any()


def test_clouds_read_back_without_points_on_the_ego(exported: tuple[MadeUp, Path]) -> None:
    made, root = exported
    cloud = made.ticks[1]["lidar/points"]
    expected = [(x, y, z) for x, y, z, *_ in cloud.tolist() if abs(x) > 2.44 or abs(y) > 1.04]
    points = npz(sweep(root, "LIDAR", "npz"))
    assert points.dtype == np.float32 and 0 < len(expected) < len(cloud)
    np.testing.assert_array_equal(points, np.array(expected, np.float32))
    labeled, source = npz(sweep(root, "SEG-LIDAR", "npz")), made.ticks[1]["lidar/semantic_points"]
    assert labeled.dtype.names == ("x", "y", "z", "CosAngle", "ObjIdx", "ObjTag")
    assert [labeled.dtype[name].str for name in labeled.dtype.names] == ["<f4"] * 4 + ["<u4"] * 2
    np.testing.assert_array_equal(labeled["ObjIdx"], source["object_id"])
    np.testing.assert_array_equal(labeled["CosAngle"], source["cos_angle"])
    radar, echoes = npz(sweep(root, "RAD_FRONT", "npz")), made.ticks[1]["radar_front/points"]
    for column, name in enumerate(("range", "elevation", "azimuth", "doppler_velocity")):
        np.testing.assert_array_equal(radar[:, column], echoes[name])


def test_position_and_motion_read_back(exported: tuple[MadeUp, Path]) -> None:
    made, root = exported
    np.testing.assert_array_equal(np.load(sweep(root, "GNSS", "bin")), made.ticks[1]["gnss/fix"])
    motion, (_, _, yaw) = made.ticks[1]["imu/data"]
    file = np.load(sweep(root, "IMU", "bin"))
    np.testing.assert_allclose(file[:6], motion)
    assert file[6] == pytest.approx((np.pi / 2 - yaw) % (2 * np.pi), abs=1e-9)


def test_grids_read_back(exported: tuple[MadeUp, Path]) -> None:
    made, root = exported
    masks = npz(root / "ground-truth/seg/SimBEV-scene-0000-frame-0002-GT_SEG.npz")
    assert masks.shape == (len(BEV_CLASSES), 20, 24) and masks.dtype == bool
    labels = sum(mask.astype(int) << k for k, mask in enumerate(masks))
    np.testing.assert_array_equal(labels, made.ticks[2]["bev/labels"])
    assert cv2.imread(str(root / "ground-truth/seg_viz/SimBEV-scene-0000-frame-0002-GT_SEG_VIZ.jpg")).shape[:2] == (
        20,
        24,
    )
    voxels = npz(sweep(root, "VOXEL-GRID", "npz", 2))
    assert voxels.shape == (8, 8, 8) and voxels.dtype == np.uint8
    rows = made.ticks[2]["occupancy/points"]
    assert {(r["ix"], r["iy"], r["iz"]): r["tag"] for r in rows} == {
        tuple(cell): voxels[tuple(cell)] for cell in np.argwhere(voxels)
    }
    record = json.loads((root / "ground-truth/hd_map/SimBEV-scene-0000-frame-0002-HD_MAP.json").read_text())
    assert record == {"id": "a_0", "s": 1.5, "is_junction": False}


def test_boxes_can_be_loaded_by_every_numpy(exported: tuple[MadeUp, Path]) -> None:
    _, root = exported
    for path in (root / "ground-truth/det").iterdir():
        pickled = path.read_bytes().partition(b"\n")[2]  # behind the header
        assert {argument for name, argument in opcodes(pickled) if name == "GLOBAL"} == {"numpy array"}
        assert not {"STACK_GLOBAL", "REDUCE_EX", "EXT1", "FRAME"} & {name for name, _ in opcodes(pickled)}
        assert int(next(opcodes(pickled))[1]) <= 3, "the protocol of NumPy 1"


def test_a_frame_without_boxes_has_an_empty_array() -> None:
    loaded = np.load(io.BytesIO(encodings.npy_of_records([])), allow_pickle=True)
    assert loaded.shape == (0,) and loaded.dtype == object


def opcodes(pickled: bytes) -> Iterator[tuple[str, Any]]:
    return ((code.name, argument) for code, argument, _ in pickletools.genops(pickled))


def objects(root: Path, frame: int) -> list[dict[str, Any]]:
    path = root / f"ground-truth/det/SimBEV-scene-0000-frame-{frame:04d}-GT_DET.bin"
    return list(np.load(path, allow_pickle=True))


def test_corners_are_in_carlas_order_and_right_handed(exported: tuple[MadeUp, Path]) -> None:
    made, root = exported
    flip = np.diag([1, -1, 1])
    for row, record in zip(made.ticks[0]["boxes"], objects(root, 0), strict=True):
        # In CARLA's axes: y and yaw and pitch have the other sign, and the center of the box is at (x, -y, z).
        rpy_deg = np.degrees([row["roll"], row["pitch"], row["yaw"]])
        rotation = flip @ Rotation.from_euler("xyz", rpy_deg, degrees=True).as_matrix() @ flip
        for index, corner in enumerate(record["bounding_box"]):
            sides = 2 * np.array([index >> 2 & 1, index >> 1 & 1, index & 1]) - 1
            local = sides * [row["length"], row["width"], row["height"]] / 2
            carla = rotation @ local + [row["x"], -row["y"], row["z"]]
            np.testing.assert_allclose(corner, carla * [1, -1, 1], atol=1e-5)
        np.testing.assert_allclose(record["location"], record["bounding_box"][[0, 2, 4, 6]].mean(axis=0), atol=1e-5)
        np.testing.assert_allclose(record["rotation"], rpy_deg, atol=1e-4)


def test_objects_have_all_keys_and_labels(exported: tuple[MadeUp, Path]) -> None:
    made, root = exported
    rows, records = made.ticks[0]["boxes"], objects(root, 0)
    common = {"id", "type", "is_alive", "is_active", "is_dormant", "parent", "attributes", "semantic_tags"}
    common |= {"bounding_box", "location", "rotation", "linear_velocity", "angular_velocity", "distance_to_ego"}
    common |= {"angle_to_ego", "num_lidar_pts", "num_radar_pts", "valid_flag", "class", "difficulty"}
    light = {"green_time", "yellow_time", "red_time", "state", "opendrive_id", "pole_index"}
    assert [set(record) - common for record in records[:-2]] == [set()] * 10
    assert set(records[-2]) == common | light and set(records[-1]) == common | {"sign_type"}
    assert all(common <= set(record) for record in records)
    assert records[0]["parent"] == 7 and records[1]["parent"] is None
    assert records[0]["type"] in ("vehicle.city_car", "vehicle.hatchback", "vehicle.compact")
    for row, record in zip(rows, records, strict=True):
        assert record["num_lidar_pts"] == max(0, row["lidar_points"]) and record["valid_flag"] == bool(row["valid"])
        np.testing.assert_allclose(record["angular_velocity"], np.degrees([row["wx"], row["wy"], row["wz"]]), rtol=1e-5)
    assert records[-2]["state"] == "Green" and records[-2]["type"] == "traffic.traffic_light"
    assert (records[-2]["opendrive_id"], records[-2]["pole_index"]) == ("A_3", 1)  # the light has row 1 of the signals
    assert records[-2]["green_time"] == pytest.approx(float(made.ticks[0]["world/signals"]["green_time"][1]))
    assert records[-1]["type"] == "traffic.speed_limit.50" and records[-1]["sign_type"] == "speed_limit"


def test_infos_name_all_files_and_poses(exported: tuple[MadeUp, Path]) -> None:
    made, root = exported
    infos = json.loads((root / "infos/simbev_infos_train.json").read_text())
    assert list(infos) == ["metadata", "data"] and list(infos["data"]) == ["scene_0000"]
    scene = infos["data"]["scene_0000"]
    assert scene["scene_info"]["map"] == "Blocks" and scene["scene_info"]["vehicles"] == 2
    frames = scene["scene_data"]
    assert [frame["frame"] for frame in frames] == [0, 1, 2] and "VOXEL-GRID" not in frames[1]
    files = [value for frame in frames for key, value in frame.items() if isinstance(value, str)]
    assert len(files) == 3 * 20 - 1 and all((root / file).is_file() for file in files)
    assert not any(Path(file).is_absolute() for file in files)
    assert len(list(root.glob("sweeps/*/*-scene-0000-*"))) + len(list(root.glob("ground-truth/*/*-scene-0000-*"))) == 59
    position_m, rpy_rad = made.ticks[2]["odom"]
    np.testing.assert_allclose(frames[2]["ego2global_translation"], position_m)
    rotation = Rotation.from_quat(np.roll(frames[2]["ego2global_rotation"], -1))
    np.testing.assert_allclose(rotation.as_euler("xyz"), rpy_rad, atol=1e-9)


def test_a_split_without_scenes_has_an_empty_info_file(exported: tuple[MadeUp, Path]) -> None:
    _, root = exported
    train, val, test = (
        json.loads((root / f"infos/simbev_infos_{n}.json").read_text()) for n in ("train", "val", "test")
    )
    assert test == {"metadata": train["metadata"], "data": {}}
    assert list(val["data"]) == ["scene_0001"]


def test_a_scene_has_all_its_settings(exported: tuple[MadeUp, Path]) -> None:
    made, root = exported
    info = json.loads((root / "infos/simbev_infos_train.json").read_text())["data"]["scene_0000"]["scene_info"]
    settings = json.loads(made.spec.model_dump_json())
    agent = settings.pop("agents")[0]
    assert (info["map"], info["vehicles"], info["pedestrians"]) == ("Blocks", 2, 0)
    for name, value in {**settings, **agent}.items():
        assert name in ("map", "vehicles", "pedestrians") or info[name] == value, name
    assert info["green_time_s"] == [10.0] and info["map_settings"]["seed"] == 0


def test_every_scene_has_a_log_and_viewers_a_folder(exported: tuple[MadeUp, Path]) -> None:
    _, root = exported
    logs = [(root / f"logs/SimBEV-scene-{number:04d}.log").read_text() for number in (0, 1)]
    assert "Blocks-0000: 3 frames, seed 0" in logs[0] and "Blocks-0001: 2 frames" in logs[1]
    assert (root / "viz").is_dir()


def test_types_have_carlas_prefixes() -> None:
    rows = blank_boxes(len(load_blueprints()))
    rows["blueprint"] = np.arange(len(rows))
    types = {record["type"] for record in box_records(rows, np.zeros(0, SIGNAL_DTYPE), {**legend(), "signals": []})}
    assert {"vehicle.sedan", "vehicle.trailer.caravan", "walker.pedestrian.man", "walker.pedestrian.worker"} <= types
    assert "static.prop.traffic_cone" in types
    prefixes = ("vehicle.", "walker.pedestrian.", "static.prop.", "rider.")  # riders have no boxes
    assert all(name.startswith(prefixes) for name in types)


def test_quaternions_of_the_ego_do_not_jump_where_its_heading_passes_180_degrees() -> None:
    yaw_rad = np.radians([170, 178, -174, -166, 175, 90])
    jumping = np.column_stack([np.cos(yaw_rad / 2), np.zeros((6, 2)), np.sin(yaw_rad / 2)])
    found = continuous(jumping)
    assert (np.einsum("ni,ni->n", found[1:], found[:-1]) > 0).all() and found[0, 0] > 0
    np.testing.assert_allclose(np.abs(found), np.abs(jumping))


def test_voxels_that_were_not_recorded_are_labeled_again(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    made = made_up_scene(tmp_path / "set/scenes/train/Blocks-0000")
    lines = export(tmp_path / "set", tmp_path / "recorded")
    assert lines[-1] == "not in every frame: VOXEL-GRID in 2 of 3", "a made-up scene has no roads"
    labeler = SimpleNamespace(rows=lambda frame: made.ticks[2 * (frame.tick // 2)]["occupancy/points"])
    monkeypatch.setattr(voxels, "_labeler", lambda scene: labeler)
    assert not any("every frame" in line for line in export(tmp_path / "set", tmp_path / "out"))
    np.testing.assert_array_equal(*(npz(sweep(tmp_path / "out", "VOXEL-GRID", "npz", frame)) for frame in (0, 1)))


def test_metadata_places_the_sensors(exported: tuple[MadeUp, Path]) -> None:
    _, root = exported
    metadata = json.loads((root / "infos/simbev_infos_train.json").read_text())["metadata"]
    pose = metadata["CAM_BACK_LEFT"]
    ahead = Rotation.from_quat(np.roll(pose["sensor2lidar_rotation"], -1)).apply([0, 0, 1])
    np.testing.assert_allclose(ahead, [np.cos(np.radians(110)), np.sin(np.radians(110)), 0], atol=1e-9)
    np.testing.assert_allclose(metadata["CAM_FRONT"]["sensor2lidar_translation"], [0.6, 0, -0.2], atol=1e-9)
    np.testing.assert_allclose(metadata["RAD_FRONT"]["sensor2ego_translation"], [2.4, 0, 0.6])
    assert metadata["LIDAR"]["sensor2lidar_rotation"] == [1, 0, 0, 0]
    assert np.array(metadata["camera_intrinsics"]).shape == (3, 3)
    assert metadata["voxel_detector_properties"] == {
        "range": 4,
        "voxel_size": 1,
        "upper_limit": 7,
        "lower_limit": -1,
    }


def test_missing_channels_are_left_out_and_reported(tmp_path: Path) -> None:
    rig = [
        {**SENSORS[0], "modalities": ["rgb", "instance"]},
        {**SENSORS[1], "name": "cam_roof"},
        SENSORS[2],
    ]
    made_up_scene(tmp_path / "set/scenes/train/Blocks-0000", sensors=rig)
    lines = export(tmp_path / "set", tmp_path / "out")
    assert {path.name for path in (tmp_path / "out/sweeps").iterdir()} == {
        "RGB-CAM_FRONT",
        "LIDAR",
        "SEG-LIDAR",
        "VOXEL-GRID",
    }
    assert lines[1] == "the layout has no place for: cam_roof"
    missing = lines[0].removeprefix("not recorded: ").split(", ")
    assert {"RAD_LEFT", "IST-CAM_FRONT", "GNSS"} < set(missing)  # instances need semantic images too
    assert not {"LIDAR", "GT_DET", "RGB-CAM_FRONT"} & set(missing)


def test_an_export_resumes_and_a_replaced_scene_is_made_again(tmp_path: Path) -> None:
    bag, root = tmp_path / "set/scenes/train/Blocks-0000", tmp_path / "out"
    made_up_scene(bag)
    export(tmp_path / "set", root)
    kept = sweep(root, "LIDAR", "npz")
    kept.write_bytes(b"kept")
    made_up_scene(tmp_path / "set/scenes/train/Blocks-0001", number=1, ticks=1)
    export(tmp_path / "set", root)
    assert kept.read_bytes() == b"kept"
    infos = json.loads((root / "infos/simbev_infos_train.json").read_text())
    assert list(infos["data"]) == ["scene_0000", "scene_0001"]
    bag.rename(tmp_path / "old")
    made_up_scene(bag, ticks=2)
    export(tmp_path / "set", root)
    assert len(npz(kept)) and not [*root.rglob("*.part"), *root.rglob("*.partial")]
    assert not list(root.rglob("*scene-0000-frame-0002*")) and list(root.rglob("*scene-0001-frame-0000*"))
    infos = json.loads((root / "infos/simbev_infos_train.json").read_text())
    assert len(infos["data"]["scene_0000"]["scene_data"]) == 2


def test_an_interrupted_export_resumes_with_the_missing_parts(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    made_up_scene(tmp_path / "set/scenes/train/Blocks-0000", ticks=45)
    made = 0

    def fail_in_the_second_part(*arguments: Any) -> bytes:
        nonlocal made
        made += 1
        if made == 30:
            raise KeyboardInterrupt
        return encodings.npy(*arguments)

    with monkeypatch.context() as patch, pytest.raises(KeyboardInterrupt):
        patch.setattr(encodings, "gnss_bin", fail_in_the_second_part)
        export(tmp_path / "set", tmp_path / "out")
    parts = parts_of(open_dataset(tmp_path / "set"), tmp_path / "out")
    assert [part.record() is not None for part in parts] == [True, False, False]
    assert len(list((tmp_path / "out/sweeps/GNSS").iterdir())) == 20
    export(tmp_path / "set", tmp_path / "out")
    assert len(list((tmp_path / "out/sweeps/GNSS").iterdir())) == 45
    names = {path.name for path in (tmp_path / "out/.parts").iterdir()}
    assert names == {f"scene_0000-{first:06d}.json" for first in (0, 20, 40)}
    record = json.loads((tmp_path / "out/.parts/scene_0000-000040.json").read_text())
    assert list(record) == ["source", "count", "frames"] and record["count"] == 5


def paths_in_infos(root: Path) -> list[Path]:
    infos = json.loads((root / "infos/simbev_infos_train.json").read_text())
    frames = infos["data"]["scene_0000"]["scene_data"]
    return [Path(value) for frame in frames for value in frame.values() if isinstance(value, str)]


def test_a_moved_export_is_whole_and_resumes(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    made_up_scene(tmp_path / "set/scenes/train/Blocks-0000", ticks=21)
    export(tmp_path / "set", tmp_path / "out")
    before = (tmp_path / "out/infos/simbev_infos_train.json").read_bytes()
    moved = (tmp_path / "out").rename(tmp_path / "elsewhere")
    assert len(paths_in_infos(moved)) > 20 * 21 - 21 and all((moved / path).is_file() for path in paths_in_infos(moved))
    monkeypatch.setattr(Part, "begin", lambda part: pytest.fail(f"{part.name} is made again"))
    export(tmp_path / "set", moved)
    assert (moved / "infos/simbev_infos_train.json").read_bytes() == before


def test_absolute_paths_are_corrected_after_a_move_without_making_files_again(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    made_up_scene(tmp_path / "set/scenes/train/Blocks-0000")
    export(tmp_path / "set", tmp_path / "out", absolute_paths=True)
    assert all(path.is_absolute() and path.is_file() for path in paths_in_infos(tmp_path / "out"))
    moved = (tmp_path / "out").rename(tmp_path / "elsewhere")
    assert not any(path.is_file() for path in paths_in_infos(moved))
    monkeypatch.setattr(Part, "begin", lambda part: pytest.fail(f"{part.name} is made again"))
    export(tmp_path / "set", moved, absolute_paths=True)
    assert all(path.is_relative_to(moved) and path.is_file() for path in paths_in_infos(moved))
    export(tmp_path / "set", moved)
    assert not any(path.is_absolute() for path in paths_in_infos(moved))


def test_the_parts_beyond_the_end_of_a_shorter_scene_are_removed(tmp_path: Path) -> None:
    bag, root = tmp_path / "set/scenes/train/Blocks-0000", tmp_path / "out"
    made_up_scene(bag, ticks=21)
    export(tmp_path / "set", root)
    bag.rename(tmp_path / "old")
    made_up_scene(bag, ticks=2)
    export(tmp_path / "set", root)
    assert [path.name for path in (root / ".parts").iterdir()] == ["scene_0000-000000.json"]
    assert len(list(root.glob("sweeps/LIDAR/*"))) == 2


def test_the_command_exports_in_processes(tmp_path: Path) -> None:
    for number in range(2):
        made_up_scene(tmp_path / f"set/scenes/train/Blocks-{number:04d}", number=number, ticks=21)
    arguments = ["export", "simbev", str(tmp_path / "set"), "--out", str(tmp_path / "out"), "--workers", "2"]
    result = CliRunner().invoke(app, arguments)
    assert result.exit_code == 0 and "42 frames of 2 scenes" in result.output, result.output
    assert "42 of them were there already" in CliRunner().invoke(app, [*arguments, "--absolute-paths"]).output
    assert all(path.is_file() for path in paths_in_infos(tmp_path / "out/simbev"))
    infos = json.loads((tmp_path / "out/simbev/infos/simbev_infos_train.json").read_text())
    assert [len(scene["scene_data"]) for scene in infos["data"].values()] == [21, 21]
    assert (tmp_path / "out/simbev/configs/SimBEV-scene-0001.yaml").read_bytes() == b"seed: 1\n"


def test_a_part_holds_one_frame_at_a_time(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    made_up_scene(tmp_path / "set/scenes/train/Blocks-0000", ticks=5)
    make, made, held = Frame.__init__, list[weakref.ref[Frame]](), list[int]()

    def remember(frame: Frame, *values: Any) -> None:
        made.append(weakref.ref(frame))
        make(frame, *values)

    def count_frames(*_: object) -> None:
        held.append(sum(frame() is not None for frame in made))

    monkeypatch.setattr(Frame, "__init__", remember)
    monkeypatch.setattr(Part, "write", count_frames)
    for part in parts_of(open_dataset(tmp_path / "set"), tmp_path / "out"):
        make_part(part)
    assert len(made) >= 5 and 1 <= max(held) <= 2, "the one that was read last, and the one before"


def test_scenes_of_different_rigs_are_refused(tmp_path: Path) -> None:
    made_up_scene(tmp_path / "set/scenes/train/Blocks-0000")
    made_up_scene(tmp_path / "set/scenes/train/Blocks-0001", number=1, sensors=SENSORS[:3])
    with pytest.raises(InputError, match=r"Blocks-0001: its sensors are not those of .*Blocks-0000"):
        export(tmp_path / "set", tmp_path / "out")


def test_a_finished_part_is_on_the_disk(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    made_up_scene(tmp_path / "set/scenes/train/Blocks-0000")
    inodes: list[int] = []
    monkeypatch.setattr(os, "fsync", lambda descriptor: inodes.append(os.fstat(descriptor).st_ino))
    export(tmp_path / "set", tmp_path / "out")
    paths = list((tmp_path / "out").rglob("*"))
    assert len(paths) > 60 and {path.stat().st_ino for path in paths} <= set(inodes)
    order = {path: inodes.index(path.stat().st_ino) for path in paths if path.is_file()}
    record = next(position for path, position in order.items() if path.parent.name == ".parts")
    assert record > max(position for path, position in order.items() if path.parts[-3] in ("sweeps", "ground-truth"))


def test_a_damaged_record_is_one_line(tmp_path: Path) -> None:
    made_up_scene(tmp_path / "set/scenes/train/Blocks-0000")
    export(tmp_path / "set", tmp_path / "out")
    for record in (tmp_path / "out/.parts").iterdir():
        record.write_bytes(record.read_bytes().replace(b'"files": ', b'"other": '))
    with pytest.raises(InputError, match=rf"\A{tmp_path}/out/\.parts: cannot be read: 'files'\Z"):
        export(tmp_path / "set", tmp_path / "out")


def test_a_frame_without_labels_is_no_frame_of_the_layout(tmp_path: Path) -> None:
    spec = labeled_at(made_up_spec(SENSORS, ticks=24), 4)
    record_made_up(tmp_path / "set/scenes/train/Blocks-0000", spec)
    export(tmp_path / "set", tmp_path / "out")
    info = json.loads((tmp_path / "out/infos/simbev_infos_train.json").read_text())
    frames = info["data"]["scene_0000"]["scene_data"]
    assert [frame["frame"] for frame in frames] == [0, 5, 10, 15, 20]
    assert all({"GT_DET", "GT_SEG", "HD_MAP", "LIDAR", "RGB-CAM_FRONT"} <= frame.keys() for frame in frames)
    assert len(list((tmp_path / "out/sweeps/LIDAR").iterdir())) == 5
