"""Makes the labels of an image in KITTI's form: a line for each object, with its boxes in 2D and 3D.

Rows of ``boxes`` and of a camera's views enter; lines leave. KITTI's boxes are level with the camera, so roll and pitch
of an object against it are lost; the center of a box stays. Angles are about the camera's y axis, which points down.
The format is documented in the devkit of KITTI's object benchmark (``readme.txt``). Pixel centers are at integers there
too.
"""

from functools import cache

import numpy as np

from simbev_ros.dataset import Frame, columns
from simbev_ros.foundation.geometry.camera import LensCamera, PinholeCamera
from simbev_ros.foundation.geometry.fisheye import FisheyeCamera
from simbev_ros.foundation.geometry.transforms import apply, inverse, rotations_from_rpy
from simbev_ros.foundation.semantics import BOX_CLASSES
from simbev_ros.foundation.tables import load_table
from simbev_ros.foundation.types import Float64Array, Table

_OCCLUDED = (0.8, 0.4)
"""Visibility below which an object is partly occluded, 1, and largely occluded, 2."""

_SIDES = ("amodal_left", "amodal_top", "amodal_right", "amodal_bottom")
_MIN_AHEAD = 1e-3
_SAMPLES = 33
"""Number of points along a side of a box whose image is rectified."""


def label_lines(frame: Frame, camera: str, views: Table) -> list[str]:
    """Lines of the objects of an image, without those that the rectified image does not show.

    Args:
        frame: The frame.
        camera: Name of the camera.
        views: (K,) ``VIEW_DTYPE`` rows of the objects.
    """
    calibration, boxes = frame.scene.calibration[camera], frame["boxes"]
    row_of = {number: row for row, number in enumerate(boxes["id"].tolist())}
    views = views[np.isin(views["id"], boxes["id"])]
    sides_px = image_boxes(views, calibration.camera)
    is_shown = (sides_px[:, :2] < sides_px[:, 2:]).all(axis=1)
    views, sides_px = views[is_shown], sides_px[is_shown]
    boxes = boxes[[row_of[number] for number in views["id"].tolist()]]
    occlusion = np.sum([views["visibility"] < limit for limit in _OCCLUDED], axis=0)
    numbers = np.column_stack([sides_px, poses_in_camera(boxes, inverse(frame.map_from_optical(camera)))])
    numbers = np.round(numbers, 4) + 0.0  # without negative zeros
    rows = zip(_types(frame, boxes), views["truncation"], occlusion, numbers[:, -1], numbers[:, :-1], strict=True)
    return [
        f"{name} {truncation:.2f} {level} {alpha:.4f} {' '.join(f'{number:.4f}' for number in others)}\n"
        for name, truncation, level, alpha, others in rows
    ]


def poses_in_camera(boxes: Table, optical_from_map: Float64Array) -> Float64Array:
    """(N, 8) height, width, length; x, y, z of the center of the lower face; rotation_y and alpha. Meters and radians.

    Args:
        boxes: (N,) ``BOX_DTYPE``.
        optical_from_map: (4, 4) transform to the camera's optical frame.
    """
    size_m = columns(boxes, "height", "width", "length").astype(np.float64)
    bottom_m = apply(optical_from_map, columns(boxes, "x", "y", "z")) + size_m[:, :1] / 2.0 * [0.0, 1.0, 0.0]
    map_from_box = rotations_from_rpy(columns(boxes, "roll", "pitch", "yaw").astype(np.float64))
    ahead = map_from_box[:, :, 0] @ optical_from_map[:3, :3].T
    rotation_y = np.arctan2(-ahead[:, 2], ahead[:, 0])
    alpha = rotation_y - np.arctan2(bottom_m[:, 0], bottom_m[:, 2])
    return np.column_stack([size_m, bottom_m, rotation_y, (alpha + np.pi) % (2.0 * np.pi) - np.pi])


def image_boxes(views: Table, camera: PinholeCamera | None) -> Float64Array:
    """(K, 4) left, top, right, bottom of objects, hidden parts included, in the rectified image. Cut off at its edges.

    Where the lens distorts, the box around the rectified outline of the box replaces that of the silhouette: it is not
    smaller. Parts of the outline outside the image circle of a fisheye are left out.

    Args:
        views: (K,) ``VIEW_DTYPE`` rows.
        camera: The camera.
    """
    assert camera is not None
    low, high = [-0.5, -0.5] * 2, [camera.width_px - 0.5, camera.height_px - 0.5] * 2
    sides = np.clip(columns(views, *_SIDES).astype(np.float64), low, high)
    if not isinstance(camera, LensCamera | FisheyeCamera):
        return sides
    share = np.linspace(0.0, 1.0, _SAMPLES)
    along = np.stack([np.stack([share, np.full(_SAMPLES, end)], axis=1) for end in (0.0, 1.0)]).reshape(-1, 2)
    along = np.concatenate([along, along[:, ::-1]])
    outline_px = sides[:, None, :2] + along * (sides[:, None, 2:] - sides[:, None, :2])
    rays = camera.rays(outline_px.reshape(-1, 2))
    aside = rays[:, :2] / np.maximum(rays[:, 2:], _MIN_AHEAD)  # what is beside or behind the camera is far outside
    rectified = (np.column_stack([aside, np.ones(len(aside))]) @ camera.matrix.T)[:, :2].reshape(outline_px.shape)
    ends = np.fmin.reduce(rectified, axis=1), np.fmax.reduce(rectified, axis=1)
    return np.clip(np.concatenate(ends, axis=1), low, high)


def _types(frame: Frame, boxes: Table) -> list[str]:
    """KITTI's types of boxes."""
    blueprints, table = frame.scene.constants.get("world/legend", {}).get("blueprints", []), _types_of()
    names = [blueprints[b]["name"] if b < len(blueprints) else "" for b in boxes["blueprint"].tolist()]
    classes = [BOX_CLASSES[number] for number in boxes["class"].tolist()]
    pairs = zip(names, classes, strict=True)
    return [table["of_blueprint"].get(name) or table["of_class"].get(box_class, "Misc") for name, box_class in pairs]


@cache
def _types_of() -> dict[str, dict[str, str]]:
    return load_table("simbev_exporters.kitti", "types.yaml")
