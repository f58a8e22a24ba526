"""A cache holds what the dataset's reader gives, in the level frame, and is written again when a bag changes."""

import shutil
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow.parquet as pq
import pytest
from made_up_scene import MadeUp, made_up_scene, made_up_spec, record_made_up
from scipy.spatial.transform import Rotation
from several_agents import car, with_agents

from simbev_ros.baselines.boxes import BOX_DTYPE, DETECTED_CLASSES
from simbev_ros.baselines.grid import CELLS
from simbev_ros.baselines.inference import Answer, Baseline
from simbev_ros.baselines.modality import Modality
from simbev_ros.baselines.model_file import model_file
from simbev_ros.dataset.index import update_index
from simbev_ros.dataset.parallel import Processes
from simbev_ros.foundation.errors import InputError
from simbev_training.cache.reader import cached_scenes
from simbev_training.cache.writer import write_cache
from simbev_training.predict import predict

CAMERA = {"type": "camera", "width_px": 32, "height_px": 16, "modalities": ["rgb", "depth"]}
SENSORS: list[dict[str, Any]] = [
    {**CAMERA, "name": "front", "pose": {"x_m": 0.6, "z_m": 1.6}},
    {**CAMERA, "name": "left", "pose": {"z_m": 1.6, "yaw_deg": 90}},
    {"type": "lidar", "name": "lidar", "pose": {"x_m": 0.5, "z_m": 1.8, "yaw_deg": 30}},
]
TICKS = 7


class StandingCar:
    """A model that finds the same car in every frame."""

    modality, sweep_ages_ns = Modality.LIDAR, (0,)

    def answer(self, *_: Any) -> Answer:
        boxes = np.zeros(1, BOX_DTYPE)
        boxes["score"], boxes["length"] = 0.9, 4.0
        return Answer(np.zeros((CELLS, CELLS, 14), np.uint8), boxes)


def fill(dataset: Path, cache: Path, modality: Modality = Modality.FUSED, agent: str | None = None) -> tuple[int, int]:
    """Index the dataset and write its cache; return the last report."""
    update_index(dataset, sorted(dataset.glob("scenes/train/*")))
    return [*write_cache(dataset, cache, Processes(1), modality, agent=agent)][-1]


def make(dataset: Path, number: int = 0, **options: Any) -> MadeUp:
    folder = dataset / f"scenes/train/Blocks-{0:04d}"
    return made_up_scene(folder, number=number, ticks=TICKS, **{"sensors": SENSORS, "grid": (360, 360), **options})


@pytest.fixture(scope="module")
def made_and_cache(tmp_path_factory: pytest.TempPathFactory) -> tuple[MadeUp, Path]:
    folder = tmp_path_factory.mktemp("cached")
    made = make(folder / "set")
    assert fill(folder / "set", folder / "cache") == (1, 1)
    return made, folder / "cache"


def test_points_of_earlier_sweeps_are_in_the_level_frame_of_the_newest(made_and_cache: tuple[MadeUp, Path]) -> None:
    made, cache = made_and_cache
    sample = cached_scenes(cache, "train")[0].sample(TICKS - 1, (0, 250_000_000))
    (x, y, z), (_, _, heading_rad) = made.ticks[-1]["odom"]
    level_from_map = Rotation.from_euler("z", -heading_rad)
    points = sample.points()
    for sweep, tick in enumerate((TICKS - 1, TICKS - 6)):
        cloud = made.ticks[tick]["lidar/points"]
        turned = Rotation.from_euler("z", np.radians(30)).apply(np.stack([cloud[a] for a in "xyz"], 1))
        place, rpy_rad = made.ticks[tick]["odom"]
        in_map = Rotation.from_euler("xyz", rpy_rad).apply(turned + np.array([0.5, 0, 1.8])) + place
        wanted = level_from_map.apply(in_map - [x, y, z])
        assert points[points[:, 3] == sweep, :3] == pytest.approx(wanted, abs=0.02)  # rounded to cm before it is turned


def test_grids_depths_and_images_are_those_of_the_frame(made_and_cache: tuple[MadeUp, Path]) -> None:
    made, cache = made_and_cache
    sample = cached_scenes(cache, "train")[0].sample(3, (0,))
    values = made.ticks[3]
    assert np.array_equal(sample.cells, values["bev/labels"])
    for camera, name in enumerate(("front", "left")):
        patches = values[f"{name}/depth"].reshape(2, 8, 4, 8)
        nearest = patches.min((1, 3))
        assert sample.depth_m[camera] == pytest.approx(np.where(nearest < 655, nearest, 0), abs=0.01)
        assert np.abs(sample.images()[camera].astype(int) - values[f"{name}/rgb"]).mean() < 2.0  # JPEG


