"""Tests that nuScenes' layout is consistent and that its positions agree with the bags."""

import json
import re
from collections import Counter
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import shapely
from made_up_scene import made_up_scene
from nuscenes_tables import Tables, digest, export, tables_of
from PIL import Image
from scipy.spatial.transform import Rotation
from typer.testing import CliRunner

from simbev_exporters.nuscenes.evaluated_classes import evaluated_classes
from simbev_exporters.nuscenes.sites import sites_of
from simbev_exporters.nuscenes.taxonomy import taxonomy_tables
from simbev_ros.cli.main import app
from simbev_ros.config.camera import Camera
from simbev_ros.dataset import Frame, Scene, columns, open_dataset
from simbev_ros.dataset.nuscenes.annotated_boxes import annotated_boxes
from simbev_ros.dataset.nuscenes.keyframes import keyframe_by_tick
from simbev_ros.export import sensor_data
from simbev_ros.foundation.geometry.camera import LensCamera
from simbev_ros.foundation.geometry.fisheye import FisheyeCamera
from simbev_ros.foundation.geometry.transforms import apply, inverse, matrices_from_xyz_rpy
from simbev_ros.foundation.semantics import BOX_CLASSES, CLASSES
from simbev_ros.foundation.types import AnyArray, Float64Array, Table
from simbev_ros.maps.build import load_network
from simbev_ros.maps.roads.surface import surfaces_of
from simbev_ros.scene.blueprints import load_blueprints
from simbev_ros.schema.nuscenes import nuscenes_names, visibility_tokens
from simbev_ros.schema.scene.map_spec import MapSpec

CORNERS = np.array([[x, y, z] for x in (-0.5, 0.5) for y in (-0.5, 0.5) for z in (-0.5, 0.5)])


@pytest.fixture(scope="module")
def tables(nuscenes_folder: Path) -> Tables:
    return tables_of(nuscenes_folder / "out")


@pytest.fixture(scope="module")
def scene(nuscenes_folder: Path) -> Scene:
    return open_dataset(nuscenes_folder / "set").scenes[0]


def index(records: list[dict[str, Any]]) -> dict[str, dict[str, Any]]:
    known = {record["token"]: record for record in records}
    assert len(known) == len(records), "two records have one token"
    return known


def matrix(record: dict[str, Any]) -> Float64Array:
    """(4, 4) transform of a record's translation and quaternion w x y z, by scipy."""
    pose = np.eye(4)
    pose[:3, :3] = Rotation.from_quat(np.roll(record["rotation"], -1)).as_matrix()
    pose[:3, 3] = record["translation"]
    return pose


def global_from_map(tables: Tables) -> Float64Array:
    pose = np.eye(4)
    pose[:2, 3] = -np.array(tables["map"][0]["origin_m"])
    return pose


def row_of(tables: Tables, channel: str, stamp_ns: int) -> dict[str, Any]:
    """Row of the table ``sample_data`` of a channel at a stamp."""
    rows = [row for row in tables["sample_data"] if channel == row["filename"].split("/")[1]]
    return next(row for row in rows if row["timestamp"] * 1000 == stamp_ns)


def annotations_of(tables: Tables, data: dict[str, Any]) -> list[dict[str, Any]]:
    return [record for record in tables["sample_annotation"] if record["sample_token"] == data["sample_token"]]


def hit_boxes(frame: Frame) -> Table:
    """Recorded boxes of a frame, of those that nuScenes annotates; made-up actors have the size of their box."""
    return frame["boxes"][np.isin(frame["boxes"]["id"], annotated_boxes(frame)["id"])]


def test_every_token_refers_to_something(tables: Tables) -> None:
    known = {name: index(records) for name, records in tables.items()}
    aliases = {"first_sample": "sample", "last_sample": "sample"}
    aliases |= dict.fromkeys(("first_annotation", "last_annotation"), "sample_annotation")
    for name, records in tables.items():
        for record in records:
            for key, value in record.items():
                if key.endswith("_token"):
                    table = key.removesuffix("_token")
                    assert value in known[aliases.get(table, table)], f"{name}: {key}"
                elif key.endswith("_tokens"):
                    assert set(value) <= set(known[key.removesuffix("_tokens")]), f"{name}: {key}"
                elif key in {"prev", "next"}:
                    assert value == "" or value in known[name], f"{name}: {key}"
    assert sorted(token for record in tables["map"] for token in record["log_tokens"]) == sorted(known["log"])


