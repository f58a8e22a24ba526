"""Tests that each lidar point is labeled with the category of what its ray hits, and that exports have all labels."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from made_up_scene import SENSORS, made_up_scene
from nuscenes_tables import digest, export
from typer.testing import CliRunner

from simbev_exporters.nuscenes.point_categories import labels_of_points, labels_of_surfaces
from simbev_exporters.nuscenes.taxonomy import taxonomy_tables
from simbev_ros.cli.main import app
from simbev_ros.foundation.semantics import Tag
from simbev_ros.foundation.types import AnyArray, Table, UInt8Array
from simbev_ros.scene.legend import legend
from simbev_ros.schema.nuscenes import category_of_tag, point_labels
from simbev_ros.schema.points import POINT_DTYPE, SEMANTIC_POINT_DTYPE
from simbev_ros.schema.scene.state import ACTOR_DTYPE, EGO_ID

LABELS = point_labels()
NOISE = LABELS["noise"]
TABLES = "v1.0-trainval"


def cloud_of(points_m: AnyArray, dtype: np.dtype[Any]) -> Table:
    cloud = np.zeros(len(points_m), dtype)
    cloud["x"], cloud["y"], cloud["z"] = points_m.T
    return cloud


def test_points_find_their_rays_whatever_is_lost_noisy_or_in_the_air() -> None:
    rng, sigma_m = np.random.default_rng(5), 0.02
    azimuth, elevation = np.meshgrid(np.linspace(-np.pi, np.pi, 512, endpoint=False), np.linspace(-0.5, 0.2, 32))
    rays = np.stack([np.cos(elevation) * np.cos(azimuth), np.cos(elevation) * np.sin(azimuth), np.sin(elevation)], -1)
    rays = rays.reshape(-1, 3)
    range_m = rng.uniform(1, 100, len(rays))
    label = rng.integers(1, 30, len(rays)).astype(np.uint8)
    is_hit = rng.random(len(rays)) < 0.9
    is_received, is_air = rng.random(len(rays)) < 0.8, rng.random(len(rays)) < 0.1
    measured_m = np.where(is_air, 0.5 * range_m, range_m + rng.normal(0, sigma_m, len(rays)))
    is_there = is_received & (is_hit | is_air)
    expected = np.where(is_hit & ~is_air, label, NOISE)[is_there]
    order = rng.permutation(is_there.sum())
    found = labels_of_points(
        cloud_of((rays * measured_m[:, None])[is_there][order], POINT_DTYPE),
        cloud_of((rays * range_m[:, None])[is_hit], SEMANTIC_POINT_DTYPE),
        label[is_hit],
        sigma_m,
    )
    assert found.dtype == np.uint8 and 1000 < (expected == NOISE).sum() < 0.3 * len(expected)
    np.testing.assert_array_equal(found, expected[order])


def test_points_without_a_direction_or_a_semantic_cloud_are_noise() -> None:
    points, semantic = cloud_of(np.zeros((2, 3)), POINT_DTYPE), cloud_of(np.ones((1, 3)), SEMANTIC_POINT_DTYPE)
    label = np.array([7], np.uint8)
    assert labels_of_points(points, semantic, label, 0.01).tolist() == [NOISE] * 2
    assert labels_of_points(points, semantic[:0], label[:0], 0.01).tolist() == [NOISE] * 2
    assert labels_of_points(points[:0], semantic, label, 0.01).tolist() == []


def surface_labels(*rows: tuple[int, Tag]) -> list[str]:
    """Names of the labels of points on objects with ids and tags, in a scene with some actors."""
    blueprints = legend()["blueprints"]
    number = {each["name"]: index for index, each in enumerate(blueprints)}
    actors = np.zeros(7, ACTOR_DTYPE)
    actors["id"] = [9, 1, 2, 3, 4, 5, 6]
    kinds = ["rider.bicycle", "vehicle.sedan", "vehicle.bicycle", "vehicle.pickup", "pedestrian.child"]
    actors["blueprint"] = [*(number[name] for name in [*kinds, "prop.sign_works"]), len(blueprints)]
    actors["tag"] = [Tag.RIDER, Tag.CAR, Tag.BICYCLE, Tag.CAR, Tag.PEDESTRIAN, Tag.TRAFFIC_SIGN, Tag.BUS]
    actors["parent"][0] = 2
    cloud = np.zeros(len(rows), SEMANTIC_POINT_DTYPE)
    cloud["object_id"], cloud["tag"] = zip(*rows, strict=True)
    names = list(LABELS)
    return [names[label] for label in labels_of_surfaces(cloud, actors, blueprints, EGO_ID).tolist()]


def test_surfaces_have_the_category_of_their_tag_or_actor() -> None:
    assert surface_labels((0, Tag.ROAD), (0, Tag.ROAD_LINE), (0, Tag.VEGETATION), (0, Tag.CAR)) == [
        "flat.driveable_surface",
        "flat.driveable_surface",
        "static.vegetation",
        "vehicle.car",
    ]
    assert surface_labels((1, Tag.CAR), (3, Tag.CAR), (4, Tag.PEDESTRIAN), (5, Tag.TRAFFIC_SIGN)) == [
        "vehicle.ego",
        "vehicle.truck",
        "human.pedestrian.child",
        "static.manmade",
    ]
    assert surface_labels((9, Tag.RIDER), (2, Tag.BICYCLE)) == ["vehicle.bicycle"] * 2, "riders belong to their vehicle"
    assert surface_labels((6, Tag.BUS), (77, Tag.TRUCK)) == ["vehicle.bus.rigid", "vehicle.truck"], "unknown actors"


def test_every_tag_has_a_label_and_every_label_a_category() -> None:
    assert {category_of_tag(tag) for tag in Tag} <= set(LABELS)
    index = {record["name"]: record["index"] for record in taxonomy_tables(lidarseg=True)["category"]}
    assert index == LABELS and list(LABELS.values()) == list(range(32))
    plain = taxonomy_tables()["category"]
    assert [{**each, "index": LABELS[each["name"]]} for each in plain] == taxonomy_tables(lidarseg=True)["category"][
        :24
    ]


def labels_of(out: Path) -> dict[str, UInt8Array]:
    """Labels by token of the lidar's data, read as the devkit does."""
    records = json.loads((out / TABLES / "lidarseg.json").read_text())
    assert {record["filename"] for record in records} == {
        str(path.relative_to(out)) for path in (out / "lidarseg" / TABLES).iterdir()
    }
    return {each["sample_data_token"]: np.fromfile(out / each["filename"], np.uint8) for each in records}


