"""COCO's layout: images by split, and a file of annotations for each split, with masks as run lengths.

The format is that of COCO's object detection task (https://cocodataset.org/#format-data). There the corner of the first
pixel is 0, 0, so edges of boxes are half a pixel higher than in bags.
"""

import json
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import count
from pathlib import Path

import numpy as np
from pycocotools import mask as run_lengths

from simbev_exporters.labeled_images.layout import ImagePart, Layout, Sample, image_stem
from simbev_ros import __version__
from simbev_ros.config.scenario import SPLITS
from simbev_ros.dataset import Frame
from simbev_ros.export.parts import Json
from simbev_ros.export.sensor_data import recorded_jpeg
from simbev_ros.foundation.files.whole_files import write_whole

_DECIMALS = 4
_ANNOTATIONS = "annotations"


@dataclass(frozen=True, kw_only=True)
class Coco(Layout):
    """COCO's layout: ``<split>/*.jpg`` and ``annotations/instances_<split>.json``."""

    name = "coco"
    folders = (*SPLITS, _ANNOTATIONS)

    def keys(self, camera: str) -> tuple[str, ...]:
        """Keys that a frame needs for an image of a camera."""
        return (*super().keys(camera), f"{camera}/instance")

    def sample(self, frame: Frame, camera: str) -> Sample:
        """One image as recorded; its facts are its row and those of its annotations, without ids."""
        views, instances = self.objects(frame, camera), frame[f"{camera}/instance"]
        masks = instances[..., None] == views["id"]
        shapes = run_lengths.encode(np.asfortranarray(masks, np.uint8))
        height_px, width_px = instances.shape
        file = f"{image_stem(frame, camera)}.jpg"
        image = {"file_name": file, "width": width_px, "height": height_px}
        about = {"scene": frame.scene.name, "camera": camera, "tick": frame.tick}
        annotations = [
            {
                "category_id": category + 1,
                "iscrowd": 0,
                "area": int(run_lengths.area(shape)),
                "bbox": run_lengths.toBbox(shape).tolist(),
                "segmentation": {"size": [height_px, width_px], "counts": shape["counts"].decode("ascii")},
                "track_id": int(view["id"]),
                "visibility": round(float(view["visibility"]), _DECIMALS),
                "truncation": round(float(view["truncation"]), _DECIMALS),
            }
            for view, category, shape in zip(views, self.categories(views), shapes, strict=True)
        ]
        files = {f"{frame.scene.split}/{file}": recorded_jpeg(frame, f"{camera}/rgb")}
        return Sample(files, len(views), {"image": image | about, "annotations": annotations})

    def finish(self, out: Path, parts: Sequence[ImagePart]) -> None:
        """Write the annotations of each split that has a scene."""
        for split in SPLITS:
            file, of_split = (
                out / _ANNOTATIONS / f"instances_{split}.json",
                [p for p in parts if p.scene.split == split],
            )
            if of_split:
                write_whole(file, self._content(of_split))
            else:
                file.unlink(missing_ok=True)

    def _content(self, parts: Sequence[ImagePart]) -> Iterator[bytes]:
        """Content of the annotations of a split, scene by scene, as it may be too large for the memory."""
        head: Json = {
            "info": {"description": "simbev_ros", "version": __version__},
            "licenses": [],
            "categories": [{"id": index, "name": name} for index, name in enumerate(self.classes, start=1)],
        }
        yield _json(head)[:-1]
        yield from _list("images", ({"id": number, **facts["image"]} for number, facts in _images(parts)))
        rows = ((number, row) for number, facts in _images(parts) for row in facts["annotations"])
        yield from _list("annotations", ({"id": i, "image_id": n, **row} for i, (n, row) in enumerate(rows, start=1)))
        yield b"}\n"


def _images(parts: Sequence[ImagePart]) -> Iterator[tuple[int, Json]]:
    """Number, from 1 on, and facts of each image of a split."""
    numbers = count(1)
    for part in parts:
        yield from ((number, facts) for facts, number in zip(part.finished_record()["facts"], numbers, strict=False))


def _list(name: str, rows: Iterator[Json]) -> Iterator[bytes]:
    yield f', "{name}": ['.encode()
    for index, row in enumerate(rows):
        yield b",\n" * (index > 0) + _json(row)
    yield b"]"


def _json(value: Json) -> bytes:
    return json.dumps(value).encode()
