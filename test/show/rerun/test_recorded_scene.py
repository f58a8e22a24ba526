"""A recorded scene as a file for Rerun, read back with Rerun's own reader and compared with the bag."""

import re
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from made_up_scene import SENSORS, TICK_NS, MadeUp, made_up_scene, made_up_spec
from typer.testing import CliRunner

pytest.importorskip("rerun", reason="Rerun is not installed: pip install -e .[view]")
from rerun_file import Row, rows_by_entity

from simbev_ros.cli.main import app
from simbev_ros.dataset.opened import open_dataset
from simbev_ros.foundation.geometry.transforms import matrices_from_xyz_rpy
from simbev_ros.foundation.semantics import BEV_CLASSES, BOX_CLASSES
from simbev_ros.foundation.types import Float64Array
from simbev_ros.schema.scene.agents import agent_view
from simbev_ros.show.rerun.blueprint import scene_blueprint
from simbev_ros.show.rerun.ego import EgoDrawing
from simbev_ros.show.rerun.recorded import ScenePlayer
from simbev_ros.show.rerun.scene_log import SceneLog
from simbev_ros.show.rerun.subject import Detail, Subject

TICKS = 5
Rows = dict[str, list[Row]]
SHAPES = ("Points", "LineStrips", "Boxes", "Geo")


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, MadeUp]:
    """A bag, and what is in it."""
    path = tmp_path_factory.mktemp("recorded") / "Blocks-0000"
    return path, made_up_scene(path, ticks=TICKS)


@pytest.fixture(scope="module")
def shown(made: tuple[Path, MadeUp]) -> Rows:
    """Rows of the file that ``simbev view`` makes of the bag, without a warning."""
    rows, output = written(made[0])
    assert "warning" not in output, "the bag is closed; that it has no trajectories is usual"
    return rows


def written(bag: Path, *options: str) -> tuple[Rows, str]:
    """Rows of the file that ``simbev view`` makes of a bag, and what it prints."""
    out = bag.parent / f"{bag.name}.rrd"
    result = CliRunner().invoke(app, ["view", str(bag), "--out", str(out), *options])
    assert result.exit_code == 0, result.output
    return rows_by_entity(out), result.output


def played(bag: Path, out: Path, detail: Detail) -> tuple[Rows, ScenePlayer]:
    """Rows of a scene with some detail."""
    scene = open_dataset(bag).scenes[0]
    with SceneLog(scene.view) as log:
        player = ScenePlayer(scene, log, detail)
        log.save(out, scene_blueprint(player.subject))
        player.play(lambda: None)
    return rows_by_entity(out), player


def ticks_of(rows: Sequence[Row]) -> list[int]:
    return [row.tick for row in rows if row.tick is not None]


def test_all_sensors_and_labels_are_there_at_each_of_their_ticks(shown: Rows) -> None:
    entities = [
        *(
            "world/ego",
            "plots/speed",
            "plots/acceleration/imu",
            "plots/turn_rate/imu",
            "gnss/gnss/fix",
            "bev/truth/all",
        ),
        *(f"world/ego/lidar/{coloring}" for coloring in ("height", "intensity", "ring", "class")),
        "world/ego/radar_front/doppler",
        *(f"world/boxes/{name}" for name in BOX_CLASSES),
        *(f"bev/truth/classes/{name}" for name in BEV_CLASSES),
        *(
            f"world/ego/{camera}/{modality}"
            for camera in ("cam_front", "cam_back_left")
            for modality in ("rgb", "semantic", "instance", "depth", "flow")
        ),
    ]
    assert all(ticks_of(shown[entity]) == [0, 1, 2, 3, 4] for entity in entities)
    assert ticks_of(shown["world/ego/occupancy"]) == [0, 2, 4], "at every second tick"
    assert "world/futures" not in shown, "the bag has no trajectories"


def test_time_is_the_simulated_time_from_zero(shown: Rows) -> None:
    assert [row.time_ns for row in shown["world/ego"]] == [tick * TICK_NS for tick in range(TICKS)]
    timed = [row for rows in shown.values() for row in rows if row.tick is not None]
    assert all(row.time_ns == row.tick * TICK_NS for row in timed if row.tick is not None)


