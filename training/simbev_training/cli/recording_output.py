"""What ``simbev predict`` prints of a recording of real sensors: where the ground is, progress, and scores."""

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from rich import box
from rich.table import Table

from simbev_ros.cli.console import counting_bar, make_console, table_console
from simbev_ros.foundation.counts import plural
from simbev_ros.foundation.errors import InputError
from simbev_ros.foundation.files.input_file import is_folder, path_exists
from simbev_ros.foundation.files.whole_files import require_writable, write_errors
from simbev_ros.foundation.geometry.transforms import rpy_from_rotation
from simbev_ros.foundation.types import Float64Array

if TYPE_CHECKING:
    from simbev_ros.baselines.inference import Baseline
    from simbev_ros.baselines.recordings.recording import RecordedFrame
    from simbev_training.recordings.prediction import Layout, Wanted
    from simbev_training.recordings.scores import Score


def predict_real_frames(
    baseline: "Baseline", folder: Path, out: Path, layout: "Layout", version: str, every: int, wanted: "Wanted"
) -> None:
    """Predict a recording, with progress, and print what was found.

    Args:
        baseline: The model.
        folder: Folder of the recording.
        out: New folder for the predictions.
        layout: How the recording lies on the disk.
        version: Name of the folder of nuScenes' tables.
        every: Every Nth frame.
        wanted: What to write and to count.

    Raises:
        InputError: The recording cannot be read, or the folder is not new.
    """
    from simbev_ros.baselines.recordings.model_inputs import ground_pose
    from simbev_training.recordings.prediction import predict_recording, read_frames

    require_new_folder(out)
    if not is_folder(folder):
        raise InputError(f"{folder}: is not a folder")
    console = make_console(stderr=True, highlight=False, soft_wrap=True)
    with console.status("reading the recording"):
        frames = read_frames(layout, folder, version)[::every]
        if baseline.modality.has_cameras:
            frames = [frame for frame in frames if frame.images()]
        if not frames:
            raise InputError(f"{folder}: has no frame with an image, which the {baseline.modality} model needs")
        ground = ground_pose(frames)
    for line in _facts(baseline, frames, ground):
        console.print(line)
    with counting_bar("frames", console, len(frames)) as bar, write_errors(out):
        found = predict_recording(baseline, frames, layout, ground, out, wanted, bar.advance)
    if found:
        table_console().print(_table(found, wanted.min_points))
    make_console(soft_wrap=True).print(f"{plural(len(frames), 'frame')} predicted in {out}")


def require_new_folder(out: Path) -> None:
    """Check that a folder is new or empty, and can be written to. Raises InputError if not."""
    if path_exists(out) and not (is_folder(out) and not any(out.iterdir())):
        raise InputError(f"{out}: exists already; nothing was overwritten")
    require_writable(out)


def _facts(baseline: "Baseline", frames: "Sequence[RecordedFrame]", ground: Float64Array | None) -> Iterator[str]:
    """What is assumed of a recording, in lines."""
    from simbev_ros.baselines.recordings.model_inputs import BODY_M

    where = "the recording says where the lidar is above the ground"
    if ground is not None:
        roll_deg, pitch_deg, _ = np.degrees(rpy_from_rotation(ground[:3, :3])).tolist()
        where = (
            f"the lidar is about {ground[2, 3]:.2f} m above the ground, pitch {pitch_deg:.1f}°, roll {roll_deg:.1f}°"
        )
    yield f"{where}; points within {BODY_M:g} m of it are left out"
    if all(frame.sweep.map_from_lidar is None for frame in frames):
        yield "poses are unknown, so the model sees one sweep, and velocities are arbitrary"
    if baseline.modality.has_cameras:
        seen = [image.camera for image in frames[0].images()]
        missing = f", and {baseline.cameras - len(seen)} black images" if len(seen) < baseline.cameras else ""
        yield f"the model sees {', '.join(seen[: baseline.cameras]) or 'no camera'}{missing}; lenses must not distort"


def _table(found: "Sequence[Score]", min_points: int) -> Table:
    """The scores of all classes."""
    title = f"average precision by distance < 2 m, within 50 m, {min_points} points or more"
    table = Table(title=title, title_justify="left", box=box.SIMPLE_HEAD, pad_edge=False)
    for heading in ("", "labels", "AP", "95 % interval", "recall"):
        table.add_column(heading, justify="right" if heading else "left", min_width=10)
    for score in found:
        interval = "–" if score.interval is None else f"{score.interval[0]:.2f} to {score.interval[1]:.2f}"
        table.add_row(score.name, str(score.boxes), f"{score.precision:.2f}", interval, f"{score.recall:.2f}")
    return table
