"""Predicts the frames of a recording of real sensors, and writes boxes, pictures and grids of each into a folder."""

from collections import defaultdict
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

import numpy as np

from simbev_ros.baselines.inference import Answer, Baseline
from simbev_ros.baselines.recordings.folder import folder_frames
from simbev_ros.baselines.recordings.kitti import CAMERA, kitti_frames
from simbev_ros.baselines.recordings.model_inputs import FrameView, answer_view, view_frame
from simbev_ros.baselines.recordings.nuscenes import nuscenes_frames
from simbev_ros.baselines.recordings.recording import Labels, RecordedFrame, boxes_in_frame
from simbev_ros.baselines.tracker import Tracker
from simbev_ros.evaluation.predictions.prediction_writer import write_grid
from simbev_ros.foundation.files.whole_files import write_whole
from simbev_ros.foundation.geometry.transforms import inverse
from simbev_ros.foundation.types import Float64Array
from simbev_ros.recording.image_codecs import encode_rgb
from simbev_training.recordings.pictures import draw_frame
from simbev_training.recordings.results import (
    TABLE_HEAD,
    kitti_lines,
    nuscenes_results,
    nuscenes_text,
    nuscenes_tracks,
    table_lines,
)
from simbev_training.recordings.scores import FrameTallies, Score, frame_tallies, scores

Layout = Literal["kitti", "nuscenes", "folder"]
BOXES_FILE, NUSCENES_FILE, TRACKS_FILE = "boxes.csv", "results_nusc.json", "tracking_nusc.json"
_JPEG_QUALITY = 92


@dataclass(frozen=True)
class Wanted:
    """What to write and to count.

    Attributes:
        pictures: Whether to draw pictures.
        grids: Whether to write the scores of the grid.
        min_score: Score from which boxes are drawn.
        min_points: Number of points from which on a label counts.
        tracks: Whether to write the tracks of nuScenes' layout.
    """

    pictures: bool
    grids: bool
    min_score: float
    min_points: int
    tracks: bool = False


def read_frames(layout: Layout, folder: Path, version: str) -> list[RecordedFrame]:
    """The frames of a recording. Raises InputError if it cannot be read."""
    if layout == "nuscenes":
        return nuscenes_frames(folder, version)
    return kitti_frames(folder) if layout == "kitti" else folder_frames(folder)


def predict_recording(
    baseline: Baseline,
    frames: Sequence[RecordedFrame],
    layout: Layout,
    ground: Float64Array | None,
    out: Path,
    wanted: Wanted,
    report: Callable[[int], None],
) -> list[Score]:
    """Predict all frames, write what is wanted into a folder, and score the frames with labels.

    Args:
        baseline: The model.
        frames: Frames of the recording.
        layout: How it lies on the disk; results have the form of that layout too.
        ground: From ``model_inputs.ground_pose``.
        out: A new folder.
        wanted: What to write and to count.
        report: Called with 1 after each frame.

    Raises:
        InputError: A file of the recording is damaged, or the folder cannot be written to.
    """
    out.mkdir(parents=True, exist_ok=True)
    counted: list[FrameTallies] = []
    results: dict[str, dict[str, list[dict[str, Any]]]] = defaultdict(dict)
    tracker = Tracker()

    def table() -> Iterator[bytes]:
        yield TABLE_HEAD.encode()
        for index, frame in enumerate(frames):
            view = view_frame(frame, baseline.sweep_ages_ns, ground)
            answer, labels = answer_view(baseline, view), frame.labels() if frame.labels else None
            if layout == "kitti" and CAMERA in view.photos:
                lines = kitti_lines(answer.boxes, view.photos[CAMERA])
                write_whole(out / "data" / f"{frame.name}.txt", lines.encode())
            if layout == "nuscenes":
                results[NUSCENES_FILE][frame.name] = nuscenes_results(answer.boxes, frame, view)
            if wanted.tracks:
                if index and frame.sweeps is not frames[index - 1].sweeps:
                    tracker.end_tracks()
                results[TRACKS_FILE][frame.name] = nuscenes_tracks(answer.boxes, frame, view, tracker)
            if labels and (tallies := frame_tallies(answer.boxes, labels, view, wanted.min_points)):
                counted.append(tallies)
            _write_extras(out, index, frame, view, answer, labels, wanted)
            yield table_lines(frame.name, boxes_in_frame(answer.boxes, inverse(view.ego_from_lidar))).encode()
            report(1)

    write_whole(out / BOXES_FILE, table())
    sees = {"has_cameras": baseline.modality.has_cameras, "has_lidar": baseline.modality.has_lidar}
    for file, content in results.items():
        write_whole(out / file, nuscenes_text(content, **sees).encode())
    return scores(counted)


def _write_extras(
    out: Path,
    index: int,
    frame: RecordedFrame,
    view: FrameView,
    answer: Answer,
    labels: Labels | None,
    wanted: Wanted,
) -> None:
    """Write the picture and the grid of a frame if they are wanted."""
    if wanted.grids:
        write_grid(out, "recording", index, np.moveaxis(answer.cells, 2, 0))
    if wanted.pictures:
        labeled = None if labels is None else boxes_in_frame(labels.boxes, view.ego_from_lidar)
        picture = draw_frame(frame.title, view, answer, labeled, wanted.min_score)
        name = frame.sweep.path.stem.removesuffix(".pcd")
        write_whole(out / "pictures" / f"{name}.jpg", encode_rgb(picture, _JPEG_QUALITY))