def test_chains_run_through_time(tables: Tables) -> None:
    stamp = {record["token"]: record["timestamp"] for record in tables["sample"]}
    groups = {
        "sample": ("scene_token", lambda record: record["timestamp"]),
        "sample_data": ("calibrated_sensor_token", lambda record: record["timestamp"]),
        "sample_annotation": ("instance_token", lambda record: stamp[record["sample_token"]]),
    }
    for name, (key, time) in groups.items():
        for group in {record[key] for record in tables[name]}:
            chain = sorted((record for record in tables[name] if record[key] == group), key=time)
            assert len({time(record) for record in chain}) == len(chain)
            tokens = [record["token"] for record in chain]
            assert [record["prev"] for record in chain] == ["", *tokens[:-1]]
            assert [record["next"] for record in chain] == [*tokens[1:], ""]


def test_instances_and_scenes_know_their_first_and_last(tables: Tables) -> None:
    count = Counter(record["instance_token"] for record in tables["sample_annotation"])
    annotations, samples = index(tables["sample_annotation"]), index(tables["sample"])
    for instance in tables["instance"]:
        assert instance["nbr_annotations"] == count[instance["token"]]
        assert annotations[instance["first_annotation_token"]]["prev"] == ""
        assert annotations[instance["last_annotation_token"]]["next"] == ""
    for scene in tables["scene"]:
        assert samples[scene["first_sample_token"]]["prev"] == ""
        assert samples[scene["last_sample_token"]]["next"] == ""


def test_keyframes_are_at_2_hz_and_sweeps_belong_to_the_next_one(tables: Tables, scene: Scene) -> None:
    token = next(record["token"] for record in tables["scene"] if record["name"] == "Blocks-0000")
    samples = [record for record in tables["sample"] if record["scene_token"] == token]
    assert [record["timestamp"] * 1000 for record in samples] == scene.stamps_ns[[0, 10, 20]].tolist()
    lidar = [record for record in tables["sample_data"] if "/LIDAR_TOP/Blocks-0000" in record["filename"]]
    assert [record["is_key_frame"] for record in lidar] == [tick % 10 == 0 for tick in range(23)]
    number = {record["token"]: index for index, record in enumerate(samples)}
    assert [number[record["sample_token"]] for record in lidar] == [0, *[1] * 10, *[2] * 12]
    assert all(record["filename"].startswith("samples/" if record["is_key_frame"] else "sweeps/") for record in lidar)


def test_the_files_equal_those_of_the_table(tables: Tables, nuscenes_folder: Path) -> None:
    named = [record["filename"] for record in tables["sample_data"]]
    there = [
        str(path.relative_to(nuscenes_folder / "out"))
        for part in ("samples", "sweeps")
        for path in (nuscenes_folder / "out" / part).rglob("*.*")
    ]
    assert sorted(named) == sorted(there)
    assert len(named) == (23 + 12) * 4


def test_boxes_project_to_the_same_pixels_as_in_our_camera(tables: Tables, scene: Scene) -> None:
    data = row_of(tables, "CAM_BACK_LEFT", scene[10].stamp_ns)
    calibration = index(tables["calibrated_sensor"])[data["calibrated_sensor_token"]]
    optical_from_global = inverse(matrix(index(tables["ego_pose"])[data["ego_pose_token"]]) @ matrix(calibration))
    seen = 0
    for record, row in zip(annotations_of(tables, data), hit_boxes(scene[10]), strict=True):
        width, length, height = record["size"]
        corners_m = apply(optical_from_global @ matrix(record), CORNERS * [length, width, height])
        pixels = corners_m @ np.array(calibration["camera_intrinsic"]).T
        rpy = np.array([row["roll"], row["pitch"], row["yaw"]], np.float64)
        map_from_box = matrices_from_xyz_rpy(np.array([row["x"], row["y"], row["z"]]), rpy)
        expected_m = apply(map_from_box, CORNERS * [row["length"], row["width"], row["height"]])
        expected_m = apply(inverse(scene[10].map_from_optical("cam_back_left")), expected_m)
        np.testing.assert_allclose(corners_m, expected_m, atol=1e-4)
        ahead = expected_m[:, 2] > 0.5
        ours = scene.calibration["cam_back_left"].camera.project(expected_m[ahead])
        np.testing.assert_allclose(pixels[ahead, :2] / pixels[ahead, 2:], ours, atol=0.02)
        seen += ahead.sum()
    assert seen > 10


