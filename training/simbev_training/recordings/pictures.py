"""Draws a frame of a recording: its images with boxes, and the scene from above with points, boxes and the grid."""

from collections.abc import Sequence

import cv2
import numpy as np

from simbev_ros.baselines.grid import HALF_M
from simbev_ros.baselines.inference import Answer
from simbev_ros.baselines.recordings.model_inputs import FrameView, Photo
from simbev_ros.drawing.canvas import BACKGROUND, BOLD, Box, draw_label, draw_picture, draw_text, text_width
from simbev_ros.drawing.panels import bev_picture, heights_picture
from simbev_ros.foundation.geometry.transforms import apply
from simbev_ros.foundation.semantics import BEV_CLASSES, BOX_CLASSES
from simbev_ros.foundation.types import Float64Array, Table, UInt8Array, UInt16Array
from simbev_ros.schema.boxes import blank_boxes
from simbev_ros.schema.palette import class_color
from simbev_ros.show.sheet.layout import Block, Column, Row, Tile, place_in_width
from simbev_ros.show.sheet.overlay import draw_boxes_from_above, draw_wireframes

_WIDTH_PX, _MARGIN_PX, _GAP_PX, _HEADER_PX, _RADIUS_PX = 1920, 24, 10, 66, 7
_CLOUD, _GRID = "cloud", "grid"
_HALF_M = 50.0
_IN_A_ROW = 3
_ON_GRID = 128
"""Score, out of 255, from which a cell of the grid is drawn."""
_MIN_HEIGHT_PX = 18.0
"""Height of a box in an image from which on its score is written."""
_SMALL, _LEGEND = 13.0, 15.0
_GRAY, _GRAY_CLASS = (193, 193, 193), 255
"""Color of labels, and the class that is drawn in it."""


def draw_frame(title: str, view: FrameView, answer: Answer, labels: Table | None, min_score: float) -> UInt8Array:
    """Draw a frame as (H, W, 3) uint8 RGB.

    Args:
        title: What it is, above the picture.
        view: What it shows.
        answer: The answer of a model.
        labels: (N,) ``baselines.boxes.BOX_DTYPE``, ego frame, which are drawn in gray; None: there are none.
        min_score: Score from which boxes are drawn.
    """
    boxes = answer.boxes[answer.boxes["score"] >= min_score][::-1]  # the most certain ones are drawn last
    known = np.zeros(0, boxes.dtype) if labels is None else labels
    places = place_in_width(_layout(view), _MARGIN_PX, _HEADER_PX, _WIDTH_PX - 2 * _MARGIN_PX, _GAP_PX)
    height = max(place.top + place.height for place in places.values()) + _MARGIN_PX
    sheet = np.full((height + height % 2, _WIDTH_PX, 3), BACKGROUND, np.uint8)
    _draw_header(sheet, title, boxes, has_labels=labels is not None)
    for name, photo in view.photos.items():
        picture = _resized(photo.rgb, (places[name].width, places[name].height))
        _draw_on_photo(picture, photo, known, boxes)
        _place(sheet, picture, places[name], name.removeprefix("CAM_").replace("_", " ").capitalize(), "")
    width = places[_CLOUD].width
    cloud = heights_picture(view.points[view.points[:, 3] == 0, :3], width, _HALF_M)
    _draw_from_above(cloud, known, boxes)
    _place(sheet, cloud, places[_CLOUD], "Lidar", f"newest sweep within {_HALF_M:.0f} m, boxes with scores")
    grid = bev_picture(_labels_of(answer.cells), width)
    _draw_from_above(grid, known, boxes[:0])
    _place(sheet, grid, places[_GRID], "Bird's-eye view", "the same area, cells with scores above 0.5")
    return sheet


def _layout(view: FrameView) -> Block:
    """Images in rows of three; below them the two views from above."""
    tiles = [Tile(name, photo.camera.width_px / photo.camera.height_px) for name, photo in view.photos.items()]
    rows = [Row(tiles[first : first + _IN_A_ROW]) for first in range(0, len(tiles), _IN_A_ROW)]
    return Column([*rows, Row([Tile(_CLOUD, 1.0), Tile(_GRID, 1.0)])])


def _place(sheet: UInt8Array, picture: UInt8Array, place: Box, title: str, note: str) -> None:
    draw_picture(sheet, picture, place, _RADIUS_PX)
    draw_label(sheet, place, title, note, 1.0)


