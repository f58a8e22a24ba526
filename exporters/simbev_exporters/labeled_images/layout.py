"""A layout of labeled images, in which each image of a camera has files of its own, and its part, one scene.

A frame and the name of a camera enter; a ``Sample`` leaves, the files of one image. Coco, Yolo and Kitti are the
layouts; they are small and frozen, because they are sent to other processes, and their fields identify parts.
"""

from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass
from glob import escape
from itertools import groupby
from operator import itemgetter
from pathlib import Path
from typing import ClassVar, NamedTuple

import numpy as np

from simbev_exporters.recorded_sensors import recorded_cameras
from simbev_exporters.scene_parts import PartOfScene
from simbev_ros.dataset import Frame, Scene
from simbev_ros.dataset.frame_period import frame_period
from simbev_ros.dataset.parallel import report_step
from simbev_ros.export.parts import Json
from simbev_ros.foundation.errors import BagError
from simbev_ros.foundation.semantics import BOX_CLASSES, MOVING_CLASSES
from simbev_ros.foundation.types import Table

HALF_PX = 0.5
"""Edges of boxes in bags are half a pixel lower than where the corner of the first pixel is 0, 0."""


class Sample(NamedTuple):
    """One exported image.

    Attributes:
        files: Contents of the files of the image, by their paths relative to the export.
        objects: Number of labeled objects in it.
        facts: What the last stage of the export needs to know of the image. Plain values.
    """

    files: dict[str, bytes]
    objects: int
    facts: Json


@dataclass(frozen=True, slots=True, kw_only=True)
class ImagePart(PartOfScene):
    """The images of one scene as a part of the export. Its record has their number, that of ``objects``, and ``facts``.

    Attributes:
        layout: The layout.
    """

    layout: "Layout"


@dataclass(frozen=True, kw_only=True)
class Layout(ABC):
    """A layout with its settings.

    Attributes:
        name: Name of the layout, as in the command.
        folders: Folders that hold its files.
        camera_option: Name of the option that chooses cameras.
        left_out: The reason why a recorded camera can be left out, in words that follow "as".
        rate_hz: Number of exported frames per second.
        classes: Classes of exported objects, in the order of the categories.
        min_pixels: Minimum number of visible pixels of an object, at least 1.
        cameras: Names of the cameras; None: all that have what the layout needs.
    """

    name: ClassVar[str]
    folders: ClassVar[tuple[str, ...]]
    camera_option: ClassVar[str] = "cameras"
    left_out: ClassVar[str] = "no boxes were recorded in their images, or no instances"

    rate_hz: float = 2.0
    classes: tuple[str, ...] = MOVING_CLASSES
    min_pixels: int = 1
    cameras: tuple[str, ...] | None = None

    @abstractmethod
    def sample(self, frame: Frame, camera: str) -> Sample:
        """One image of a frame, which has ``keys``.

        Raises:
            BagError: The bag is damaged.
        """

    @abstractmethod
    def finish(self, out: Path, parts: Sequence[ImagePart]) -> None:
        """Write the files that belong to no part, from the finished parts.

        Raises:
            OSError: A file cannot be written.
        """

    def keys(self, camera: str) -> tuple[str, ...]:
        """Keys that a frame needs for an image of a camera."""
        return f"{camera}/rgb", f"{camera}/boxes"

    def stem(self, scene: Scene) -> str:
        """Begin of the names of a scene's files, from which ``patterns`` follow."""
        return scene.name

    def patterns(self, stem: str) -> tuple[str, ...]:
        """Glob patterns of all files that a part can have."""
        return tuple(f"{folder}/**/{escape(stem)}__*" for folder in self.folders)

    def cameras_of(self, scene: Scene) -> list[str]:
        """Cameras of a scene that have what the layout needs, and are chosen."""
        names = recorded_cameras(scene) if self.cameras is None else self.cameras
        return [name for name in names if all(key in scene.sources for key in self.keys(name))]

    def images_of(self, scene: Scene) -> list[tuple[int, str]]:
        """Tick and camera of the images of a scene, in order of time.

        Raises:
            InputError: The rate does not divide that of the scene's frames.
            BagError: There are none, or the bag cannot be read.
        """
        period = frame_period(scene, self.rate_hz, "rate_hz")
        cameras = self.cameras_of(scene)
        found = [(tick, name) for name in cameras for tick in np.flatnonzero(scene.has(self.keys(name))).tolist()]
        images = [(tick, name) for tick, name in found if tick % period == 0]
        if not images:
            wanted = ", ".join(self.keys(self.cameras[0] if self.cameras else "CAMERA"))
            raise BagError(f"{scene.path}: no frame of {self.rate_hz:g} per second has {wanted}")
        return sorted(images, key=lambda image: image[0])

    def objects(self, frame: Frame, camera: str) -> Table:
        """(K,) ``VIEW_DTYPE`` rows of the objects of the classes that a camera sees."""
        views: Table = frame[f"{camera}/boxes"]
        wanted = np.isin(views["class"], [BOX_CLASSES.index(name) for name in self.classes])
        return views[wanted & (views["visible_px"] >= max(self.min_pixels, 1))]

    def categories(self, views: Table) -> list[int]:
        """Indices in ``classes`` of the classes of objects."""
        return [self.classes.index(BOX_CLASSES[number]) for number in views["class"].tolist()]


def make_part(part: ImagePart) -> None:
    """Make the files of one scene, in any process; each image is a step of parallel work.

    Raises:
        InputError: A file cannot be written.
        BagError: The bag is damaged.
    """
    facts, objects = [], 0
    part.begin()
    for tick, images in groupby(part.layout.images_of(part.scene), key=itemgetter(0)):
        frame = part.scene[tick]
        for _, camera in images:
            sample = part.layout.sample(frame, camera)
            for path, content in sample.files.items():
                part.write(path, content)
            facts.append(sample.facts)
            objects += sample.objects
            report_step()
    part.finish({"images": len(facts), "objects": objects, "facts": facts})


def image_stem(frame: Frame, camera: str) -> str:
    """Name of an image without its suffix: its scene, camera and tick."""
    return f"{frame.scene.name}__{camera}__{frame.tick:06d}"
