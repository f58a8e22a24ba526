"""Shows what cooperation is worth in recorded scenes with several agents: late fusion of what each of them finds.

    python examples/late_fusion.py datasets/cars --out fused
    python examples/late_fusion.py datasets/teams --predictions found --split test --out fused

Without predictions, each agent answers with the true boxes of the road users that its own lidars and radars hit, as a
perfect detector would; what an agent misses alone is then what is hidden from it. With them, it answers with what a
stack has found: a file or folder for each agent, of its name, such as ``found/car_1`` from ``simbev predict lidar
datasets/teams --agent car_1 --out found/car_1``. An agent without predictions finds nothing.

The answers of all agents are merged: ``fused`` at the same instant, and ``received``, in scenes with messages, as they
arrive, after the latency, within range and without those that are lost. Their boxes have the error of the pose that the
sender has sent, and move with their velocities until they arrive. All are judged by the joint truth, in rings of
distance from the agent: all road users around the agent that any agent hits.

The answers are written as files of boxes, ``<agent>-alone.parquet``, ``<agent>-fused.parquet`` and
``<agent>-received.parquet``, of which ``simbev evaluate <file> <dataset> --agent <agent> --truth joint --points 1``
prints all metrics.
"""

import argparse
import math
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from simbev_ros.dataset import Frame, open_dataset
from simbev_ros.dataset.scene import Scene
from simbev_ros.evaluation.evaluation import Evaluation, evaluate
from simbev_ros.evaluation.filters import BoxFilter
from simbev_ros.evaluation.metrics.boxes import Predictions, boxes_from_tables
from simbev_ros.evaluation.options import EvaluationOptions
from simbev_ros.evaluation.predictions.dataset_predictions import boxes_in_map, open_predictions, write_predictions
from simbev_ros.evaluation.predictions.reference_frames import ReferenceFrames
from simbev_ros.evaluation.slices import TableSlice, table_slices
from simbev_ros.foundation.geometry.transforms import matrices_from_xyz_rpy
from simbev_ros.foundation.semantics import BOX_CLASSES
from simbev_ros.reference_stack.fusion import fuse_boxes
from simbev_ros.reference_stack.pipeline import BOX_DTYPE
from simbev_ros.schema.v2x import OWN_POSE

ROAD_USERS = ("car", "truck", "bus", "motorcycle", "bicycle", "pedestrian")
RINGS_M = (0.0, 20.0, 40.0)
Table = npt.NDArray[Any]
Detector = Callable[[Frame], Table]
"""Gives the (N,) ``BOX_DTYPE`` boxes, map frame, that the agent of a frame has found in it."""


def hit_boxes(frame: Frame) -> Table:
    """The true boxes of the road users that the sensors of a frame's agent hit."""
    truth = frame["boxes"]
    truth = truth[(truth["valid"] == 1) & np.isin(truth["class"], [BOX_CLASSES.index(name) for name in ROAD_USERS])]
    boxes = np.zeros(len(truth), BOX_DTYPE)
    for name in BOX_DTYPE.names or ():
        if name != "score":
            boxes[name] = truth[name]
    boxes["score"] = 1.0
    return boxes


class PredictedBoxes:
    """A detector that reads what a stack has found.

    Args:
        folder: Predictions of each agent, called like the agent.
        scenes: Names of the scenes of the dataset.
    """

    def __init__(self, folder: Path, scenes: Sequence[str]) -> None:
        self._sets = {path.stem: open_predictions(path).for_dataset(scenes) for path in sorted(folder.iterdir())}
        self._scenes: dict[tuple[str, str], Predictions] = {}

    def __call__(self, frame: Frame) -> Table:
        """The boxes in one frame."""
        agent = frame.scene.agent
        if agent not in self._sets:
            return np.zeros(0, BOX_DTYPE)
        key = agent, frame.scene.name
        if key not in self._scenes:
            found = self._sets[agent].scene(frame.scene.name, frame.scene.stamps_ns).boxes()
            self._scenes[key] = boxes_in_map(found, ReferenceFrames.from_scene(frame.scene))
        found_here = self._scenes[key].take(self._scenes[key].boxes.frame == frame.tick)
        own, boxes = found_here.boxes, np.zeros(len(found_here), BOX_DTYPE)
        for names, values in (
            (("x", "y", "z"), own.center_m),
            (("length", "width", "height"), own.size_m),
            (("vx", "vy", "vz"), np.nan_to_num(own.velocity_mps)),
        ):
            for name, column in zip(names, values.T, strict=True):
                boxes[name] = column
        boxes["yaw"], boxes["class"], boxes["score"] = own.yaw_rad, own.label, found_here.score
        return boxes


