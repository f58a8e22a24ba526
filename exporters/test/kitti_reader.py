"""Reads frames in KITTI's layout as its devkit describes the files, without code of the exporter."""

from pathlib import Path
from typing import NamedTuple

import cv2
import numpy as np

from simbev_ros.foundation.types import Float32Array, Float64Array, UInt8Array


class Label(NamedTuple):
    """A line of ``label_2``: box is left, top, right, bottom; size_m is height, width, length."""

    type: str
    truncated: float
    occluded: int
    alpha: float
    box: Float64Array
    size_m: Float64Array
    location_m: Float64Array
    rotation_y: float

    def corners_m(self) -> Float64Array:
        """(8, 3) corners in the camera's frame, by the devkit's ``computeBox3D``."""
        height, width, length = self.size_m
        signs = np.array(
            [[1, 0, 1], [1, 0, -1], [-1, 0, -1], [-1, 0, 1], [1, -2, 1], [1, -2, -1], [-1, -2, -1], [-1, -2, 1]]
        )
        return signs * [length / 2, height / 2, width / 2] @ self._rotation().T + self.location_m

    def contains(self, points_m: Float64Array) -> Float64Array:
        """(N,) whether points of the camera's frame are inside."""
        height, width, length = self.size_m
        local = (points_m - self.location_m) @ self._rotation() + [0, height / 2, 0]
        return (np.abs(local) <= np.array([length, height, width]) / 2).all(axis=1)

    def _rotation(self) -> Float64Array:
        c, s = np.cos(self.rotation_y), np.sin(self.rotation_y)
        return np.array([[c, 0, s], [0, 1, 0], [-s, 0, c]])


class KittiFrame:
    """The files of one frame in ``training`` or ``testing``."""

    def __init__(self, folder: Path, number: str) -> None:
        self._folder, self._number = folder, number
        lines = (folder / f"calib/{number}.txt").read_text().splitlines()
        self.calibration = {name: np.array(v.split(), np.float64) for name, v in (each.split(":") for each in lines)}

    def labels(self) -> list[Label]:
        lines = (self._folder / f"label_2/{self._number}.txt").read_text().splitlines()
        return [_label(line.split()) for line in lines]

    def image(self) -> UInt8Array:
        """(H, W, 3) RGB."""
        image = cv2.imread(str(self._folder / f"image_2/{self._number}.png"), cv2.IMREAD_UNCHANGED)
        assert image is not None
        return np.asarray(image[..., ::-1], np.uint8)

    def cloud(self) -> Float32Array:
        """(N, 4) x, y, z in the lidar's frame, and intensity."""
        return np.fromfile(self._folder / f"velodyne/{self._number}.bin", np.float32).reshape(-1, 4)

    def points_in_camera(self) -> Float64Array:
        """(N, 3) lidar points in the rectified camera frame."""
        rotation, transform = (
            self.calibration["R0_rect"].reshape(3, 3),
            self.calibration["Tr_velo_to_cam"].reshape(3, 4),
        )
        return (self.cloud()[:, :3] @ transform[:, :3].T + transform[:, 3]) @ rotation.T

    def project(self, points_m: Float64Array) -> Float64Array:
        """(N, 2) pixels of points of the rectified camera frame."""
        image = np.column_stack([points_m, np.ones(len(points_m))]) @ self.calibration["P2"].reshape(3, 4).T
        return image[:, :2] / image[:, 2:]


def _label(words: list[str]) -> Label:
    assert len(words) == 15
    numbers = np.array(words[1:], np.float64)
    return Label(
        words[0], numbers[0], int(words[2]), numbers[2], numbers[3:7], numbers[7:10], numbers[10:13], numbers[13]
    )
