"""Predicts the key frames of a cache and writes what ``simbev evaluate`` reads."""

from collections.abc import Callable, Iterator, Sequence
from pathlib import Path

import numpy as np

from simbev_ros.baselines.boxes import boxes_in_map
from simbev_ros.baselines.inference import Baseline
from simbev_ros.baselines.tracked_predictions import track_predictions
from simbev_ros.evaluation.metrics.boxes import NO_ATTRIBUTE, Boxes, Predictions
from simbev_ros.evaluation.predictions.prediction_writer import write_grid, write_predictions
from simbev_ros.foundation.types import Float64Array, Int64Array, Table
from simbev_ros.foundation.units import NS_PER_S
from simbev_training.cache.reader import CachedScene


def predict(
    baseline: Baseline,
    scenes: Sequence[CachedScene],
    out: Path,
    report: Callable[[int], None],
    every: int = 1,
    *,
    tracks: bool = False,
) -> None:
    """Write boxes (map frame) and grids of all key frames.

    Args:
        baseline: The model.
        scenes: Scenes of a cache.
        out: A new folder.
        report: Called with 1 after each frame.
        every: Only every Nth key frame of a scene.
        tracks: Whether to track the boxes, which gives them ids and the velocities of their tracks.

    Raises:
        InputError: The folder holds predictions already.
    """
    out.mkdir(parents=True, exist_ok=True)

    def answers() -> Iterator[tuple[str, Predictions, list[int]]]:
        for scene in scenes:
            name, tables, ticks = str(scene.about["name"]), [], []
            for index in range(0, len(scene.frames), every):
                sample, frame = scene.sample(index, baseline.sweep_ages_ns), scene.frames[index]
                images = sample.images() if baseline.modality.has_cameras else None
                answer = baseline.answer(sample.points(), images, sample.pixel_from_level)
                tick = int(frame["tick"])
                write_grid(out, name, tick, np.moveaxis(answer.cells, 2, 0))
                tables.append((tick, answer.boxes, frame["map_from_ego"]))
                ticks.append(tick)
                report(1)
            predictions = _predictions(tables)
            if tracks:
                stamps_s = (scene.frames["stamp_ns"][::every] / NS_PER_S).tolist()
                predictions = track_predictions(predictions, dict(zip(ticks, stamps_s, strict=True)))
            yield name, predictions, ticks

    write_predictions(out / "boxes.parquet", answers(), tracks=tracks)


def metric_boxes(rows: Table, frame: Int64Array | int) -> Boxes:
    """Boxes (N,) ``baselines.boxes.BOX_DTYPE`` of frames as metrics take them."""
    columns = {name: rows[name].astype(np.float64) for name in rows.dtype.names if name != "class"}
    return Boxes(
        frame=np.broadcast_to(np.int64(frame), len(rows)),
        label=rows["class"],
        center_m=np.stack([columns[name] for name in ("x", "y", "z")], 1),
        size_m=np.stack([columns[name] for name in ("length", "width", "height")], 1),
        yaw_rad=columns["yaw"],
        velocity_mps=np.stack([columns["vx"], columns["vy"], np.zeros(len(rows))], 1),
        attribute=np.full(len(rows), NO_ATTRIBUTE, np.uint8),
    )


def _predictions(tables: Sequence[tuple[int, Table, Float64Array]]) -> Predictions:
    placed = [boxes_in_map(boxes, pose) for _, boxes, pose in tables]
    rows = np.concatenate(placed)
    frame = np.repeat([tick for tick, _, _ in tables], [len(each) for each in placed]).astype(np.int64)
    return Predictions(metric_boxes(rows, frame), rows["score"].astype(np.float64))
