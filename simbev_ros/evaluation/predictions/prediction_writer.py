"""Writes predictions in the format that ``dataset_predictions`` reads.

::

    from simbev_ros.evaluation import write_grid, write_predictions

    def answers():
        for scene in open_dataset("datasets/first").scenes:
            yield scene.name, my_predictions(scene)     # Predictions; their frame is the tick

    write_predictions(Path("answers/boxes.parquet"), answers(), frame_id="ego/lidar")
    write_grid(Path("answers"), "Town01-0000", tick=0, scores=scores)
"""

from collections.abc import Iterable, Sequence
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from simbev_ros.evaluation.metrics.boxes import NO_TRACK, Predictions
from simbev_ros.evaluation.predictions.predicted_boxes import BOX_COLUMNS, MAP_FRAME, TRACK_COLUMN, VELOCITY_COLUMNS
from simbev_ros.evaluation.predictions.score_grid import GRIDS_FOLDER, ScoreGrid, grid_file
from simbev_ros.foundation.errors import InputError
from simbev_ros.foundation.files.whole_files import require_replaceable
from simbev_ros.foundation.semantics import BEV_CLASSES, BOX_CLASSES
from simbev_ros.foundation.types import AnyArray

_NUMBERS = (*BOX_COLUMNS, *VELOCITY_COLUMNS)
_TEXT = pa.dictionary(pa.int32(), pa.string())


def write_predictions(
    path: Path,
    scenes: Iterable[tuple[str, Predictions] | tuple[str, Predictions, Iterable[int]]],
    frame_id: str = MAP_FRAME,
    *,
    tracks: bool = False,
) -> None:
    """Write boxes as Parquet, one row group per scene; only one scene is in memory at a time.

    Args:
        path: A new ``.parquet`` file.
        scenes: Name and boxes of each scene; their ``frame`` is the tick; optionally also the ticks that were answered,
            so that answers without boxes are recorded.
        frame_id: Coordinate frame of all boxes.
        tracks: Whether to write the ids of tracks.

    Raises:
        InputError: The file exists, or cannot be written.
    """
    fields = [("scene", _TEXT), ("tick", pa.int64()), ("class", _TEXT), ("score", pa.float64())]
    fields += [(name, pa.float64()) for name in _NUMBERS] + ([(TRACK_COLUMN, pa.int64())] if tracks else [])
    schema = pa.schema(fields, {"frame_id": frame_id})
    if path.exists():
        raise InputError(f"{path}: exists already; predictions are written to a new file")
    require_replaceable(path)
    try:
        with pq.ParquetWriter(path, schema) as writer:
            for name, predictions, *answered in scenes:
                writer.write_table(_table(name, predictions, answered[0] if answered else (), schema))
    except OSError as error:
        raise InputError(f"{path}: cannot be written: {error.strerror or error}") from None


def write_grid(folder: Path, scene: str, tick: int, scores: AnyArray, classes: Sequence[str] = BEV_CLASSES) -> None:
    """Write the scores of one frame below ``grids`` in a folder of predictions.

    Args:
        folder: Folder that also holds the files of boxes.
        scene: Name of the scene.
        tick: Tick of the frame.
        scores: (C, H, W) floating, 0 … 1, or uint8, where 255 is 1; row 0 ahead, column 0 left.
        classes: Classes of the layers, out of ``BEV_CLASSES``.

    Raises:
        InputError: The scores are not as above, or the file cannot be written.
    """
    path = grid_file(folder / GRIDS_FOLDER, scene, tick)
    checked = ScoreGrid(tuple(classes), scores, str(path))
    require_replaceable(path)
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        np.savez_compressed(path, scores=checked.scores, classes=np.array(checked.classes))
    except OSError as error:
        raise InputError(f"{path}: cannot be written: {error.strerror}") from None


def _table(scene: str, predictions: Predictions, answered: Iterable[int], schema: pa.Schema) -> pa.Table:
    boxes = predictions.boxes
    empty = np.setdiff1d(np.array([*answered], np.int64), boxes.frame)
    count = len(boxes) + len(empty)
    numbers = np.full((count, len(_NUMBERS) + 1), np.nan)
    values = predictions.score[:, None], boxes.center_m, boxes.size_m, boxes.yaw_rad[:, None], boxes.velocity_mps
    numbers[: len(boxes)] = np.concatenate(values, axis=1)
    tick = np.concatenate([boxes.frame, empty])
    order, is_empty = np.argsort(tick, kind="stable"), np.arange(count) >= len(boxes)
    label = np.concatenate([boxes.label, np.zeros(len(empty), np.uint8)]).astype(np.int32)
    classes = pa.DictionaryArray.from_arrays(pa.array(label[order], mask=is_empty[order]), [*BOX_CLASSES])
    names = pa.DictionaryArray.from_arrays(np.zeros(count, np.int32), [scene])
    columns = [pa.array(column, from_pandas=True) for column in numbers[order].T]
    if TRACK_COLUMN in schema.names:
        track = np.concatenate([boxes.track, np.full(len(empty), NO_TRACK)])[order]
        columns.append(pa.array(track, mask=track == NO_TRACK))
    return pa.table([names, pa.array(tick[order]), classes, *columns], schema=schema)
