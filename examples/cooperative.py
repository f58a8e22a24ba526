"""Shows what cooperation is worth in recorded scenes with several agents: late, intermediate and early fusion.

    python examples/cooperative.py datasets/cars --out fused
    python examples/cooperative.py datasets/teams --predictions found --split test --out fused
    python examples/cooperative.py datasets/teams --fusion intermediate --split test --range 70 --out fused

Late fusion merges the boxes that the agents find. Without predictions, each agent answers with the true boxes of the
road users that its own lidars and radars hit, as a perfect detector would; what an agent misses alone is then what is
hidden from it. With them, it answers with what a stack has found: a file or folder for each agent, of its name, such as
``found/car_1`` from ``simbev predict lidar datasets/teams --agent car_1 --out found/car_1``. An agent without
predictions finds nothing. With ``--model lidar``, it answers with what that baseline finds in its lidar's points.

Intermediate and early fusion need such a model, and take that of the package unless another one is named. Intermediate
fusion merges what its first layers make of the points (``simbev_ros.baselines.cooperation``), which needs the training
distribution and onnx; early fusion merges the points. Both take what a message brings as if it were of this instant.

The answers are ``alone``, which is without fusion; ``fused``, with the others at the same instant; and ``received``, in
scenes with messages, with what has arrived, after the latency, within range and without those that are lost. What the
others have sent is placed by the pose that they have sent, with its error. Boxes move with their velocities until they
arrive. Where there are messages, each sender's own box is among the answers: a model takes the gap around a lidar for
the vehicle that carries it, which is never labeled, and finds no other vehicle there.

All are judged by the joint truth, in rings of distance from the agent: all road users around the agent that any agent
hits. A model sees up to 72 m to each side, hence ``--range 70``.

The answers are written as files of boxes, ``<agent>-alone.parquet``, ``<agent>-fused.parquet`` and
``<agent>-received.parquet``, of which ``simbev evaluate <file> <dataset> --agent <agent> --truth joint --points 1``
prints all metrics.
"""

import argparse
import math
import zlib
from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import lru_cache, partial
from pathlib import Path
from typing import Any, NamedTuple, Protocol

import numpy as np
import numpy.typing as npt

from simbev_ros.baselines.boxes import boxes_in_map as level_boxes_in_map
from simbev_ros.baselines.cooperation import (
    CellFeatures,
    TwoPartBaseline,
    fuse_features,
    level_from_level,
    moved_points,
    points_message_bytes,
)
from simbev_ros.baselines.dataset_points import points_at
from simbev_ros.baselines.inference import Answer, Baseline
from simbev_ros.baselines.modality import Modality
from simbev_ros.baselines.model_file import model_file
from simbev_ros.baselines.received_frames import ReceivedFrame, arrived_frames, frames_of_others
from simbev_ros.dataset import Frame, open_dataset
from simbev_ros.dataset.scene import Scene
from simbev_ros.evaluation.evaluation import Evaluation, evaluate
from simbev_ros.evaluation.filters import BoxFilter
from simbev_ros.evaluation.metrics.boxes import Predictions, boxes_from_tables
from simbev_ros.evaluation.options import EvaluationOptions
from simbev_ros.evaluation.predictions.dataset_predictions import boxes_in_map, open_predictions, write_predictions
from simbev_ros.evaluation.predictions.reference_frames import ReferenceFrames
from simbev_ros.evaluation.slices import TableSlice, table_slices
from simbev_ros.foundation.errors import InputError
from simbev_ros.foundation.semantics import BOX_CLASSES
from simbev_ros.foundation.types import Float32Array, Float64Array
from simbev_ros.reference_stack.fusion import fuse_boxes, received_boxes
from simbev_ros.reference_stack.pipeline import BOX_DTYPE