def test_boxes_are_in_the_level_frame(made_and_cache: tuple[MadeUp, Path]) -> None:
    made, cache = made_and_cache
    boxes = cached_scenes(cache, "train")[0].sample(2, (0,)).boxes
    table = made.ticks[2]["boxes"]
    table = table[table["class"] < len(DETECTED_CLASSES)]
    place, (_, _, heading_rad) = made.ticks[2]["odom"]
    turn = Rotation.from_euler("z", -heading_rad)
    assert len(boxes) == len(table)
    center = turn.apply(np.stack([table[a] for a in "xyz"], 1) - place)
    assert np.stack([boxes[a] for a in "xyz"], 1) == pytest.approx(center, abs=1e-4)
    velocity = turn.apply(np.stack([table[a] for a in ("vx", "vy", "vz")], 1))
    assert np.stack([boxes["vx"], boxes["vy"]], 1) == pytest.approx(velocity[:, :2], abs=1e-4)
    turned = np.exp(1j * (boxes["yaw"] - table["yaw"] + heading_rad))
    assert turned == pytest.approx(np.ones(len(boxes)), abs=1e-5)


def test_a_scene_that_was_made_again_is_written_again(tmp_path: Path) -> None:
    make(tmp_path / "set")
    fill(tmp_path / "set", tmp_path / "cache")
    file = tmp_path / "cache/train/Blocks-0000/scene.json"
    written = file.stat().st_mtime_ns
    fill(tmp_path / "set", tmp_path / "cache")
    assert file.stat().st_mtime_ns == written
    shutil.rmtree(tmp_path / "set/scenes/train/Blocks-0000")
    again = make(tmp_path / "set", sensors=[*SENSORS, {"type": "gnss", "name": "gnss"}])
    fill(tmp_path / "set", tmp_path / "cache")
    sample = cached_scenes(tmp_path / "cache", "train")[0].sample(0, (0,))
    assert np.array_equal(sample.cells, again.ticks[0]["bev/labels"])


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"grid": (20, 24)}, "annotation.bev: the baselines need 360 x 360 cells of 0.4 m"),
        ({"sensors": SENSORS[:2]}, "has no lidar/points; the baselines need bev/labels"),
        ({"sensors": [{**SENSORS[0], "height_px": 24}, SENSORS[2]]}, "camera front: has 32 x 24 pixels"),
        ({"sensors": SENSORS[2:]}, "has no camera with the modalities rgb and depth"),
    ],
)
def test_scenes_that_do_not_suit_the_baselines_are_refused(tmp_path: Path, options: Any, message: str) -> None:
    make(tmp_path / "set", **options)
    with pytest.raises(InputError, match=message):
        fill(tmp_path / "set", tmp_path / "cache")


@pytest.mark.parametrize("cameras", [[{**SENSORS[0], "height_px": 24}], [{**SENSORS[0], "modalities": ["rgb"]}], []])
def test_a_lidar_baseline_looks_at_the_lidar_alone(tmp_path: Path, cameras: list[dict[str, Any]]) -> None:
    pytest.importorskip("onnxruntime", reason="baselines need it: ./simbev setup baselines")
    make(tmp_path / "set", sensors=[*cameras, SENSORS[2]])
    assert fill(tmp_path / "set", tmp_path / "cache", Modality.LIDAR) == (1, 1)
    (scene,) = cached_scenes(tmp_path / "cache", "train")
    assert len(scene.frames) == TICKS
    assert len(scene.sample(0, (0,)).points()) > 100
    predict(Baseline(model_file("lidar")), [scene], tmp_path / "predictions", lambda _: None, every=TICKS)
    assert "id" not in pq.read_schema(tmp_path / "predictions/boxes.parquet").names
    with pytest.raises(InputError, match="camera"):
        fill(tmp_path / "set", tmp_path / "cache", Modality.FUSED)


def test_tracked_predictions_have_ids(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    make(tmp_path / "set", sensors=[SENSORS[2]])
    fill(tmp_path / "set", tmp_path / "cache", Modality.LIDAR)
    scenes = cached_scenes(tmp_path / "cache", "train")
    monkeypatch.setattr("simbev_training.predict.boxes_in_map", lambda boxes, pose: boxes)
    predict(StandingCar(), scenes, tmp_path / "predictions", lambda _: None, tracks=True)  # type: ignore[arg-type]
    table = pq.read_table(tmp_path / "predictions/boxes.parquet")
    assert table["tick"].to_pylist() == [*range(TICKS)] and table["id"].to_pylist() == [1] * TICKS


def test_a_cache_of_another_agent_has_what_it_sees_and_replaces_the_first_agents(tmp_path: Path) -> None:
    spec = made_up_spec(SENSORS, number=1, ticks=TICKS, grid=(360, 360))
    labels = spec.agents[0].annotation.model_dump(mode="json")
    made = record_made_up(
        tmp_path / "set/scenes/train/Blocks-0001", with_agents(spec, car("car", 1, SENSORS, annotation=labels))
    )
    for agent, ticks in ((None, made.ticks), ("car", made.others["car"])):
        assert fill(tmp_path / "set", tmp_path / "cache", agent=agent) == (1, 1)
        (scene,) = cached_scenes(tmp_path / "cache", "train")
        np.testing.assert_allclose(scene.frames["map_from_ego"][:, :3, 3], [tick["odom"][0] for tick in ticks])
    with pytest.raises(InputError, match="agent: no scene has 'bus', but car, ego"):
        fill(tmp_path / "set", tmp_path / "cache", agent="bus")