def test_every_sample_has_a_label_for_each_point_of_the_lidar(nuscenes_folder: Path) -> None:
    out = nuscenes_folder / "out"
    rows = json.loads((out / TABLES / "sample_data.json").read_text())
    samples = [each for each in rows if each["is_key_frame"] and "/LIDAR_TOP/" in each["filename"]]
    labels = labels_of(out)
    assert set(labels) == {each["token"] for each in samples} and len(samples) == 3 + 2
    for each in samples:
        assert len(labels[each["token"]]) == (out / each["filename"]).stat().st_size // 20 == 200


def test_an_export_without_labels_gets_them_and_nothing_else_is_made_again(tmp_path: Path) -> None:
    made_up_scene(tmp_path / "set/scenes/train/Blocks-0000")
    export(tmp_path / "set", tmp_path / "out", lidarseg=False)
    before = digest(tmp_path / "out")
    assert not (tmp_path / "out/lidarseg").exists() and f"{TABLES}/lidarseg.json" not in before
    exported = export(tmp_path / "set", tmp_path / "out")
    assert exported.made == 0 and exported.unlabeled == {} and len(labels_of(tmp_path / "out")) == 1
    after = digest(tmp_path / "out")
    changed = {path for path in after if after[path] != before.get(path)}
    assert {path.split("/")[0] for path in changed - {f"{TABLES}/lidarseg.json"}} == {"lidarseg", ".parts", TABLES}
    assert before.keys() <= after.keys() and changed & before.keys() == {f"{TABLES}/category.json"}


@pytest.mark.slow
def test_labels_of_a_replaced_scene_are_replaced(tmp_path: Path) -> None:
    bag, out = tmp_path / "set/scenes/train/Blocks-0000", tmp_path / "out"
    made_up_scene(bag, ticks=21)
    export(tmp_path / "set", out)
    assert len(labels_of(out)) == 3
    bag.rename(tmp_path / "old")
    made_up_scene(bag, number=5, ticks=2)
    export(tmp_path / "set", out)
    assert len(labels_of(out)) == 1, "files of the old scene's tokens are gone"


@pytest.mark.parametrize(
    ("sensors", "reason"),
    [
        ([SENSORS[0], {**SENSORS[2], "semantic_points": False}], "lidar/semantic_points was not recorded"),
        ([SENSORS[0]], "it has no lidar, without which the devkit cannot evaluate detections either"),
    ],
)
def test_a_scene_without_a_semantic_cloud_has_no_labels(
    tmp_path: Path, sensors: list[dict[str, Any]], reason: str
) -> None:
    made_up_scene(tmp_path / "set/scenes/train/Blocks-0000", sensors=sensors)
    words = ["export", "nuscenes", str(tmp_path / "set"), "--out", str(tmp_path / "out")]
    result = CliRunner().invoke(app, words)
    assert result.exit_code == 0, result.output
    assert f"1 scene without categories of lidar points: {reason}" in result.output
    assert not (tmp_path / "out/lidarseg").exists() and not (tmp_path / "out" / TABLES / "lidarseg.json").exists()
    category = json.loads((tmp_path / "out" / TABLES / "category.json").read_text())
    assert category == taxonomy_tables()["category"]
    assert "categories of lidar points" not in CliRunner().invoke(app, [*words, "--no-lidarseg"]).output


def test_a_lidar_with_only_a_semantic_cloud_is_exported_with_its_labels(tmp_path: Path) -> None:
    sensors = [{**SENSORS[2], "points": False}]
    made = made_up_scene(tmp_path / "set/scenes/train/Blocks-0000", sensors=sensors)
    assert export(tmp_path / "set", tmp_path / "out").unlabeled == {}
    (labels,) = labels_of(tmp_path / "out").values()
    first = made.ticks[0]
    expected = labels_of_surfaces(first["lidar/semantic_points"], first["world/actors"], legend()["blueprints"], EGO_ID)
    np.testing.assert_array_equal(labels, expected)


@pytest.mark.parametrize("version", ["../x", "a/b", "", ".parts", "samples", "lidarseg"])
def test_a_version_that_is_no_name_of_a_folder_is_refused(tmp_path: Path, version: str) -> None:
    made_up_scene(tmp_path / "set/scenes/train/Blocks-0000")
    words = ["export", "nuscenes", str(tmp_path / "set"), "--out", str(tmp_path / "out"), "--version", version]
    result = CliRunner().invoke(app, words)
    assert result.exit_code == 2 or "cannot be the name" in str(result.exception)
    assert not (tmp_path / "out").exists()
