"""YOLO's layout: images and text files of labels by split, and ``data.yaml`` with the categories.

The format is that of ultralytics (https://docs.ultralytics.com/datasets/detect/ and /segment/): a line for each object
with the index of its category, then the box's center and size, or the corners of its outline, as shares of the image's
size. The corner of the first pixel is 0, 0.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import yaml

from simbev_exporters.labeled_images.layout import HALF_PX, ImagePart, Layout, Sample, image_stem
from simbev_exporters.yolo.outlines import outline
from simbev_ros.config.scenario import SPLITS
from simbev_ros.dataset import Frame, columns
from simbev_ros.export.sensor_data import recorded_jpeg
from simbev_ros.foundation.files.whole_files import write_whole
from simbev_ros.foundation.types import AnyArray, Float64Array

_DECIMALS = 6
_DATA = "data.yaml"


@dataclass(frozen=True, kw_only=True)
class Yolo(Layout):
    """YOLO's layout: ``images/<split>/*.jpg``, ``labels/<split>/*.txt`` and ``data.yaml``.

    Attributes:
        segments: Whether labels are outlines of the visible parts of objects instead of boxes around these.
    """

    name = "yolo"
    folders = ("images", "labels")

    segments: bool = False

    def keys(self, camera: str) -> tuple[str, ...]:
        """Keys that a frame needs for an image of a camera."""
        return (*super().keys(camera), *([f"{camera}/instance"] if self.segments else []))

    def sample(self, frame: Frame, camera: str) -> Sample:
        """One image as recorded, and its labels; the file of an image without objects is empty."""
        views = self.objects(frame, camera)
        size_px = np.array(frame.scene.calibration[camera].size_px, np.float64)
        low, high = (columns(views, *s).astype(np.float64) + HALF_PX for s in (("left", "top"), ("right", "bottom")))
        if self.segments:
            instances: AnyArray = frame[f"{camera}/instance"]
            boxes = zip(views["id"].tolist(), low, high, strict=True)
            labels = [outline(instances == number, *box) / size_px for number, *box in boxes]
        else:
            labels = list(np.stack([(low + high) / 2.0, high - low], axis=1) / size_px)
        lines = [_line(*each) for each in zip(self.categories(views), labels, strict=True)]
        stem = f"{frame.scene.split}/{image_stem(frame, camera)}"
        image = recorded_jpeg(frame, f"{camera}/rgb")
        files = {f"images/{stem}.jpg": image, f"labels/{stem}.txt": "".join(lines).encode("ascii")}
        return Sample(files, len(lines), {})

    def finish(self, out: Path, parts: Sequence[ImagePart]) -> None:
        """Write ``data.yaml``; without the key ``path``, readers search the splits next to it."""
        splits = [split for split in SPLITS if any(part.scene.split == split for part in parts)]
        names: dict[str, Any] = {"names": dict(enumerate(self.classes))}
        content = {split: f"images/{split}" for split in splits} | names
        write_whole(out / _DATA, yaml.safe_dump(content, sort_keys=False).encode())


def _line(category: int, points: Float64Array) -> str:
    """Line of a label: the index of its category, then (N, 2) numbers."""
    return " ".join([str(category), *(f"{value:.{_DECIMALS}f}" for value in points.ravel().tolist())]) + "\n"