def test_the_ego_moves_as_in_the_odometry(made: tuple[Path, MadeUp], shown: Rows) -> None:
    for tick, row in enumerate(shown["world/ego"]):
        expected = matrices_from_xyz_rpy(*made[1].ticks[tick]["odom"])
        (translation,), (rotation,) = row.values["Transform3D:translation"], row.values["Transform3D:mat3x3"]
        np.testing.assert_allclose(translation, expected[:3, 3], atol=1e-6)
        np.testing.assert_allclose(np.reshape(rotation, (3, 3)).T, expected[:3, :3], atol=1e-6)  # by columns


def test_boxes_are_those_of_the_bag(made: tuple[Path, MadeUp], shown: Rows) -> None:
    for label, name in enumerate(BOX_CLASSES):
        for tick, row in enumerate(shown[f"world/boxes/{name}"]):
            boxes = made[1].ticks[tick]["boxes"]
            boxes = boxes[boxes["class"] == label]
            centers, halves = ([boxes[each] for each in names] for names in ("xyz", ("length", "width", "height")))
            np.testing.assert_allclose(
                np.reshape(row.values["Boxes3D:centers"], (-1, 3)), np.stack(centers, axis=1), rtol=1e-5
            )
            np.testing.assert_allclose(
                2 * np.reshape(row.values["Boxes3D:half_sizes"], (-1, 3)), np.stack(halves, axis=1), rtol=1e-5
            )


def test_points_and_lines_have_sizes_of_the_screen_so_that_near_ones_cover_nothing(shown: Rows) -> None:
    drawn = {
        entity: row.values
        for entity, rows in shown.items()
        for row in rows
        if any(name.startswith(SHAPES) for name in row.values)
    }
    assert {"world/boxes/car", "world/ego/radar_front/doppler", "world/path"} <= drawn.keys()
    for entity, values in drawn.items():
        (radii,) = (value for name, value in values.items() if name.endswith(":radii"))
        assert all(-1.5 <= radius < 0 for radius in radii) or entity.startswith("gnss"), f"{entity}: Rerun's UI points"


def test_lidar_points_are_those_of_the_bag(made: tuple[Path, MadeUp], shown: Rows) -> None:
    for tick, row in enumerate(shown["world/ego/lidar/height"]):
        points = made[1].ticks[tick]["lidar/points"]
        expected = np.stack([points[axis] for axis in "xyz"], axis=1)
        np.testing.assert_array_equal(np.array(row.values["Points3D:positions"], np.float32), expected)


def test_without_layers_the_other_modalities_are_left_out(made: tuple[Path, MadeUp]) -> None:
    rows, _ = written(made[0], "--no-layers")
    assert "world/ego/cam_front/rgb" in rows and "world/ego/lidar/height" in rows
    assert not {"world/ego/cam_front/semantic", "world/ego/lidar/ring", "world/ego/occupancy"} & rows.keys()


def test_fewer_points_and_smaller_images_are_shown_if_that_is_asked(made: tuple[Path, MadeUp]) -> None:
    rows, _ = written(made[0], "--points", "50", "--image-width", "16")
    counts = {name: len(rows[f"world/ego/lidar/{name}"][0].values["Points3D:positions"]) for name in ("height", "ring")}
    assert counts == {"height": 50, "ring": 25}
    (optics,) = (row for row in rows["world/ego/cam_front"] if "Pinhole:resolution" in row.values)
    assert optics.values["Pinhole:resolution"] == [[16.0, 12.0]]


def test_a_limit_thins_out_large_samples_but_neither_boxes_nor_plots(made: tuple[Path, MadeUp], tmp_path: Path) -> None:
    with SceneLog(agent_view(made[1].spec)) as log:
        player = ScenePlayer(open_dataset(made[0]).scenes[0], log, Detail(layers=False))
        player.play(lambda: None)
        limit_bytes = log.size_bytes / 1.7
    thinned, player = played(made[0], tmp_path / "thinned.rrd", Detail(layers=False, limit_bytes=limit_bytes))
    assert player.every == 2
    large = ("world/ego/cam_front/rgb", "world/ego/lidar/height", "world/ego/radar_front/doppler", "bev/truth/all")
    assert [ticks_of(thinned[entity]) for entity in large] == [[0, 2, 4]] * len(large)
    small = ("world/ego", "plots/speed", "gnss/gnss/fix", "world/boxes/car")
    assert [ticks_of(thinned[entity]) for entity in small] == [list(range(TICKS))] * len(small)


