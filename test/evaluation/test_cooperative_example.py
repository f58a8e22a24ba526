"""The example of cooperation finds what one of the agents alone cannot see."""

import re
from importlib.util import module_from_spec, spec_from_file_location
from pathlib import Path
from types import ModuleType, SimpleNamespace
from typing import Any

import cooperative_scene as made
import numpy as np
import pytest

from simbev_ros.baselines.boxes import BOX_DTYPE as BASELINE_BOX_DTYPE
from simbev_ros.baselines.grid import CELLS
from simbev_ros.baselines.inference import Answer
from simbev_ros.baselines.received_frames import ReceivedFrame, arrived_frames
from simbev_ros.dataset import Scene, open_dataset
from simbev_ros.evaluation.predictions.dataset_predictions import write_predictions
from simbev_ros.reference_stack.pipeline import BOX_DTYPE
from simbev_ros.schema.v2x import V2X_DTYPE

EXAMPLE = Path(__file__).parents[2] / "examples/cooperative.py"


@pytest.fixture(scope="module")
def example() -> ModuleType:
    spec = spec_from_file_location("cooperative", EXAMPLE)
    assert spec is not None and spec.loader is not None
    module = module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.fixture(scope="module")
def scenes(tmp_path_factory: pytest.TempPathFactory) -> list[Scene]:
    return list(open_dataset(made.record(tmp_path_factory.mktemp("cars") / "cars")).scenes)


def found(lines: list[str]) -> dict[str, str]:
    """Words about each agent, without those about rings."""
    return dict(line.split(": ", 1) for line in lines if ": " in line and not line.startswith(" "))


def test_fused_boxes_find_what_is_hidden_from_one_agent(
    example: ModuleType, scenes: list[Scene], tmp_path: Path
) -> None:
    lines = [*example.compare(scenes, tmp_path, example.Late(example.hit_boxes))]
    words = "40 boxes in the joint truth; found: alone 75.0%, fused 100.0%"
    assert found(lines) == {"ego": words, "car": words}
    assert sorted(path.name for path in tmp_path.glob("*.parquet")) == [
        f"{agent}-{kind}.parquet" for agent in ("car", "ego") for kind in ("alone", "fused")
    ]


def test_a_table_by_distance_shows_in_which_ring_the_others_help(
    example: ModuleType, scenes: list[Scene], tmp_path: Path
) -> None:
    lines = [*example.compare(scenes, tmp_path, example.Late(example.hit_boxes))]
    of_ego = lines[1 : lines.index(next(line for line in lines if line.startswith("car")))]
    rings = dict(re.split(": mAP by distance of [0-9]+ boxes: ", line.strip()) for line in of_ego)
    # What the other car alone sees is 38.8 m away in the first frame, and 30.1 m in the last one.
    assert rings["0 to 20 m"] == "alone 1.000, fused 1.000"
    assert rings["20 to 40 m"].startswith("alone 0.") and rings["20 to 40 m"].endswith("fused 1.000")
    assert list(rings)[:3] == ["all", "0 to 20 m", "20 to 40 m"]


def test_predictions_are_fused_like_what_perfect_detectors_find(
    example: ModuleType, scenes: list[Scene], tmp_path: Path
) -> None:
    for folder in ("found", "perfect", "predicted", "alone"):
        (tmp_path / folder).mkdir()
    for agent in ("ego", "car"):
        answers = made.as_answers({tick: made.seen(agent, tick) for tick in range(made.TICKS)})
        write_predictions(tmp_path / "found" / f"{agent}.parquet", [(made.NAME, answers)])
    detect = example.PredictedBoxes(tmp_path / "found", [made.NAME])
    perfect = [*example.compare(scenes, tmp_path / "perfect", example.Late(example.hit_boxes))]
    assert [*example.compare(scenes, tmp_path / "predicted", example.Late(detect))][:-1] == perfect[:-1]
    (tmp_path / "found" / "car.parquet").unlink()
    late = example.Late(example.PredictedBoxes(tmp_path / "found", [made.NAME]))
    alone = [*example.compare(scenes, tmp_path / "alone", late)]
    assert found(alone)["ego"].endswith("alone 75.0%, fused 75.0%")
    assert found(alone)["car"].endswith("alone 0.0%, fused 50.0%")  # nothing has found the ego


