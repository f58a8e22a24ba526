"""Defines the panels of a contact sheet: the keys, the caption, and the function that draws each from a frame.

What is shown of a scene (``Views``) enters; one ``Panel`` for each picture of the sheet leaves.
"""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

from simbev_ros.config.camera import Camera
from simbev_ros.config.modalities import IMAGE_KINDS
from simbev_ros.drawing import panels
from simbev_ros.drawing.canvas import Box
from simbev_ros.foundation.errors import BagError
from simbev_ros.foundation.geometry.transforms import inverse
from simbev_ros.foundation.types import Float64Array, UInt8Array
from simbev_ros.show.sheet import overlay
from simbev_ros.show.sheet.frames import SheetFrame
from simbev_ros.show.sheet.truth import Truth
from simbev_ros.show.sheet.views import LabeledCamera, Views

LABEL_PANEL = "labels"
"""Key of the picture with labels, which is a second picture of a camera; other panels have a key of the frames."""

_Paint = Callable[[SheetFrame, Box], UInt8Array]


@dataclass(frozen=True, slots=True)
class Panel:
    """One picture of a contact sheet.

    Attributes:
        key: Name of the picture in the layout.
        keys: Keys of frames that it shows; if a frame has none of them, the picture stays empty.
        title: Caption.
        note: Addition to the caption.
        paint: Draws the picture of a frame for a box.
    """

    key: str
    keys: Sequence[str]
    title: str
    note: str
    paint: _Paint


@dataclass(frozen=True, slots=True)
class PanelPainter:
    """Factory of the panels of a sheet.

    Attributes:
        views: What is shown.
        half_extent_m: Distance from the ego to the left edge of a picture from above.
        scale: Width of thin lines, pixels.
    """

    views: Views
    half_extent_m: float
    scale: float

    def panels(self) -> Iterator[Panel]:
        """All panels of the sheet, in reading order."""
        views, main = self.views, self.views.main_camera
        for camera, key in views.cameras.items():
            labeled = views.labeled.get(camera) if views.labels == "cameras" else None
            yield Panel(key, [key], _caption(camera), "", self._camera(key, labeled))
        rgb = views.cameras.get(main)
        for modality, key in views.modalities.items():
            entry = panels.MODALITY_PICTURES[modality]
            note = ", ".join(part for part in (_caption(main).lower(), entry.note) if part)
            yield Panel(key, [key], IMAGE_KINDS[modality].title, note, _modality(key, rgb, entry.picture))
        if views.label_panel is not None:
            camera, each = views.label_panel
            note = f"{_caption(camera).lower()}, boxes and ground"
            yield Panel(LABEL_PANEL, [each.rgb], "Labels", note, self._camera(each.rgb, each))
        if views.points is not None:
            yield Panel(views.points, [views.points], "Lidar", "from above, by class", self._lidar(views.points))
        if views.radars:
            keys = list(views.radars)
            yield Panel(keys[0], keys, "Radar", "blue approaches, red recedes", self._radars)
        if views.bev is not None:
            yield Panel(views.bev, [views.bev], "Bird's-eye view", "ground truth", self._bev(views.bev))

    def _camera(self, key: str, labeled: LabeledCamera | None) -> _Paint:
        def paint(frame: SheetFrame, box: Box) -> UInt8Array:
            rgb, truth = frame.arrays[key], frame.truths.get(key)
            if labeled is None or truth is None:
                return rgb
            _require_size(key, rgb, labeled.camera)
            return overlay.draw_camera_labels(
                overlay.Sight(rgb, frame.simultaneous(labeled.depth, key), frame.simultaneous(labeled.semantic, key)),
                labeled.camera,
                truth,
                (box.width, box.height),
                half_extent_m=self.half_extent_m,
                line_px=self.scale,
            )

        return paint

    def _lidar(self, key: str) -> _Paint:
        def paint(frame: SheetFrame, box: Box) -> UInt8Array:
            points, pose = frame.arrays[key], self.views.ego_from_lidar
            picture = panels.lidar_picture(points, pose, box.width, self.half_extent_m)
            if truth := frame.truths.get(key):
                self._add_boxes(picture, truth, truth.map_from_ego, "lidar_points")
            return picture

        return paint

    def _radars(self, frame: SheetFrame, box: Box) -> UInt8Array:
        clouds = [(frame.arrays[key], pose) for key, pose in self.views.radars.items() if key in frame.arrays]
        picture = panels.radar_picture(clouds, box.width, self.half_extent_m)
        last = max((key for key in self.views.radars if key in frame.arrays), key=frame.ticks.__getitem__)
        if truth := frame.truths.get(last):
            self._add_boxes(picture, truth, truth.map_from_ego, "radar_points")
        return picture

    def _bev(self, key: str) -> _Paint:
        def paint(frame: SheetFrame, box: Box) -> UInt8Array:
            picture = panels.bev_picture(frame.arrays[key], box.width)
            if truth := frame.truths.get(key):
                self._add_boxes(picture, truth, truth.map_from_grid, "on_ego_level")
            return picture

        return paint

    def _add_boxes(self, picture: UInt8Array, truth: Truth, map_from_frame: Float64Array, faint_without: str) -> None:
        if truth.boxes is not None:
            overlay.draw_boxes_from_above(
                picture,
                truth.boxes,
                inverse(map_from_frame),
                half_extent_m=self.half_extent_m,
                line_px=self.scale,
                faint_without=faint_without,
            )


def _require_size(key: str, rgb: UInt8Array, camera: Camera) -> None:
    height_px, width_px = rgb.shape[:2]
    if (width_px, height_px) != (camera.width_px, camera.height_px):
        raise BagError(
            f"{key}: images of {width_px} x {height_px} pixels, but the camera of the scene's rig has "
            f"{camera.width_px} x {camera.height_px}; without labels they are drawn as they are"
        )


def _modality(key: str, rgb: str | None, picture: panels.DrawModality) -> _Paint:
    return lambda frame, box: picture(frame.arrays[key], frame.arrays.get(rgb) if rgb else None, box.width)


def _caption(camera: str) -> str:
    """A camera's name as a caption: ``cam_front_left`` → ``Front left``."""
    return camera.removeprefix("cam_").replace("_", " ").capitalize()