def as_sent(boxes: Table, frame: Frame) -> Table:
    """Boxes with the error of the pose that a frame's agent has sent."""
    message = frame[f"v2x/{frame.scene.agent}"]
    pose = message[message["id"] == OWN_POSE][0]
    xyz, rpy = (np.array([pose[name] for name in names], np.float64) for names in ("xyz", ("roll", "pitch", "yaw")))
    map_from_true = matrices_from_xyz_rpy(xyz, rpy) @ np.linalg.inv(frame.map_from_ego)
    result, turn = boxes.copy(), map_from_true[:2, :2]
    centers_m = np.stack([boxes[name] for name in "xyz"], axis=1) @ map_from_true[:3, :3].T + map_from_true[:3, 3]
    result["x"], result["y"], result["z"] = centers_m.T
    result["vx"], result["vy"] = turn @ np.stack([boxes["vx"], boxes["vy"]])
    result["yaw"] += np.arctan2(turn[1, 0], turn[0, 0])
    return result


def moved(boxes: Table, age_s: float) -> Table:
    """Boxes after they have moved with their velocities for some time."""
    result = boxes.copy()
    for axis in "xyz":
        result[axis] += age_s * boxes[f"v{axis}"]
    return result


def found_alone(frame: Frame, detect: Detector) -> Table:
    """What the agent finds alone."""
    return detect(frame)


def found_together(frame: Frame, detect: Detector) -> Table:
    """What the agent finds, merged with what the others find at the same instant."""
    return fuse_boxes([detect(frame), *map(detect, frame.others.values())], frame.map_from_ego)


def found_with_messages(frame: Frame, detect: Detector) -> Table:
    """What the agent finds, merged with what the others had found when they sent what has arrived."""
    received = [
        moved(as_sent(detect(each), each), 1e-9 * (frame.stamp_ns - each.stamp_ns)) for each in frame.received.values()
    ]
    return fuse_boxes([detect(frame), *received], frame.map_from_ego)


KINDS = {"alone": found_alone, "fused": found_together, "received": found_with_messages}


def answers(scene: Scene, kind: str, detect: Detector) -> Predictions:
    """Boxes of all labeled frames of a scene."""
    labeled = [frame for frame in scene if "boxes" in frame]
    tables = {frame.tick: KINDS[kind](frame, detect) for frame in labeled}
    scores = np.concatenate([table["score"] for table in tables.values()]).astype(np.float64)
    return Predictions(boxes_from_tables(tables), scores)


def judge(scenes: list[Scene], file: Path) -> Evaluation:
    """Compare the answers in a file with the joint truth."""
    seen_by_any = TableSlice(boxes=BoxFilter(points=(1, np.inf)))
    slices = tuple(table_slices(seen_by_any, ["distance"], RINGS_M))
    options = EvaluationOptions(slices=slices, box_classes=ROAD_USERS, truth="joint")
    labeled = [scene for scene in scenes if scene.has(["boxes"]).any()]
    return evaluate(labeled, open_predictions(file).for_dataset([scene.name for scene in scenes]), options)


def compare(scenes: list[Scene], out: Path, detect: Detector = hit_boxes) -> Iterator[str]:
    """Write the answers of each agent alone and together with the others; yield lines about each agent and ring."""
    for agent in dict.fromkeys(name for scene in scenes for name in scene.agents):
        own = [scene.of_agent(agent) for scene in scenes if agent in scene.agents]
        kinds = [kind for kind in KINDS if kind != "received" or all(has_messages(scene) for scene in own)]
        results: dict[str, Evaluation] = {}
        for kind in kinds:
            file = out / f"{agent}-{kind}.parquet"
            write_predictions(file, [(scene.name, answers(scene, kind, detect)) for scene in own])
            results[kind] = judge(own, file)
        frames = {kind: np.concatenate(list(result.frames.values())) for kind, result in results.items()}
        boxes = int(frames["alone"]["boxes"].sum())
        shares = ", ".join(f"{kind} {rows['found'].sum() / max(boxes, 1):.1%}" for kind, rows in frames.items())
        yield f"{agent}: {boxes} boxes in the joint truth; found: {shares}"
        for ring in results["alone"].detections:
            precisions = {kind: result.detections[ring].mean_ap("distance") for kind, result in results.items()}
            if not all(map(math.isnan, precisions.values())):
                yield f"  {ring.name}: mAP by distance: {', '.join(f'{k} {p:.3f}' for k, p in precisions.items())}"


def has_messages(scene: Scene) -> bool:
    """Whether the scene's agent receives messages."""
    return scene.spec.v2x is not None and scene.agent in scene.spec.v2x.agents


def main() -> None:
    """Compare the agents of a dataset."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0] if __doc__ else None)
    parser.add_argument("dataset", type=Path, help="a dataset, or one scene's bag, with several agents")
    parser.add_argument("--predictions", type=Path, help="folder with what a stack has found, by the agents' names")
    parser.add_argument("--split", help="only scenes of this split")
    parser.add_argument("--out", type=Path, required=True, help="new folder for the files of boxes")
    options = parser.parse_args()
    options.out.mkdir(parents=True)
    dataset = open_dataset(options.dataset)
    names = [scene.name for scene in dataset.scenes]
    detect = hit_boxes if options.predictions is None else PredictedBoxes(options.predictions, names)
    scenes = [scene for scene in dataset.scenes if len(scene.agents) > 1 and options.split in (None, scene.split)]
    for line in compare(scenes, options.out, detect):
        print(line)


if __name__ == "__main__":
    main()
