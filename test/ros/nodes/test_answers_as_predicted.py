"""The node of a baseline gives its model the same images and projections as predictions for the dataset do."""

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import rclpy
import simplejpeg
from made_up_scene import made_up_scene
from nav_msgs.msg import Odometry
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile
from ros_domain import DOMAIN
from sensor_msgs.msg import CompressedImage
from std_msgs.msg import Header, String
from waiting import wait_until

for package in ("torch", "onnx", "onnxruntime"):
    pytest.importorskip(package, reason=f"{package} is not installed")

from simbev_ros.baselines.inference import Answer, Baseline  # noqa: E402
from simbev_ros.baselines.modality import Modality  # noqa: E402
from simbev_ros.baselines.node.node import BaselineNode  # noqa: E402
from simbev_ros.dataset import open_dataset  # noqa: E402
from simbev_ros.dataset.index import update_index  # noqa: E402
from simbev_ros.dataset.parallel import Processes  # noqa: E402
from simbev_ros.ros.msgs.images import compressed_image_message  # noqa: E402
from simbev_ros.ros.msgs.stamps import header  # noqa: E402
from simbev_training.cache.reader import CachedScene, cached_scenes  # noqa: E402
from simbev_training.cache.writer import write_cache  # noqa: E402
from simbev_training.predict import predict  # noqa: E402

CAMERA = {"type": "camera", "width_px": 64, "height_px": 32, "modalities": ["rgb", "depth"], "rate_hz": 20}
SENSORS: list[dict[str, Any]] = [
    {**CAMERA, "name": "front", "pose": {"x_m": 0.6, "z_m": 1.6}},
    {**CAMERA, "name": "left", "pose": {"z_m": 1.6, "yaw_deg": 90}},
    {"type": "lidar", "name": "lidar", "pose": {"z_m": 1.8}},
]
TICKS, DROPPED = 4, 1
RELIABLE, LATCHED = QoSProfile(depth=16), QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)

pytestmark = pytest.mark.slow


class NotingBaseline(Baseline):
    """A baseline that notes what it is given and what it answers."""

    def __init__(self, path: Path) -> None:
        super().__init__(path)
        self.given: list[tuple[Any, Any]] = []
        self.answers: list[Answer] = []

    def answer(self, points: Any = None, images: Any = None, pixel_from_level: Any = None) -> Answer:
        """The answer, which is noted."""
        self.given.append((images.copy(), pixel_from_level.copy()))
        self.answers.append(super().answer(points, images, pixel_from_level))
        return self.answers[-1]


@pytest.fixture
def dataset(tmp_path: Path) -> Path:
    """A dataset of one scene whose images have another gray in each frame, in its cache."""
    made_up_scene(tmp_path / "set/scenes/train/Blocks-0000", ticks=TICKS, sensors=SENSORS, grid=(360, 360))
    update_index(tmp_path / "set", sorted((tmp_path / "set").glob("scenes/train/*")))
    assert [*write_cache(tmp_path / "set", tmp_path / "cache", Processes(1), Modality.CAMERA)][-1] == (1, 1)
    folder = cached_scenes(tmp_path / "cache", "train")[0].folder
    jpegs = [gray_jpeg(20 * tick + 10 * camera + 20) for tick in range(TICKS) for camera in range(2)]
    np.save(folder / "images.npy", np.frombuffer(b"".join(jpegs), np.uint8))
    np.save(folder / "image_ends.npy", np.cumsum([len(each) for each in jpegs]).reshape(TICKS, 2))
    return tmp_path


@pytest.fixture
def model(tmp_path: Path) -> Path:
    """An untrained model of images, with weights so large that they count."""
    import torch

    from simbev_training.model.bev_model import BevModel
    from simbev_training.training.export import export_model

    torch.manual_seed(0)
    about = {"modality": "camera", "sweep_ages_s": [0.0]}
    untrained = BevModel(Modality.CAMERA)
    with torch.no_grad():
        for weights in untrained.parameters():
            weights *= 2.4 if weights.dim() == 4 else 1.0
    export_model(untrained, tmp_path / "model.onnx", about, 2, (64, 32))
    return tmp_path / "model.onnx"


@pytest.fixture(autouse=True)
def ros() -> Iterator[None]:
    """ROS in this test's domain."""
    rclpy.init(domain_id=DOMAIN)
    yield
    rclpy.shutdown()


def gray_jpeg(value: int) -> bytes:
    return bytes(simplejpeg.encode_jpeg(np.full((32, 64, 3), value, np.uint8)))


def answer_live(baseline: Baseline, dataset: Path, scene: CachedScene) -> None:
    """Play odometry of the dataset and images of its cache to the node in lockstep; one frame lacks an image."""
    recorded = open_dataset(dataset / "set").scenes[0]
    stack, graph, executor = BaselineNode(baseline), Node("graph"), SingleThreadedExecutor()
    executor.add_node(graph)
    executor.add_node(stack)
    reports: list[Header] = []
    graph.create_subscription(Header, "/sync/ready", reports.append, RELIABLE)
    motion = graph.create_publisher(Odometry, "/ego/odom", RELIABLE)

    images = [
        graph.create_publisher(CompressedImage, f"/ego/{name}/rgb/image_raw/compressed", RELIABLE)
        for name in ("front", "left")
    ]
    graph.create_publisher(String, "/world/scene", LATCHED).publish(String(data=recorded.spec.model_dump_json()))
    for tick in range(TICKS + 1):
        wait_until(lambda tick=tick: len(reports) > tick, meanwhile=lambda: executor.spin_once(timeout_sec=0.05))  # type: ignore[misc]
        if tick < TICKS:
            stamp_ns, odometry = (
                recorded.spec.stamp_ns(tick),
                Odometry(header=header(recorded.spec.stamp_ns(tick), "map")),
            )
            pose = recorded[tick].messages("odom")[-1].pose.pose
            for part in ("position", "orientation"):
                for axis in "xyzw" if part == "orientation" else "xyz":
                    setattr(getattr(odometry.pose.pose, part), axis, float(getattr(getattr(pose, part), axis)))
            for publisher, jpeg in zip(images, scene.sample(tick, (0,)).jpegs, strict=True):
                assert jpeg is not None
                data = b"damaged" if tick == DROPPED else bytes(jpeg)
                publisher.publish(compressed_image_message(data, "rgb8; jpeg compressed bgr8", stamp_ns, "c"))
            motion.publish(odometry)
    executor.shutdown()
    stack.destroy_node()
    graph.destroy_node()


def test_a_model_is_given_and_answers_the_same_live(dataset: Path, model: Path) -> None:
    [scene] = cached_scenes(dataset / "cache", "train")
    predicted, live = NotingBaseline(model), NotingBaseline(model)
    predict(predicted, [scene], dataset / "predictions", lambda _: None)
    answer_live(live, dataset, scene)
    assert len(predicted.given) == TICKS and len(live.given) == TICKS - 1
    ticks = [tick for tick in range(TICKS) if tick != DROPPED]
    for tick, given, answer in zip(ticks, live.given, live.answers, strict=True):
        assert np.array_equal(given[0], predicted.given[tick][0])
        np.testing.assert_allclose(given[1], predicted.given[tick][1], rtol=1e-6, atol=1e-5)
        assert np.abs(answer.cells.astype(int) - predicted.answers[tick].cells).max() <= 1
        assert len(answer.boxes) == len(predicted.answers[tick].boxes)
    assert (predicted.answers[0].cells != predicted.answers[-1].cells).any()  # images count
