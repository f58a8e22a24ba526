"""Shows what cooperation is worth in a recorded scene with several agents: late fusion of what each of them sees.

    python examples/late_fusion.py datasets/cars --out fused

Each agent answers with the true boxes of the road users that its own lidars and radars hit, as a perfect detector
would. The answers of all agents are then merged, and both are judged by the joint truth: all road users around the
agent that any agent hits. As there are no errors of detectors, what an agent misses alone is what is hidden from it.

The answers are written as files of boxes, ``<agent>-alone.parquet`` and ``<agent>-fused.parquet``, of which
``simbev evaluate <file> <dataset> --agent <agent> --truth joint --points 1`` prints all metrics.
"""

import argparse
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from simbev_ros.dataset import Frame, open_dataset
from simbev_ros.dataset.scene import Scene
from simbev_ros.evaluation.evaluation import evaluate
from simbev_ros.evaluation.filters import BoxFilter
from simbev_ros.evaluation.metrics.boxes import Predictions, boxes_from_tables
from simbev_ros.evaluation.options import EvaluationOptions
from simbev_ros.evaluation.predictions.dataset_predictions import open_predictions, write_predictions
from simbev_ros.evaluation.slices import TableSlice
from simbev_ros.foundation.semantics import BOX_CLASSES
from simbev_ros.reference_stack.fusion import fuse_boxes
from simbev_ros.reference_stack.pipeline import BOX_DTYPE

ROAD_USERS = ("car", "truck", "bus", "motorcycle", "bicycle", "pedestrian")
Table = npt.NDArray[Any]


def detect(frame: Frame) -> Table:
    """(N,) ``BOX_DTYPE``, map frame: the road users that the sensors of a frame's agent hit."""
    truth = frame["boxes"]
    truth = truth[(truth["valid"] == 1) & np.isin(truth["class"], [BOX_CLASSES.index(name) for name in ROAD_USERS])]
    boxes = np.zeros(len(truth), BOX_DTYPE)
    for name in BOX_DTYPE.names or ():
        if name != "score":
            boxes[name] = truth[name]
    boxes["score"] = 1.0
    return boxes


def detect_together(frame: Frame) -> Table:
    """(N,) ``BOX_DTYPE``, map frame: what the agent detects, merged with what the others detect at the same instant."""
    return fuse_boxes([detect(frame), *map(detect, frame.others.values())], frame.map_from_ego)


def answers(scene: Scene, *, fused: bool) -> Predictions:
    """Boxes of all frames of a scene, as its agent detects them alone or together with the others."""
    labeled = [frame for frame in scene if "boxes" in frame]
    boxes = boxes_from_tables({frame.tick: (detect_together if fused else detect)(frame) for frame in labeled})
    return Predictions(boxes, np.ones(len(boxes)))


def judge(scenes: list[Scene], file: Path) -> tuple[int, int]:
    """Numbers of boxes in the joint truth, and of those that the answers in a file contain."""
    seen_by_any = TableSlice(boxes=BoxFilter(points=(1, np.inf)))
    options = EvaluationOptions(slices=(seen_by_any,), box_classes=ROAD_USERS, truth="joint")
    result = evaluate(scenes, open_predictions(file).for_dataset([scene.name for scene in scenes]), options)
    frames = np.concatenate(list(result.frames.values()))
    return int(frames["boxes"].sum()), int(frames["found"].sum())


def compare(scenes: list[Scene], out: Path) -> Iterator[str]:
    """Write the answers of each agent alone and of all together, and yield a line about each agent."""
    for agent in dict.fromkeys(name for scene in scenes for name in scene.agents):
        own = [scene.of_agent(agent) for scene in scenes if agent in scene.agents]
        found = {}
        for kind in ("alone", "fused"):
            file = out / f"{agent}-{kind}.parquet"
            write_predictions(file, [(scene.name, answers(scene, fused=kind == "fused")) for scene in own])
            boxes, found[kind] = judge(own, file)
        shares = ", ".join(f"{kind} {count / max(boxes, 1):.1%}" for kind, count in found.items())
        yield f"{agent}: {boxes} boxes in the joint truth; found: {shares}"


def main() -> None:
    """Compare the agents of a dataset."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0] if __doc__ else None)
    parser.add_argument("dataset", type=Path, help="a dataset, or one scene's bag, with several agents")
    parser.add_argument("--out", type=Path, required=True, help="new folder for the files of boxes")
    options = parser.parse_args()
    options.out.mkdir(parents=True)
    for line in compare(
        [scene for scene in open_dataset(options.dataset).scenes if len(scene.agents) > 1], options.out
    ):
        print(line)


if __name__ == "__main__":
    main()