def test_annotations_agree_with_boxes(tables: Tables, scene: Scene) -> None:
    records = annotations_of(tables, row_of(tables, "LIDAR_TOP", scene[10].stamp_ns))
    known = {name: index(tables[name]) for name in ("instance", "category", "attribute")}
    for record, row in zip(records, hit_boxes(scene[10]), strict=True):
        global_from_box = matrix(record) @ np.diag([*np.array(record["size"])[[1, 0, 2]] / 2, 1])
        for sensor, name in (("lidar", "num_lidar_pts"), ("radar_front", "num_radar_pts")):
            points_m = columns(scene[10][f"{sensor}/points"], "x", "y", "z")
            points_m = apply(global_from_map(tables) @ scene[10].map_from_sensor(sensor), points_m)
            inside = (np.abs(apply(np.linalg.inv(global_from_box), points_m)) <= 1).all(axis=1)
            assert record[name] == inside.sum(), row["id"]
        assert len(record["attribute_tokens"]) == 1
    category = [known["category"][known["instance"][r["instance_token"]]["category_token"]]["name"] for r in records]
    attribute = [known["attribute"][record["attribute_tokens"][0]]["name"] for record in records]
    assert category[-2:] == ["static.manmade"] * 2
    assert attribute[-2:] == ["traffic_light.green", "traffic_sign.speed_limit"]


def test_lidar_points_are_in_the_frame_of_their_calibration(
    tables: Tables, scene: Scene, nuscenes_folder: Path
) -> None:
    data = row_of(tables, "LIDAR_TOP", scene[7].stamp_ns)
    rows = np.fromfile(nuscenes_folder / "out" / data["filename"], np.float32).reshape(-1, 5)
    cloud = scene[7]["lidar/points"]
    np.testing.assert_array_equal(rows[:, 0], -cloud["y"])  # right
    np.testing.assert_array_equal(rows[:, 1], cloud["x"])  # ahead
    np.testing.assert_array_equal(rows[:, 4], cloud["ring"])
    calibration = index(tables["calibrated_sensor"])[data["calibrated_sensor_token"]]
    global_from_lidar = matrix(index(tables["ego_pose"])[data["ego_pose_token"]]) @ matrix(calibration)
    expected_m = apply(global_from_map(tables) @ scene[7].map_from_sensor("lidar"), columns(cloud, "x", "y", "z"))
    np.testing.assert_allclose(apply(global_from_lidar, rows[:, :3]), expected_m, atol=2e-5)


def read_pcd(path: Path) -> AnyArray:
    """Rows of a PCD file, read as its head describes them."""
    head, _, body = path.read_bytes().partition(b"DATA binary\n")
    fields = {line.split()[0]: line.split()[1:] for line in head.decode().splitlines() if not line.startswith("#")}
    kinds = [kind.lower() + size for kind, size in zip(fields["TYPE"], fields["SIZE"], strict=True)]
    dtype = np.dtype(list(zip(fields["FIELDS"], kinds, strict=True)))
    assert dtype.itemsize == 43 and len(fields["FIELDS"]) == 18
    return np.frombuffer(body, dtype, int(fields["POINTS"][0]))


def test_radar_files_have_the_positions_of_detections(tables: Tables, scene: Scene, nuscenes_folder: Path) -> None:
    data = row_of(tables, "RADAR_FRONT", scene[7].stamp_ns)
    rows, cloud = read_pcd(nuscenes_folder / "out" / data["filename"]), scene[7]["radar_front/points"]
    for name in ("x", "y", "z"):
        np.testing.assert_array_equal(rows[name], cloud[name])


