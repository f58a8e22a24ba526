"""Tests of T4 datasets: tables, clouds and images agree with the bag, and an interrupted export resumes."""

import base64
import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml
from made_up_scene import SENSORS, MadeUp, made_up_scene, made_up_spec, record_made_up
from nuscenes_tables import digest
from pycocotools import mask as run_lengths
from scipy.spatial.transform import Rotation
from several_agents import roadside_unit, with_agents
from typer.testing import CliRunner

from simbev_exporters.nuscenes.lidarseg import frame_labels
from simbev_exporters.t4 import export as t4_export
from simbev_exporters.t4.annotations import name_tables, t4_names, visibility_levels
from simbev_exporters.t4.export import Exported, T4Settings, export_t4
from simbev_exporters.t4.scene_tables import T4Tables
from simbev_ros.cli.main import app
from simbev_ros.dataset import open_dataset
from simbev_ros.dataset.nuscenes.annotated_boxes import annotated_boxes
from simbev_ros.dataset.nuscenes.channels import channels_of
from simbev_ros.export.maps.point_map import REACH_M
from simbev_ros.foundation.errors import InputError
from simbev_ros.foundation.installation.extras import Extra
from simbev_ros.foundation.types import Float64Array
from simbev_ros.scene.blueprints import blueprint_named
from simbev_ros.scene.legend import legend
from simbev_ros.schema.boxes import BOX_DTYPE
from simbev_ros.schema.nuscenes import nuscenes_names, point_labels
from simbev_ros.schema.scene.state import ACTOR_DTYPE, Light
from simbev_ros.schema.views import VIEW_DTYPE

SECOND_LIDAR = {"type": "lidar", "name": "lidar_rear", "pose": {"x_m": -2.0, "z_m": 0.9, "yaw_deg": 170, "roll_deg": 5}}
TICKS = 12


def export(dataset: Path, out: Path, **settings: Any) -> Exported:
    return export_t4(open_dataset(dataset, threads=1), out, T4Settings(**settings))


def tables_of(folder: Path) -> dict[str, list[dict[str, Any]]]:
    return {path.stem: json.loads(path.read_text()) for path in (folder / "annotation").glob("*.json")}


def matrix(record: dict[str, Any]) -> Float64Array:
    pose = np.eye(4)
    pose[:3, :3] = Rotation.from_quat(np.roll(record["rotation"], -1)).as_matrix()
    pose[:3, 3] = record["translation"]
    return pose


