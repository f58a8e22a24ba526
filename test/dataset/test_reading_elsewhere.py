"""Reading without the simulation's dependencies, in other processes, and with torch."""

import inspect
import json
import multiprocessing
import subprocess
import sys
import types
from importlib.util import find_spec
from pathlib import Path
from runpy import run_path
from typing import Any

import numpy as np
import pytest
import recorded_scene as written
from typer.testing import CliRunner

import simbev_ros.dataset
from simbev_ros.dataset import open_dataset
from simbev_ros.foundation.types import Float64Array
from tools.bench.cli.group import bench

KEYS = ("cam_front/rgb", "cam_front/instance", "lidar/points", "boxes")


@pytest.fixture(scope="module")
def path(tmp_path_factory: pytest.TempPathFactory) -> Path:
    dataset = tmp_path_factory.mktemp("elsewhere") / "datasets/first"
    written.record(dataset / "scenes/train/Blocks-0000", written.spec())
    return dataset


WITHOUT = """
import sys
BLOCKED = {"rclpy", "moderngl", "open3d", "libsumo", "torch", "sensor_msgs", "std_msgs", "nav_msgs"}
class Absent:
    def find_spec(self, name, path=None, target=None):
        if name.partition(".")[0] in BLOCKED:
            raise ModuleNotFoundError(name)
sys.meta_path.insert(0, Absent())
from simbev_ros.dataset import open_dataset
scene = open_dataset(sys.argv[1]).scenes[0]
frame = scene[3]
print(len(frame.load()), frame.futures(0.1).valid.shape, len(scene.constants))
assert not BLOCKED & {name.partition(".")[0] for name in sys.modules}
"""


def test_reading_needs_neither_ros_nor_graphics_nor_simulation(path: Path) -> None:
    run = subprocess.run([sys.executable, "-c", WITHOUT, str(path)], capture_output=True, text=True, check=False)
    assert run.stdout.split("\n")[0] == f"{len(open_dataset(path).scenes[0][3])} (2, 2) 2", run.stderr