@pytest.mark.parametrize(
    "lens",
    [
        {"horizontal_fov_deg": 60, "distortion": [-0.2, 0.05, 0, 0, 0]},
        {"horizontal_fov_deg": 190, "distortion_model": "equidistant", "distortion": [0.02, 0, 0, 0]},
    ],
)
def test_distorted_images_are_rectified(lens: dict[str, object]) -> None:
    settings = {"type": "camera", "name": "a", "width_px": 64, "height_px": 48}
    camera = Camera.model_validate({**settings, **lens}).model
    assert isinstance(camera, LensCamera | FisheyeCamera)
    image = np.broadcast_to(3 * np.arange(64, dtype=np.uint8)[None, :, None], (48, 64, 3))
    rectified = sensor_data.rectify(np.ascontiguousarray(image), camera)
    v, u = np.mgrid[8:40, 8:56]
    rays = np.stack([(u - camera.cx_px) / camera.fx_px, (v - camera.cy_px) / camera.fy_px, np.ones_like(u)], axis=-1)
    expected = 3 * camera.project(rays.reshape(-1, 3))[:, 0].reshape(u.shape)
    assert np.abs(rectified[8:40, 8:56, 0] - expected).max() < 1.5


def test_images_are_jpegs_of_the_size_in_the_table(tables: Tables, nuscenes_folder: Path) -> None:
    data = next(record for record in tables["sample_data"] if "CAM_FRONT" in record["filename"])
    with Image.open(nuscenes_folder / "out" / data["filename"]) as image:
        assert (image.format, image.size) == ("JPEG", (data["width"], data["height"]))


def test_the_mask_is_white_on_roads_and_sidewalks(tables: Tables, nuscenes_folder: Path) -> None:
    record = tables["map"][0]
    with Image.open(nuscenes_folder / "out" / record["filename"]) as image:
        mask = np.asarray(image)
    rng = np.random.default_rng(0)
    positions_m = rng.uniform([1, 1], [mask.shape[1] / 10 - 1, mask.shape[0] / 10 - 1], (4000, 2))
    column, row = np.rint([positions_m[:, 0] * 10, mask.shape[0] - positions_m[:, 1] * 10]).astype(int)
    surfaces = surfaces_of(load_network(MapSpec(name="Blocks")).layout)
    paved = shapely.union_all([surfaces.road, surfaces.shoulder, surfaces.sidewalk])
    points = shapely.points(positions_m + record["origin_m"])
    shapely.prepare(paved)
    sure = shapely.distance(shapely.boundary(paved), points) > 0.2
    np.testing.assert_array_equal((mask[row, column] == 255)[sure], shapely.contains(paved, points)[sure])
    assert 0.02 < (mask == 255).mean() < 0.5


def test_the_origin_leads_back_to_the_map(tables: Tables, scene: Scene) -> None:
    [record] = tables["map"]
    origin_m = [*record["origin_m"], 0]
    data = row_of(tables, "LIDAR_TOP", scene[10].stamp_ns)
    pose_m = index(tables["ego_pose"])[data["ego_pose_token"]]["translation"]
    assert min(pose_m[:2]) >= 150, "at least the margin around the ego's paths"
    np.testing.assert_allclose(np.add(pose_m, origin_m), scene[10].map_from_ego[:3, 3])
    for record, row in zip(annotations_of(tables, data), hit_boxes(scene[10]), strict=True):
        center_m = np.add(record["translation"], origin_m)
        np.testing.assert_allclose(center_m, [row["x"], row["y"], row["z"]], atol=1e-6)


def test_classes_occur_if_their_boxes_are_hit_and_in_range() -> None:
    kinds = ["vehicle.car", "vehicle.truck", "vehicle.bus.rigid", "human.pedestrian.child", "vehicle.emergency.police"]
    category = {record["name"]: record["token"] for record in taxonomy_tables()["category"]}
    x_m, points = [100.0 + 49, 100 + 51, 100 + 49, 100 - 39, 100], [(0, 1), (5, 0), (0, 0), (-1, 0), (9, 9)]
    annotations = [
        {"instance_token": kind, "sample_token": "s", "translation": [x, 0, 0], "num_lidar_pts": a, "num_radar_pts": b}
        for kind, x, (a, b) in zip(kinds, x_m, points, strict=True)
    ]
    data = [
        {"sample_token": "s", "ego_pose_token": pose, "is_key_frame": key, "filename": f"samples/{channel}/x"}
        for pose, key, channel in [("far", False, "LIDAR_TOP"), ("near", True, "LIDAR_TOP"), ("far", True, "CAM_FRONT")]
    ]
    rows: dict[str, Any] = {
        "instance": [{"token": kind, "category_token": category[kind]} for kind in kinds],
        "sample_annotation": annotations,
        "sample_data": data,
        "ego_pose": [{"token": "near", "translation": [100, 0, 0]}, {"token": "far", "translation": [0, 0, 0]}],
    }
    assert evaluated_classes(rows) == {"car", "pedestrian"}