def moved(pose: Float64Array, points_m: Any) -> Float64Array:
    return np.asarray(np.asarray(points_m, np.float64) @ pose[:3, :3].T + pose[:3, 3])


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A dataset of one scene with two lidars, ``set``, and its export, ``out``."""
    folder = tmp_path_factory.mktemp("t4")
    cameras = [{**SENSORS[0], "modalities": ["rgb", "instance"]}]
    made_up_scene(
        folder / "set/scenes/val/Blocks-0000", split="val", ticks=TICKS, sensors=[*cameras, *SENSORS[2:], SECOND_LIDAR]
    )
    assert export(folder / "set", folder / "out").made == 1
    return folder


@pytest.fixture(scope="module")
def tables(folder: Path) -> dict[str, list[dict[str, Any]]]:
    return tables_of(folder / "out/Blocks-0000")


def test_every_second_frame_is_a_sample_with_the_files_of_all_sensors(folder: Path, tables: Any) -> None:
    scene = open_dataset(folder / "set").scenes[0]
    assert [each["timestamp"] for each in tables["sample"]] == (scene.stamps_ns[::2] // 1000).tolist()
    assert tables["scene"][0]["nbr_samples"] == TICKS // 2
    files = {each["filename"] for each in tables["sample_data"]}
    ends = {"CAM_FRONT": "jpg", "LIDAR_CONCAT": "pcd.bin", "RADAR_FRONT": "pcd"}
    assert files == {f"data/{name}/{k:05d}.{end}" for name, end in ends.items() for k in range(TICKS // 2)}
    assert all((folder / "out/Blocks-0000" / file).is_file() for file in files)
    assert all(each["is_key_frame"] and each["is_valid"] for each in tables["sample_data"])
    assert {each["fileformat"] for each in tables["sample_data"]} == {*ends.values()}
    assert yaml.safe_load((folder / "out/splits.yaml").read_text()) == {"train": [], "val": ["Blocks-0000"], "test": []}


def test_tokens_lead_to_rows(tables: Any) -> None:
    known = {name: {row["token"] for row in rows} for name, rows in tables.items()}
    for rows in tables.values():
        for row in rows:
            for name, value in row.items():
                table = name.removesuffix("_token").removesuffix("_tokens")
                table = {"first_sample": "sample", "last_sample": "sample"}.get(table, table)
                table = "sample_annotation" if table in ("first_annotation", "last_annotation") else table
                if table in known and name.endswith(("_token", "_tokens")):
                    assert {*([value] if isinstance(value, str) else value)} <= known[table], name
    for name in ("sample", "sample_data", "sample_annotation"):
        for row in tables[name]:
            assert {row["prev"], row["next"]} - {""} <= known[name]


def test_poses_are_those_of_the_rear_axle(folder: Path, tables: Any) -> None:
    scene = open_dataset(folder / "set").scenes[0]
    axle_m = blueprint_named("vehicle.sedan").wheelbase_m / 2
    for row, frame in zip(tables["ego_pose"], scene[::2], strict=True):
        np.testing.assert_allclose(matrix(row), frame.map_from_ego @ _shift(-axle_m), atol=1e-9)
        odom = frame["odom"][-1]
        wx, wy, wz = odom["angular_velocity_radps"]
        np.testing.assert_allclose(row["twist"][3:], [wz, wy, wx])
        vx, vy, vz = odom["velocity_mps"]
        np.testing.assert_allclose(row["twist"][:3], [vx, vy - wz * axle_m, vz + wy * axle_m])
    calibrated = {each["sensor_token"]: each for each in tables["calibrated_sensor"]}
    for sensor in tables["sensor"]:
        record = calibrated[sensor["token"]]
        if sensor["modality"] == "lidar":
            np.testing.assert_array_equal(matrix(record), np.eye(4))
        else:
            known = scene.calibration[sensor["channel"].lower()]
            pose = known.ego_from_optical if sensor["modality"] == "camera" else known.ego_from_sensor
            np.testing.assert_allclose(_shift(-axle_m) @ matrix(record), pose, atol=1e-9)
        is_camera = sensor["modality"] == "camera"
        assert len(record["camera_distortion"]) == (5 if is_camera else 0)


def _shift(x_m: float) -> Float64Array:
    pose = np.eye(4)
    pose[0, 3] = x_m
    return pose


def test_the_cloud_has_the_points_of_all_lidars_about_base_link(folder: Path, tables: Any) -> None:
    scene = open_dataset(folder / "set").scenes[0]
    for number, (row, frame) in enumerate(zip(tables["ego_pose"], scene[::2], strict=True)):
        file = folder / f"out/Blocks-0000/data/LIDAR_CONCAT/{number:05d}.pcd.bin"
        rows = np.fromfile(file, np.float32).reshape(-1, 5)
        clouds = [frame[f"{name}/points"] for name in ("lidar", "lidar_rear")]
        points_m = [
            moved(frame.map_from_sensor(name), np.stack([cloud[axis] for axis in "xyz"], axis=1))
            for name, cloud in zip(("lidar", "lidar_rear"), clouds, strict=True)
        ]
        np.testing.assert_allclose(moved(matrix(row), rows[:, :3]), np.concatenate(points_m), atol=1e-4)
        cloud = np.concatenate(clouds)
        np.testing.assert_allclose(rows[:, 3], cloud["intensity"] * 255, rtol=1e-6)
        np.testing.assert_array_equal(rows[:, 4], cloud["ring"])


def test_annotations_are_the_boxes_with_their_velocities(folder: Path, tables: Any) -> None:
    scene = open_dataset(folder / "set").scenes[0]
    names = {each["token"]: each["name"] for name in ("category", "attribute") for each in tables[name]}
    levels = {each["token"]: each["level"] for each in tables["visibility"]}
    category = {each["token"]: names[each["category_token"]] for each in tables["instance"]}
    number = {each["token"]: int(each["instance_name"].removeprefix("Blocks-0000::")) for each in tables["instance"]}
    count = 0
    for sample, frame in zip(tables["sample"], scene[::2], strict=True):
        boxes = {int(box["id"]): box for box in annotated_boxes(frame)}
        found = [each for each in tables["sample_annotation"] if each["sample_token"] == sample["token"]]
        lights_and_signs = {box_id for box_id, box in boxes.items() if box["class"] in (6, 7)}
        assert {number[each["instance_token"]] for each in found} == boxes.keys() - lights_and_signs
        for each in found:
            box = boxes[number[each["instance_token"]]]
            np.testing.assert_allclose(each["translation"], [box[axis] for axis in "xyz"], atol=1e-6)
            np.testing.assert_allclose(each["size"], [box[name] for name in ("width", "length", "height")], atol=1e-6)
            turn = Rotation.from_euler("xyz", [box[name] for name in ("roll", "pitch", "yaw")]).as_matrix()
            np.testing.assert_allclose(matrix(each)[:3, :3], turn, atol=1e-6)
            np.testing.assert_allclose(each["velocity"], [box[name] for name in ("vx", "vy", "vz")], atol=1e-6)
            np.testing.assert_allclose(each["acceleration"], [box[name] for name in ("ax", "ay", "az")], atol=1e-6)
            share = 0.0 if np.isnan(box["visibility"]) else box["visibility"]
            expected = "full" if share >= 0.95 else "most" if share >= 0.5 else "partial" if share >= 0.1 else "none"
            assert levels[each["visibility_token"]] == expected
            words = {names[token] for token in each["attribute_tokens"]}
            if category[each["instance_token"]] in ("car", "truck", "bus"):
                assert f"brake_lamp.{'on' if box['lights'] & Light.BRAKE else 'off'}" in words
                assert len(words) == 4
            count += 1
    assert count > 20


def test_categories_are_t4s_for_all_of_nuscenes() -> None:
    known = {*nuscenes_names()["categories"]} - {"static.manmade", "static_object.bicycle_rack"}
    assert {*t4_names()["categories"]} == known
    assert {"car", "fire_truck", "police_car", "wheelchair"} <= {each["name"] for each in name_tables()["category"]}


def test_a_fire_engine_is_a_fire_truck(folder: Path) -> None:
    scene = open_dataset(folder / "set").scenes[0]
    blueprints = [each["name"] for each in scene.constants["world/legend"]["blueprints"]]
    boxes, files = np.zeros(3, BOX_DTYPE), dict[str, bytes]()
    boxes["id"] = [2, 3, 4]
    wanted = ["vehicle.fire_engine", "vehicle.police", "vehicle.box_truck"]
    boxes["blueprint"], boxes["class"] = [blueprints.index(name) for name in wanted], [1, 0, 1]
    boxes["lidar_points"], boxes["visibility"] = 1, [0.05, 0.1, 0.97]
    frame = _Frame({"boxes": boxes, "world/actors": np.zeros(0, ACTOR_DTYPE)}, scene)
    annotations = T4Tables(scene, 10.0, {}, files.__setitem__, keep_unhit=True, lidarseg=False)._t4_annotations
    annotations.add("sample", frame)  # type: ignore[arg-type]
    names = {each["token"]: each["name"] for each in name_tables()["category"]}
    assert [names[annotations.keys_of(k)["category_token"]] for k in (2, 3, 4)] == ["fire_truck", "police_car", "truck"]
    assert visibility_levels(boxes) == ["none", "partial", "full"]


class _Frame(dict[str, Any]):
    def __init__(self, values: dict[str, Any], scene: Any) -> None:
        super().__init__(values)
        self.scene = scene


@pytest.mark.filterwarnings("ignore:__array__ implementation:DeprecationWarning")
def test_2d_annotations_have_the_boxes_and_masks_of_what_is_visible(tmp_path: Path) -> None:
    camera = {**SENSORS[0], "modalities": ["rgb", "instance"]}
    spec = made_up_spec([camera, SENSORS[2]], ticks=1)
    views = np.zeros(2, VIEW_DTYPE)
    views["id"], views["visible_px"], views["alone_px"] = [2, 3], [40, 0], 60
    views["amodal_left"], views["amodal_top"] = [-4.5, 1.5], [2.5, 1.5]
    views["amodal_right"], views["amodal_bottom"] = [9.5, 5.5], [12.5, 5.5]
    made = record_made_up(tmp_path / "set/Blocks-0000", spec, tables={"/ego/cam_front/boxes": views})
    export(tmp_path / "set/Blocks-0000", tmp_path / "out", keep_unhit=True)
    tables = tables_of(tmp_path / "out/Blocks-0000")
    instance = made.ticks[0]["cam_front/instance"]
    (row,) = tables["object_ann"]
    assert row["bbox"] == [0, 3, 10, 13], "the hidden object has none; pixels are from 0 to 1"
    decoded = run_lengths.decode({"size": row["mask"]["size"], "counts": base64.b64decode(row["mask"]["counts"])})
    np.testing.assert_array_equal(decoded.T.astype(bool), instance == 2)
    assert row["mask"]["size"] == [32, 24]


def test_points_have_the_categories_of_nuscenes_labels(tmp_path: Path) -> None:
    sensors = [{**each, "points": False, "semantic_points": True} for each in (SENSORS[2], SECOND_LIDAR)]
    made_up_scene(tmp_path / "set/Blocks-0000", ticks=1, sensors=sensors)
    export(tmp_path / "set/Blocks-0000", tmp_path / "out", lidarseg=True)
    tables, frame = tables_of(tmp_path / "out/Blocks-0000"), open_dataset(tmp_path / "set/Blocks-0000").scenes[0][0]
    (row,) = tables["lidarseg"]
    labels = np.fromfile(tmp_path / "out/Blocks-0000" / row["filename"], np.uint8)
    names = {each["index"]: each["name"] for each in tables["category"]}
    assert sorted(names) == list(range(len(names)))
    channels = [each for each in channels_of(frame.scene) if each.modality == "lidar"]
    original = [list(point_labels())[label] for each in channels for label in frame_labels(frame, each)]
    expected = [t4_names()["categories"].get(name, name) for name in original]
    assert [names[label] for label in labels.tolist()] == expected and len(set(expected)) > 3
    (data,) = tables["sample_data"]
    assert row["sample_data_token"] == data["token"]
    assert len(labels) == (tmp_path / "out/Blocks-0000" / data["filename"]).stat().st_size / 20
    export(tmp_path / "set/Blocks-0000", tmp_path / "out")
    assert not list((tmp_path / "out").glob("Blocks-0000/lidarseg/annotation/*"))


def test_the_vehicle_reports_its_state(folder: Path, tables: Any) -> None:
    scene = open_dataset(folder / "set").scenes[0]
    for row, frame in zip(tables["vehicle_state"], scene[::2], strict=True):
        (ego,) = frame["world/actors"][frame["world/actors"]["id"] == 1]
        assert row["steering_tire_angle"] == pytest.approx(float(ego["steer"]))
        assert row["shift_state"] == ("REVERSE" if ego["lights"] & 16 else "FORWARD")
        lit = {"left": bool(ego["lights"] & 4), "right": bool(ego["lights"] & 8)}
        assert row["indicators"] == {
            name: "on" if on else "off" for name, on in {**lit, "hazard": all(lit.values())}.items()
        }
        assert row["additional_info"]["speed"] == pytest.approx(3.6 * frame["odom"][-1]["velocity_mps"][0])


def test_the_map_is_autowares(folder: Path) -> None:
    text = (folder / "out/Blocks-0000/map/lanelet2_map.osm").read_text()
    assert "lanelet" in text and (folder / "out/Blocks-0000/map/map_projector_info.yaml").is_file()
    cloud = (folder / "out/Blocks-0000/map/pointcloud_map.pcd").read_bytes()
    points_m = np.frombuffer(cloud[cloud.index(b"DATA binary\n") + 12 :], "<f4").reshape(-1, 3)
    path_m = [row["translation"] for row in tables_of(folder / "out/Blocks-0000")["ego_pose"]]
    away_m = np.min([np.linalg.norm(points_m - place_m, axis=1) for place_m in path_m], axis=0)
    assert len(points_m) > 10_000 and away_m.min() < 0.5 and 60.0 < away_m.max() < REACH_M + 3.0
    status = json.loads((folder / "out/Blocks-0000/status.json").read_text())
    assert status["scene"] == {"name": "Blocks-0000", "split": "val", "seed": 0, "map": "Blocks"}


def test_the_bag_is_copied_on_request(folder: Path, tmp_path: Path) -> None:
    export(folder / "set", tmp_path / "out", input_bag=True)
    bag, copy = folder / "set/scenes/val/Blocks-0000", tmp_path / "out/Blocks-0000/input_bag"
    assert {file.name: file.read_bytes() for file in copy.iterdir()} == {
        file.name: file.read_bytes() for file in bag.iterdir()
    }
    export(folder / "set", tmp_path / "out")
    assert not copy.exists() or not any(copy.iterdir())


def test_without_the_simulator_there_is_no_map(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    made_up_scene(tmp_path / "set/Blocks-0000", ticks=2)
    monkeypatch.setattr(t4_export, "load_extras", lambda: {"sim": Extra("sim", "the simulator", ("no_such_module",))})
    assert not export(tmp_path / "set/Blocks-0000", tmp_path / "out").has_maps
    assert not (tmp_path / "out/Blocks-0000/map").exists()


def test_only_new_scenes_are_made_and_other_settings_replace_all(tmp_path: Path) -> None:
    for number in range(2):
        made_up_scene(tmp_path / f"set/scenes/train/Blocks-{number:04d}", number=number, ticks=4)
    assert export(tmp_path / "set", tmp_path / "out").made == 2
    (tmp_path / "out/.parts/Blocks-0001.t4.json").unlink()
    assert export(tmp_path / "set", tmp_path / "out").made == 1
    assert export(tmp_path / "set", tmp_path / "out", keyframe_hz=20.0).samples == 8
    export(tmp_path / "set", tmp_path / "fresh", keyframe_hz=20.0)
    assert digest(tmp_path / "out") == digest(tmp_path / "fresh")


def test_a_roadside_unit_has_its_own_frame_and_no_vehicle_state(tmp_path: Path) -> None:
    record_made_up(tmp_path / "set/Blocks-0000", with_agents(made_up_spec(SENSORS, ticks=2), roadside_unit("rsu")))
    dataset = open_dataset(tmp_path / "set/Blocks-0000", threads=1).of_agent("rsu")
    assert export_t4(dataset, tmp_path / "out").samples == 1
    tables, frame = tables_of(tmp_path / "out/Blocks-0000"), dataset.scenes[0][0]
    np.testing.assert_allclose(matrix(tables["ego_pose"][0]), frame.map_from_ego, atol=1e-9)
    assert tables["vehicle_state"] == [] and tables["log"][0]["vehicle"] == "rsu"


def test_the_command_reports_what_it_made(folder: Path, tmp_path: Path) -> None:
    words = ["export", "t4", str(folder / "set"), "--out", str(tmp_path / "out"), "--workers", "1", "--all-frames"]
    words += ["--channel", "cam_front=CAM_A"]
    first, second = (CliRunner().invoke(app, words, catch_exceptions=False).output for _ in range(2))
    assert f"{TICKS} samples of 1 scene, {3 * TICKS} files in {tmp_path / 'out'}" in first
    assert "1 scene was there already" in second
    assert (tmp_path / "out/Blocks-0000/data/CAM_A/00011.jpg").is_file()


def test_bad_input_is_explained(tmp_path: Path) -> None:
    made_up_scene(tmp_path / "set/scenes/train/Blocks-0000", ticks=2)
    with pytest.raises(InputError, match=r"keyframe_hz: 3 does not divide the 20 frames/s"):
        export(tmp_path / "set", tmp_path / "out", keyframe_hz=3.0)
    (tmp_path / "real/Blocks-0000").mkdir(parents=True)
    with pytest.raises(InputError, match="folders of the scenes that simbev has not written"):
        export(tmp_path / "set", tmp_path / "real")
    (tmp_path / "empty/scenes").mkdir(parents=True)
    with pytest.raises(InputError, match="no finished scene to export"):
        export(tmp_path / "empty", tmp_path / "out")


def test_a_damaged_scene_leaves_nothing(tmp_path: Path) -> None:
    made: MadeUp = made_up_scene(tmp_path / "set/scenes/train/Blocks-0000", ticks=4)
    file = next((tmp_path / "set").rglob("*.mcap"))
    data = bytearray(file.read_bytes())
    data[len(data) // 2 : len(data) // 2 + 200] = bytes(200)
    file.write_bytes(data)
    assert made.spec.ticks == 4
    done = export(tmp_path / "set", tmp_path / "out")
    assert list(done.failures) == ["Blocks-0000"] and not (tmp_path / "out/Blocks-0000").exists()
    result = CliRunner().invoke(app, ["export", "t4", str(tmp_path / "set"), "--out", str(tmp_path / "out")])
    assert isinstance(result.exception, InputError) and "CRC" in str(result.exception)


def test_a_scene_with_impossible_content_does_not_keep_others_from_being_exported(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    made_up_scene(tmp_path / "set/scenes/val/Blocks-0001", number=1, split="val", ticks=4)
    complete = legend()
    monkeypatch.setattr("made_up_scene.legend", lambda: {**complete, "blueprints": complete["blueprints"][:1]})
    made_up_scene(tmp_path / "set/scenes/train/Blocks-0000", ticks=4)
    done = export(tmp_path / "set", tmp_path / "out")
    assert list(done.failures) == ["Blocks-0000"] and not (tmp_path / "out/Blocks-0000").exists()
    assert "Blocks-0000: cannot be exported: IndexError" in done.failures["Blocks-0000"]
    assert (tmp_path / "out/Blocks-0001/annotation/scene.json").is_file()