@pytest.fixture
def in_chunks(tmp_path: Path) -> Path:
    """The only file of a bag whose ticks are in chunks of their own."""
    made_up_scene(tmp_path / "Blocks-0000", ticks=TICKS, chunk_bytes=20_000)
    (file,) = (tmp_path / "Blocks-0000").glob("*.mcap")
    return file


def chunk_of_tick(file: Path, tick: int) -> int:
    """Offset in a bag's file of the chunk with the lidar points of a tick."""
    scene = open_dataset(file.parent).scenes[0]
    return int(scene.sources["lidar/points"].topic.between(-1, scene[tick].stamp_ns)[-1, -2])


def test_a_bag_that_was_cut_off_is_shown_as_far_as_it_goes(in_chunks: Path) -> None:
    content = in_chunks.read_bytes()[: chunk_of_tick(in_chunks, 3)]
    in_chunks.write_bytes(content)
    (in_chunks.parent / "metadata.yaml").unlink()
    rows, output = written(in_chunks.parent)
    assert "warning: the bag was cut off; what it holds is shown" in output
    assert ticks_of(rows["world/ego/lidar/height"]) == [0, 1, 2]


def test_the_frames_before_a_damage_are_shown(in_chunks: Path) -> None:
    data = bytearray(in_chunks.read_bytes())
    data[chunk_of_tick(in_chunks, 3) + 9 + 60] ^= 1
    in_chunks.write_bytes(data)
    rows, output = written(in_chunks.parent)
    assert re.search(r"warning: .*damaged.*; the frames before are shown", output)
    assert ticks_of(rows["world/ego/lidar/height"]) == [0, 1, 2]


@pytest.mark.parametrize("max_width_px", [None, 16, 11])
def test_a_point_is_projected_to_the_same_pixel_as_by_the_calibration(max_width_px: int | None, tmp_path: Path) -> None:
    subject = Subject(agent_view(made_up_spec(SENSORS)), None, replace(Detail(), max_width_px=max_width_px))
    out = tmp_path / "ego.rrd"
    with SceneLog(subject.view) as log:
        log.save(out, scene_blueprint(subject))
        EgoDrawing(log, subject)
    rows = rows_by_entity(out)
    points_ego = np.array([(12.0, 1.0, 0.3), (7.0, -2.0, 2.0), (30.0, 4.0, 1.0)])
    for name in ("cam_front", "cam_back_left"):
        calibration = subject.calibration[name]
        yaw = np.deg2rad(calibration.sensor.pose.yaw_deg)
        turned = points_ego @ np.array([(np.cos(yaw), np.sin(yaw), 0), (-np.sin(yaw), np.cos(yaw), 0), (0, 0, 1)])
        points_optical = np.linalg.inv(calibration.ego_from_optical) @ np.column_stack([turned, np.ones(3)]).T
        expected_px = points_optical[:3].T @ calibration.intrinsics.T
        expected_px = (expected_px[:, :2] / expected_px[:, 2:] + 0.5) / subject.image_step(name)
        (row,) = rows[f"world/ego/{name}"]
        np.testing.assert_allclose(projected_by_rerun(row, turned), expected_px, atol=1e-3)


def projected_by_rerun(row: Row, points_parent: Float64Array) -> Float64Array:
    """(N, 2) pixels of (N, 3) points in the frame above a camera, by the camera as logged to Rerun."""
    (translation,), (rotation,) = row.values["Transform3D:translation"], row.values["Transform3D:mat3x3"]
    (matrix,) = row.values["Pinhole:image_from_camera"]
    assert row.values["Pinhole:camera_xyz"] == [[3, 2, 5]], "right, down, forward"
    points = (points_parent - translation) @ np.reshape(rotation, (3, 3)).T  # stored by columns; inverse = transposed
    pixels = points @ np.reshape(matrix, (3, 3))  # stored by columns
    assert (points[:, 2] > 0).all()
    return np.asarray(pixels[:, :2] / pixels[:, 2:])
