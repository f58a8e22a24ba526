"""Tests that boxes are as nuScenes annotates them: of one size, with riders, hit by a sensor, turned without jumps."""

from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from made_up_scene import made_up_scene
from nuscenes_tables import export, tables_of

from simbev_ros.dataset.nuscenes.annotated_boxes import annotated_boxes
from simbev_ros.foundation.geometry.transforms import apply, inverse, matrices_from_xyz_rpy
from simbev_ros.foundation.types import Float64Array, Table
from simbev_ros.scene.blueprints import blueprint_index, blueprint_named
from simbev_ros.schema.boxes import blank_boxes
from simbev_ros.schema.scene.state import ACTOR_DTYPE, map_from_actors


class Frame(dict[str, Any]):
    """A frame of which no clouds were recorded."""

    scene = SimpleNamespace(view=SimpleNamespace(rig=SimpleNamespace(of_type=lambda kind: [])), sources={})


def actors(*names: str) -> Table:
    """One actor of each blueprint, at the origin."""
    rows = np.zeros(len(names), ACTOR_DTYPE)
    rows["id"] = 2 + np.arange(len(names))
    rows["blueprint"] = [blueprint_index()[name] for name in names]
    for row, name in zip(rows, names, strict=True):
        row["length"], row["width"], row["height"] = blueprint_named(name).size_m
    return rows


def boxes(*ids: int, **values: float) -> Table:
    rows = blank_boxes(len(ids))
    rows["id"] = ids
    for name, value in values.items():
        rows[name] = value
    return rows


def center_m(rows: Table) -> Float64Array:
    return np.stack([rows["x"], rows["y"], rows["z"]], axis=1)


def test_a_walker_has_one_size_and_the_velocity_of_its_centers() -> None:
    found = []
    for tick, stride_m in enumerate((0.42, 0.69, 1.1)):
        walker = actors("pedestrian.man")
        walker["x"], walker["yaw"] = 0.07 * tick, 0.0
        bent = boxes(2, x=0.07 * tick + 0.1 * stride_m, length=stride_m, width=0.5, height=1.7, z=0.85)
        found.append(annotated_boxes(Frame({"boxes": bent, "world/actors": walker})))
    length_m, width_m, height_m = blueprint_named("pedestrian.man").size_m
    for each in found:
        sizes_m = [float(each[name][0]) for name in ("length", "width", "height")]
        assert sizes_m == pytest.approx([length_m, width_m, height_m])
    np.testing.assert_allclose(np.diff(np.concatenate([center_m(each) for each in found]), axis=0), [[0.07, 0, 0]] * 2)


def test_the_box_of_a_ridden_bicycle_contains_the_rider() -> None:
    rows = actors("vehicle.bicycle", "rider.bicycle", "vehicle.bicycle")
    pose = matrices_from_xyz_rpy(np.array([10.0, -5.0, 0.2]), np.array([0.2, -0.03, 2.5]))
    seat_m = apply(pose, np.array([blueprint_named("vehicle.bicycle").rider_seat_m]))[0]
    for row, at_m in zip(rows, (pose[:3, 3], seat_m, [90, 90, 0]), strict=True):
        row["x"], row["y"], row["z"] = at_m
        row["roll"], row["pitch"], row["yaw"] = 0.2, -0.03, 2.5
    rows["parent"][1] = 2
    ridden, parked = annotated_boxes(
        Frame({"boxes": boxes(2, 4, roll=0.2, pitch=-0.03, yaw=2.5), "world/actors": rows})
    )
    size_m = np.array([ridden[name] for name in ("length", "width", "height")], np.float64)
    map_from_box = matrices_from_xyz_rpy(center_m(ridden[None])[0], np.array([0.2, -0.03, 2.5]))
    for actor in rows[:2]:
        corners_m = np.array([[x, y, z] for x in (-0.5, 0.5) for y in (-0.5, 0.5) for z in (0, 1)])
        corners_m *= [actor["length"], actor["width"], actor["height"]]
        corners_box_m = apply(inverse(map_from_box) @ map_from_actors(actor[None])[0], corners_m)
        assert (np.abs(corners_box_m) <= size_m / 2 + 1e-5).all()
    rider_top_m = blueprint_named("vehicle.bicycle").rider_seat_m[2] + blueprint_named("rider.bicycle").size_m[2]
    assert size_m[2] == pytest.approx(rider_top_m, abs=1e-5)
    assert parked["height"] == pytest.approx(blueprint_named("vehicle.bicycle").size_m[2])


def test_boxes_that_nothing_hits_are_left_out_unless_nothing_was_received() -> None:
    rows = boxes(2, 3, 4, 5)
    rows["lidar_points"], rows["radar_points"] = [0, 0, 3, -1], [-1, 1, 0, -1]
    frame = Frame({"boxes": rows, "world/actors": actors(*["vehicle.sedan"] * 4)})
    assert annotated_boxes(frame)["id"].tolist() == [3, 4, 5]
    assert annotated_boxes(frame, keep_unhit=True)["id"].tolist() == [2, 3, 4, 5]


def test_an_export_has_all_boxes_if_they_are_asked_for(nuscenes_folder: Path, tmp_path: Path) -> None:
    hit = tables_of(nuscenes_folder / "out")["sample_annotation"]
    assert hit and all(each["num_lidar_pts"] + each["num_radar_pts"] > 0 for each in hit)
    export(nuscenes_folder / "set", tmp_path, keep_unhit=True, sweeps=False, map_expansion=False)
    every = tables_of(tmp_path)["sample_annotation"]
    assert {each["token"] for each in hit} < {each["token"] for each in every}
    assert len(every) == 12 * (3 + 2), "twelve boxes in each sample of two scenes"


def test_quaternions_do_not_jump(tmp_path: Path) -> None:
    made_up_scene(tmp_path / "set/scenes/train/Blocks-0000", ticks=60)  # the heading turns by 0.1 rad in each frame
    export(tmp_path / "set", tmp_path / "out", map_expansion=False, keyframe_hz=None)
    tables = tables_of(tmp_path / "out")
    poses = sorted(tables["ego_pose"], key=lambda each: each["timestamp"])
    turns = np.array([each["rotation"] for each in poses])
    assert len(turns) == 60 and (np.einsum("ni,ni->n", turns[1:], turns[:-1]) > 0.9).all()
    annotations = {each["token"]: each for each in tables["sample_annotation"]}
    for each in annotations.values():
        if each["prev"]:
            assert np.dot(each["rotation"], annotations[each["prev"]]["rotation"]) >= 0
        else:
            assert each["rotation"][0] >= 0
    assert all(each["rotation"][0] >= 0 for each in tables["calibrated_sensor"])