def test_the_command_says_where_the_origin_is_and_which_classes_count_0(nuscenes_folder: Path) -> None:
    words = ["export", "nuscenes", str(nuscenes_folder / "set"), "--out", str(nuscenes_folder / "out")]
    result = CliRunner().invoke(app, words)
    origin_m = tables_of(nuscenes_folder / "out")["map"][0]["origin_m"]
    assert result.exit_code == 0 and "2 scenes were there already" in result.output
    place = f"x {origin_m[0]:g} m, y {origin_m[1]:g} m of the map (origin_m in map.json)"
    assert f"Blocks: nuScenes' origin is at {place}" in result.output
    said = re.search(r"simbev_train: (\d) of 10 classes occur, .* mAP of 0\.(\d) .*; not: (.*)", result.output)
    assert said is not None and said[1] == said[2] and len(said[3].split(", ")) == 10 - int(said[1])
    assert {"trailer", "construction_vehicle"} <= set(said[3].split(", "))


def test_a_moved_export_is_not_made_again(tmp_path: Path) -> None:
    made_up_scene(tmp_path / "set/scenes/train/Blocks-0000")
    export(tmp_path / "set", tmp_path / "out")
    before = digest(tmp_path / "out")
    (tmp_path / "out").rename(tmp_path / "elsewhere")
    assert export(tmp_path / "set", tmp_path / "elsewhere").made == 0
    assert digest(tmp_path / "elsewhere") == before


def test_distant_scenes_have_separate_masks() -> None:
    def summary(name: str, x_m: float) -> dict[str, Any]:
        extent = {"low_m": [x_m, 0.0], "high_m": [x_m + 50, 10.0], "bag": ""}
        return {"name": name, "map": {"name": "Town13", "seed": 0}, **extent}

    near, far = sites_of([summary("a", 0), summary("b", 900)]), sites_of([summary("a", 0), summary("b", 9e4)])
    assert [(site.scenes, site.name) for site in near] == [(("a", "b"), "Town13")]
    assert [(site.scenes, site.name) for site in far] == [(("a",), "Town13 a"), (("b",), "Town13 b")]
    assert far[1].low_m == (89850.0, -150.0)


def test_splits_name_their_scenes(nuscenes_folder: Path) -> None:
    splits = json.loads((nuscenes_folder / "out/v1.0-trainval/splits.json").read_text())
    assert splits == {"simbev_train": ["Blocks-0000"], "simbev_val": ["Blocks-0001"], "simbev_test": []}


def test_samples_have_the_last_data_of_slower_sensors(tmp_path: Path) -> None:
    made = made_up_scene(tmp_path / "Blocks-0000", ticks=21)
    taken = keyframe_by_tick(open_dataset(tmp_path / "Blocks-0000").scenes[0], _Occupancy(), np.array([0, 5, 11, 20]))  # type: ignore[arg-type]
    assert taken == {0: 0, 4: 5, 10: 11, 20: 20}
    assert "occupancy/points" in made.ticks[4]


class _Occupancy:
    key = "occupancy/points"


def test_everything_has_a_category_and_visibility_a_level() -> None:
    known = {record["name"] for record in taxonomy_tables()["category"]}
    of_blueprint = nuscenes_names()["of_blueprint"]
    assert {*(CLASSES[name]["nuscenes"] for name in BOX_CLASSES), *of_blueprint.values()} <= known
    assert set(of_blueprint) <= {blueprint.name for blueprint in load_blueprints()}
    assert visibility_tokens(np.array([np.nan, 0.39, 0.4, 0.61, 0.8, 1.0])) == ["1", "1", "2", "3", "4", "4"]