def _draw_header(sheet: UInt8Array, title: str, boxes: Table, *, has_labels: bool) -> None:
    """Write the title, and a legend with the number of boxes of each class."""
    draw_text(sheet, title, _MARGIN_PX, 42, size=24, weight=BOLD)
    counts = np.bincount(boxes["class"], minlength=len(BOX_CLASSES)).tolist()
    entries = [(f"{name} {count}", class_color(name)) for name, count in zip(BOX_CLASSES, counts, strict=True) if count]
    entries += [("labeled", _GRAY)] if has_labels else []
    right = float(_WIDTH_PX - _MARGIN_PX)
    for text, color in reversed(entries):
        right = draw_text(sheet, text, right, 41, size=_LEGEND, right=True) - 20
        cv2.rectangle(sheet, (round(right), 29), (round(right) + 13, 42), color, -1, cv2.LINE_AA)
        right -= 16


def _draw_on_photo(picture: UInt8Array, photo: Photo, labels: Table, boxes: Table) -> None:
    """Draw boxes, and the scores of those that are large enough, over an image, in place."""
    for table, line_px in ((_drawable(labels, _GRAY_CLASS), 1.0), (_drawable(boxes), 2.0)):
        draw_wireframes(picture, table, photo.camera, photo.optical_from_ego, None, line_px)
    scale = picture.shape[1] / photo.camera.width_px
    top = apply(photo.optical_from_ego, np.stack([boxes["x"], boxes["y"], boxes["z"] + boxes["height"] / 2.0], 1))
    is_large = top[:, 2] * _MIN_HEIGHT_PX < boxes["height"] * photo.camera.fy_px * scale
    is_large &= top[:, 2] > 1.0
    _write_scores(picture, photo.camera.project(top[is_large]) * scale - [0.0, 5.0], boxes[is_large])


def _draw_from_above(picture: UInt8Array, labels: Table, boxes: Table) -> None:
    """Draw boxes with their scores over a picture from above, in place."""
    for table, line_px in ((_drawable(labels, _GRAY_CLASS), 1.0), (_drawable(boxes), 2.0)):
        draw_boxes_from_above(
            picture, table, np.eye(4), half_extent_m=_HALF_M, line_px=line_px, faint_without="lidar_points"
        )
    ahead_m = np.stack([boxes["y"], boxes["x"] + np.maximum(boxes["length"], boxes["width"]) / 2.0], 1)
    _write_scores(picture, (1.0 - ahead_m / _HALF_M) * len(picture) / 2.0 - [0.0, 3.0], boxes)


def _drawable(boxes: Table, label: int | None = None) -> Table:
    """The boxes as rows of ground truth, which are drawn in the color of another class if one is given."""
    result = blank_boxes(len(boxes))
    for name in ("x", "y", "z", "length", "width", "height", "yaw", "class"):
        result[name] = boxes[name]
    result["distance"], result["lidar_points"] = np.hypot(boxes["x"], boxes["y"]), 1
    if label is not None:
        result["class"] = label
    return result


def _write_scores(picture: UInt8Array, pixels: Float64Array, boxes: Table) -> None:
    """Write the scores of boxes, centered at pixels, where there is room."""
    height, width = picture.shape[:2]
    for (x, y), box in zip(pixels.tolist(), boxes, strict=True):
        text = f"{box['score']:.2f}".removeprefix("0")
        left = x - text_width(text, _SMALL) / 2.0
        if 2 < left < width - 30 and 20 < y < height - 10:
            red, green, blue = (round(0.6 * channel + 0.4 * 255) for channel in class_color(BOX_CLASSES[box["class"]]))
            draw_text(picture, text, left, y, size=_SMALL, color=(red, green, blue), weight=BOLD)


def _labels_of(cells: UInt8Array) -> UInt16Array:
    """The part of the grid that is drawn, with bit k of a cell for class k."""
    inside = round(len(cells) * _HALF_M / HALF_M / 2.0)
    middle = slice(len(cells) // 2 - inside, len(cells) // 2 + inside)
    bits = (cells[middle, middle] >= _ON_GRID).astype(np.uint16) << np.arange(len(BEV_CLASSES), dtype=np.uint16)
    return np.asarray(np.bitwise_or.reduce(bits, axis=2), np.uint16)


def _resized(rgb: UInt8Array, size_px: Sequence[int]) -> UInt8Array:
    method = cv2.INTER_AREA if rgb.shape[1] > size_px[0] else cv2.INTER_CUBIC
    return np.asarray(cv2.resize(rgb, (size_px[0], size_px[1]), interpolation=method), np.uint8)