ROAD_USERS = ("car", "truck", "bus", "motorcycle", "bicycle", "pedestrian")
RINGS_M = (0.0, 20.0, 40.0)
Table = npt.NDArray[Any]
Detector = Callable[[Frame], Table]
"""Gives the (N,) ``BOX_DTYPE`` boxes, map frame, that the agent of a frame has found in it."""
Answers = dict[tuple[str, str], dict[str, dict[int, Table]]]
"""Boxes by agent and kind, then by name of the scene, then by tick."""
_FRAMES_KEPT = 64


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


class ModelBoxes:
    """A detector that runs a baseline on the points of a frame's agent.

    Args:
        path: ONNX file of a lidar baseline.
    """

    def __init__(self, path: Path) -> None:
        self.path, self.baseline = path, Baseline(path)
        if self.baseline.modality is not Modality.LIDAR:
            raise InputError(f"{path}: is a {self.baseline.modality} model; agents cooperate with a lidar model")
        self._points = lru_cache(_FRAMES_KEPT)(partial(points_at, ages_ns=self.baseline.sweep_ages_ns))
        self._found = lru_cache(_FRAMES_KEPT)(self._find)

    def __call__(self, frame: Frame) -> Table:
        """The boxes in one frame."""
        return self._found(frame.scene, frame.tick)

    def points(self, frame: Frame) -> Float32Array:
        """(N, 4) points in one frame, level frame, as ``Baseline.answer`` takes them."""
        return self._points(frame.scene, frame.tick)

    def _find(self, scene: Scene, tick: int) -> Table:
        return boxes_of(self.baseline.answer(self._points(scene, tick)), scene[tick].map_from_ego)


def boxes_of(answer: Answer, map_from_ego: Float64Array) -> Table:
    """(N,) ``BOX_DTYPE`` boxes of a model's answer, map frame, without the agent itself, which others hit."""
    placed = level_boxes_in_map(answer.boxes, map_from_ego)
    boxes = np.zeros(len(placed), BOX_DTYPE)
    for name in placed.dtype.names:
        boxes[name] = placed[name]
    return fuse_boxes([boxes[:0], boxes], map_from_ego)


class Fusion(Protocol):
    """How an agent merges what it receives with what it has."""

    def __call__(self, frame: Frame, received: Sequence[ReceivedFrame]) -> Table:
        """(N,) ``BOX_DTYPE`` boxes, map frame, that a frame's agent finds with what it has received."""

    def message_bytes(self, frame: Frame) -> int:
        """Size of a message that a frame's agent sends."""


class Late:
    """Merges boxes.

    Args:
        detect: What finds them.
    """

    def __init__(self, detect: Detector) -> None:
        self._detect = detect

    def __call__(self, frame: Frame, received: Sequence[ReceivedFrame]) -> Table:
        """The boxes of the agent and of what it has received, merged."""
        return fuse_boxes([self._detect(frame), *map(self._arrived, received)], frame.map_from_ego)

    def message_bytes(self, frame: Frame) -> int:
        """Size of boxes."""
        return len(zlib.compress(self._detect(frame).tobytes()))

    def _arrived(self, received: ReceivedFrame) -> Table:
        """The boxes of a sender where the receiver takes them to be."""
        boxes, frame = self._detect(received.frame), received.frame
        return received_boxes(boxes, frame.map_from_ego, received.map_from_ego, received.age_s)


class Early:
    """Merges points before a model sees them."""

    def __init__(self, model: ModelBoxes) -> None:
        self._model = model

    def __call__(self, frame: Frame, received: Sequence[ReceivedFrame]) -> Table:
        """The boxes that the model finds in all points."""
        clouds = [self._model.points(frame)]
        for each in received:
            to_receiver = level_from_level(frame.map_from_ego, each.map_from_ego)
            clouds.append(moved_points(self._model.points(each.frame), to_receiver))
        return boxes_of(self._model.baseline.answer(np.concatenate(clouds)), frame.map_from_ego)

    def message_bytes(self, frame: Frame) -> int:
        """Size of the newest sweep: earlier ones have been sent before."""
        return points_message_bytes(self._model.points(frame))