def test_the_example_in_the_documentation_works(path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    text = inspect.getdoc(simbev_ros.dataset) or ""
    example = text.partition("::\n\n")[2].partition("\n\n``list(frame)``")[0]
    monkeypatch.chdir(path.parents[1])
    names: dict[str, Any] = {}
    exec(inspect.cleandoc("\n" + example), names)
    assert names["image"].shape == (written.HEIGHT, written.WIDTH, 3)
    assert names["points_map"].shape == (26, 3)
    # By hand: the camera is 1 m ahead of the ego's origin and 2 m above it, and looks left; the ego is at (2, 2, 0.5).
    car_optical = _rotated([1.0, 20.0, 1.0], -0.2, [2.0, 2.0, 0.5]) - [1.0, 0.0, 2.0]
    assert car_optical[1] > 0
    camera = open_dataset(path).scenes[0].calibration["cam_front"].camera
    assert camera is not None
    expected = camera.project(np.array([[car_optical[0], -car_optical[2], car_optical[1]]]))
    np.testing.assert_allclose(names["pixels"][0], expected[0], atol=1e-9)


def _rotated(point: list[float], angle_rad: float, origin: list[float]) -> Float64Array:
    x, y, z = np.array(point) - origin
    cos, sin = np.cos(angle_rad), np.sin(angle_rad)
    return np.array([cos * x - sin * y, sin * x + cos * y, z])


def _sums(scene: Any, tick: int) -> list[int]:
    return [
        int(np.asarray(scene[tick].load(KEYS)[key]).view(np.uint8).sum()) for key in ("cam_front/rgb", "lidar/points")
    ]


@pytest.mark.filterwarnings("ignore:This process .* is multi-threaded:DeprecationWarning")
def test_forked_processes_read_with_threads_and_a_cache_of_their_own(path: Path) -> None:
    scene = open_dataset(path, threads=2).scenes[0]
    expected = [_sums(scene, tick) for tick in range(written.TICKS)]
    with multiprocessing.get_context("fork").Pool(2) as pool:
        found = pool.starmap_async(_sums, [(scene, tick) for tick in range(written.TICKS)]).get(60)
        pool.close()  # its processes end by themselves: they may have inherited a handler of SIGTERM
        pool.join()
    assert found == expected


def test_the_bench_times_both_orders(path: Path) -> None:
    result = CliRunner().invoke(bench, ["reading", str(path), "--frames", "3", "--json"])
    assert result.exit_code == 0, result.output
    timing = json.loads(result.stdout)
    assert (timing["scene"], timing["frames"]) == ("Blocks-0000", 3)
    assert [access["order"] for access in timing["accesses"]] == ["in order", "at random"]
    assert all(0 < access["least_s"] <= access["median_s"] for access in timing["accesses"])


def torch_stub() -> types.ModuleType:
    """A replacement for torch with only what ``FrameDataset`` uses."""
    torch, utils, data = (types.ModuleType(name) for name in ("torch", "torch.utils", "torch.utils.data"))
    data.Dataset = type("Dataset", (), {"__class_getitem__": classmethod(lambda cls, _: cls)})  # type: ignore[attr-defined]
    data.get_worker_info = lambda: None  # type: ignore[attr-defined]
    torch.Tensor, torch.from_numpy, torch.stack = np.ndarray, lambda array: array, np.stack  # type: ignore[attr-defined]
    torch.utils, utils.data = utils, data  # type: ignore[attr-defined]
    return torch


def test_samples_and_batches_with_a_stub_of_torch(path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    torch = torch_stub()
    for name, module in {"torch": torch, "torch.utils": torch.utils, "torch.utils.data": torch.utils.data}.items():
        monkeypatch.setitem(sys.modules, name, module)
    origin = find_spec("simbev_ros.dataset.torch_dataset")
    assert origin is not None and origin.origin is not None
    FrameDataset = run_path(origin.origin)["FrameDataset"]
    frames = open_dataset(path).frames(keys=KEYS)
    data = FrameDataset(
        frames, KEYS, {"lidar/points": ["x", "z"]}, lambda sample: {**sample, "twice": 2 * sample["tick"]}
    )
    assert len(data) == written.TICKS
    sample = data[2]
    assert sample["lidar/points"].shape == (26, 2)
    assert sample["cam_front/instance"].dtype == np.int32
    assert sample["boxes"]["id"].dtype == np.int64
    assert (sample["scene"], sample["tick"], sample["twice"]) == ("Blocks-0000", 2, 4)
    batch = data.collate([data[1], data[2]])
    assert batch["cam_front/rgb"].shape == (2, written.HEIGHT, written.WIDTH, 3)
    assert [len(points) for points in batch["lidar/points"]] == [23, 26]
    assert [list(boxes["x"]) for boxes in batch["boxes"]] == [[0.5, 3.0], [1.0, 3.0]]
    assert batch["map_from_ego"].shape == (2, 4, 4)
    assert batch["stamp_ns"] == [frames[1].stamp_ns, frames[2].stamp_ns]


@pytest.mark.filterwarnings("ignore:This process .* is multi-threaded:DeprecationWarning")
@pytest.mark.parametrize("workers", [0, 2])
def test_a_torch_loader_gives_every_frame_once(path: Path, workers: int) -> None:
    torch = pytest.importorskip("torch")
    from simbev_ros.dataset.torch_dataset import FrameDataset

    data = FrameDataset(open_dataset(path).frames(keys=KEYS), KEYS, {"lidar/points": ["x", "y", "z"]})
    loader = torch.utils.data.DataLoader(data, 2, shuffle=True, num_workers=workers, collate_fn=data.collate)
    batches = list(loader)
    assert sorted(tick for batch in batches for tick in batch["tick"]) == list(range(written.TICKS))
    for batch in batches:
        for index, tick in enumerate(batch["tick"]):
            assert batch["lidar/points"][index][:, 1].tolist() == written.points(tick)["y"].tolist()
            assert (batch["cam_front/instance"][index].numpy() == written.pixels("mono16", tick)).all()