class Sender(dict[str, Any]):
    """A frame of the agent ``car`` at (40, 0), which has sent another pose: x, y and heading."""

    def __init__(self, x_m: float, y_m: float, yaw_rad: float) -> None:
        message = np.zeros(1, V2X_DTYPE)
        message["x"], message["y"], message["yaw"] = x_m, y_m, yaw_rad
        super().__init__({"v2x/car": message})
        self.scene, self.stamp_ns = SimpleNamespace(agent="car"), 200_000_000
        self.map_from_ego = np.eye(4)
        self.map_from_ego[0, 3] = 40.0


def found_box(x_m: float, y_m: float) -> np.ndarray:
    box = np.zeros(1, BOX_DTYPE)
    box["x"], box["y"], box["vx"], box["vy"], box["score"] = x_m, y_m, 10.0, -2.0, 0.8
    box["length"] = box["width"] = box["height"] = 2.0
    return box


@pytest.mark.parametrize(
    ("reported", "expected"),
    [
        ((40.0, 0.0, 0.0), (55.0, -1.0, 0.0)),  # the box moves on for half a second
        ((41.0, 2.0, 0.0), (56.0, 1.0, 0.0)),  # and with the sender's position
        ((40.0, 0.0, np.pi / 2), (41.0, 15.0, np.pi / 2)),  # and turns with its heading, its velocity, too
    ],
)
def test_boxes_of_a_message_are_where_the_sender_believes_and_move_until_it_arrives(
    example: ModuleType, reported: tuple[float, float, float], expected: tuple[float, float, float]
) -> None:
    own, sent, car = found_box(-20.0, 0.0), found_box(50.0, 0.0), Sender(*reported)
    now = SimpleNamespace(stamp_ns=700_000_000, map_from_ego=np.eye(4), received={"car": car})
    boxes = example.Late(lambda frame: own if frame is now else sent)(now, arrived_frames(now))
    (arrived,) = boxes[boxes["x"] > 0]
    assert [arrived[name] for name in ("x", "y", "yaw")] == pytest.approx(expected, abs=1e-5)
    assert len(boxes) == 2 and sent["x"] == 50.0


def test_a_sender_is_where_it_says_and_moves_until_the_message_arrives() -> None:
    car = Sender(41.0, 2.0, np.pi / 2)
    row = car["v2x/car"]
    row["z"], row["length"], row["width"], row["height"], row["vx"], row["class"] = 0.5, 4.0, 2.0, 1.5, 10.0, 0
    now = SimpleNamespace(stamp_ns=700_000_000, map_from_ego=np.eye(4), received={"car": car})
    [box] = arrived_frames(now)[0].own_box()
    assert [box[name] for name in ("x", "y", "z", "yaw")] == pytest.approx([46.0, 2.0, 1.25, np.pi / 2])
    # At its true pose, it stands at (40, 0) and heads along x; what it sent along x is across.
    [box] = ReceivedFrame(car, car.map_from_ego, 0.0).own_box()
    assert [box[name] for name in ("x", "y", "z", "yaw")] == pytest.approx([40.0, 0.0, 0.75, 0.0], abs=1e-5)
    row["class"] = 255
    assert len(arrived_frames(now)[0].own_box()) == 0  # a roadside unit


def test_points_of_a_message_are_where_the_sender_believes_in_the_level_frame_of_the_receiver(
    example: ModuleType,
) -> None:
    seen: list[np.ndarray] = []

    def answer(points: np.ndarray) -> Answer:
        seen.append(points)
        return Answer(np.zeros((CELLS, CELLS, 14), np.uint8), np.zeros(0, BASELINE_BOX_DTYPE))

    car = Sender(41.0, 2.0, np.pi / 2)  # is at (40, 0) and heads along x
    clouds = {"now": np.array([[1.0, 0.0, 0.2, 1.0]], np.float32), "car": np.array([[3.0, 0.0, 0.5, 0.0]], np.float32)}
    model = SimpleNamespace(
        baseline=SimpleNamespace(answer=answer), points=lambda frame: clouds["car" if frame is car else "now"]
    )
    now = SimpleNamespace(stamp_ns=700_000_000, map_from_ego=np.eye(4), received={"car": car})
    assert len(example.Early(model)(now, arrived_frames(now))) == 0
    assert seen[0] == pytest.approx(np.array([[1.0, 0.0, 0.2, 1.0], [41.0, 5.0, 0.5, 0.0]]), abs=1e-5)