class Intermediate:
    """Merges features in the middle of a model."""

    def __init__(self, model: ModelBoxes) -> None:
        try:
            from simbev_training.training.parts import cut_model
        except ImportError as error:
            raise InputError(f"intermediate fusion needs {error.name}: pip install ./training onnx") from None
        self._model, self._parts = model, TwoPartBaseline(model.path, cut_model(model.path))

    def __call__(self, frame: Frame, received: Sequence[ReceivedFrame]) -> Table:
        """The boxes that the model finds in all features."""
        others = [self._arrived(frame, each) for each in received]
        fused = fuse_features(self._parts.encode(self._model.points(frame)), others)
        return boxes_of(self._parts.answer(fused), frame.map_from_ego)

    def message_bytes(self, frame: Frame) -> int:
        """Size of features."""
        return self._parts.encode(self._model.points(frame)).sent()[1]

    def _arrived(self, frame: Frame, received: ReceivedFrame) -> tuple[CellFeatures, Float64Array]:
        aim = frame.scene[received.frame.tick].map_from_ego  # the sender knows where the receiver was at that time
        points = moved_points(self._model.points(received.frame), level_from_level(aim, received.map_from_ego))
        features, _ = self._parts.encode(points).sent()
        return features, level_from_level(frame.map_from_ego, aim)


def nobody(frame: Frame) -> list[ReceivedFrame]:
    """Nothing: the agent is alone."""
    return []


FUSIONS: dict[str, Callable[[ModelBoxes], Fusion]] = {"late": Late, "intermediate": Intermediate, "early": Early}
KINDS = {"alone": nobody, "fused": frames_of_others, "received": arrived_frames}


def answers(scenes: list[Scene], agents: Sequence[str], fusion: Fusion, every: int) -> tuple[Answers, list[int]]:
    """Boxes of labeled frames of scenes, and sizes of messages in bytes."""
    tables, sizes = Answers(), list[int]()
    for scene in scenes:
        own = [scene.of_agent(name) for name in agents if name in scene.agents]
        for tick in np.flatnonzero(own[0].has(["boxes"]) if own else [])[::every].tolist():
            for frame in (each[tick] for each in own):
                sizes.append(fusion.message_bytes(frame))
                for kind, senders in KINDS.items():
                    if kind != "received" or has_messages(frame.scene):
                        of_scene = tables.setdefault((frame.scene.agent, kind), {}).setdefault(scene.name, {})
                        received = senders(frame)
                        known = [each.own_box() for each in received]
                        of_scene[tick] = fuse_boxes([fusion(frame, received), *known], frame.map_from_ego)
    return tables, sizes


def as_predictions(tables: Mapping[int, Table]) -> Predictions:
    """Boxes by tick as an evaluation takes them."""
    scores = np.concatenate([table["score"] for table in tables.values()]).astype(np.float64)
    return Predictions(boxes_from_tables(dict(tables)), scores)


def judge(scenes: list[Scene], file: Path, range_m: float, every: int) -> Evaluation:
    """Compare the answers in a file with the joint truth up to some distance from the agent."""
    seen_by_any = TableSlice(boxes=BoxFilter(points=(1, np.inf), range_m=(0.0, range_m)))
    slices = tuple(table_slices(seen_by_any, ["distance"], RINGS_M))
    options = EvaluationOptions(slices=slices, box_classes=ROAD_USERS, truth="joint", every=every)
    labeled = [scene for scene in scenes if scene.has(["boxes"]).any()]
    return evaluate(labeled, open_predictions(file).for_dataset([scene.name for scene in scenes]), options)


class Scope(NamedTuple):
    """The part of the data that counts.

    Attributes:
        agents: Names of those that receive; empty: all.
        range_m: Distance from the agent up to which boxes count.
        every: Only every Nth labeled frame of a scene counts.
    """

    agents: Sequence[str] = ()
    range_m: float = math.inf
    every: int = 1


def compare(scenes: list[Scene], out: Path, fusion: Fusion, scope: Scope | None = None) -> Iterator[str]:
    """Write the answers of each agent alone and together with the others; yield lines about each agent and ring."""
    agents, range_m, every = scope or Scope()
    agents = agents or list(dict.fromkeys(name for scene in scenes for name in scene.agents))
    tables, sizes = answers(scenes, agents, fusion, every)
    for agent in agents:
        own = [scene.of_agent(agent) for scene in scenes if agent in scene.agents]
        results: dict[str, Evaluation] = {}
        for kind in KINDS:
            found = tables.get((agent, kind), {})
            if own and len(found) == len(own):
                file = out / f"{agent}-{kind}.parquet"
                write_predictions(file, [(name, as_predictions(boxes)) for name, boxes in found.items()])
                results[kind] = judge(own, file, range_m, every)
        yield from _lines(agent, results)
    yield f"A message has {np.mean(sizes) / 1000:.1f} kB"


def _lines(agent: str, results: Mapping[str, Evaluation]) -> Iterator[str]:
    """Lines about an agent whose answers of each kind have been judged."""
    frames = {kind: np.concatenate(list(result.frames.values())) for kind, result in results.items()}
    if frames:
        boxes = int(frames["alone"]["boxes"].sum())
        shares = ", ".join(f"{kind} {rows['found'].sum() / max(boxes, 1):.1%}" for kind, rows in frames.items())
        yield f"{agent}: {boxes} boxes in the joint truth; found: {shares}"
        for ring, alone in results["alone"].detections.items():
            precisions = {kind: result.detections[ring].mean_ap("distance") for kind, result in results.items()}
            if alone.truths.any():
                words = ", ".join(f"{kind} {precision:.3f}" for kind, precision in precisions.items())
                yield f"  {ring.name}: mAP by distance of {alone.truths.sum()} boxes: {words}"


def has_messages(scene: Scene) -> bool:
    """Whether the scene's agent receives messages."""
    return scene.spec.v2x is not None and scene.agent in scene.spec.v2x.agents


def main() -> None:
    """Compare the agents of a dataset."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0] if __doc__ else None)
    parser.add_argument("dataset", type=Path, help="a dataset, or one scene's bag, with several agents")
    parser.add_argument("--predictions", type=Path, help="folder with what a stack has found, by the agents' names")
    parser.add_argument("--model", help="lidar, or an ONNX file of a lidar baseline, which all agents run")
    parser.add_argument("--fusion", choices=FUSIONS, default="late", help="what is merged; without --model by lidar")
    parser.add_argument("--split", help="only scenes of this split")
    parser.add_argument("--agents", type=lambda text: text.split(","), default=[], help="only these receive: ego,car_1")
    parser.add_argument("--every", type=int, default=1, help="only every Nth labeled frame of each scene")
    parser.add_argument("--range", type=float, default=math.inf, help="distance in m up to which boxes count")
    parser.add_argument("--out", type=Path, required=True, help="new folder for the files of boxes")
    options = parser.parse_args()
    try:
        fusion = _chosen_fusion(options)
        dataset = open_dataset(options.dataset)
        scenes = [scene for scene in dataset.scenes if len(scene.agents) > 1 and options.split in (None, scene.split)]
        options.out.mkdir(parents=True)
        for line in compare(scenes, options.out, fusion, Scope(options.agents, options.range, options.every)):
            print(line)
    except InputError as error:
        parser.error(str(error))


def _chosen_fusion(options: argparse.Namespace) -> Fusion:
    """The fusion that the command line asks for. Raises InputError if something that it needs is missing."""
    if options.predictions is not None and (options.model or options.fusion != "late"):
        raise InputError("--predictions are boxes of a stack: they go with late fusion, and without --model")
    if options.predictions is not None:
        return Late(PredictedBoxes(options.predictions, [scene.name for scene in open_dataset(options.dataset).scenes]))
    if options.fusion == "late" and options.model is None:
        return Late(hit_boxes)
    return FUSIONS[options.fusion](ModelBoxes(model_file(options.model or "lidar")))


if __name__ == "__main__":
    main()
