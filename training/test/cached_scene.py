"""A cache with one scene that is written by hand: two boxes on a flat road, seen by a lidar and six cameras."""

import json
from pathlib import Path

import cv2
import numpy as np

from simbev_ros.baselines.grid import CELLS
from simbev_ros.foundation.semantics import BEV_CLASSES, BOX_CLASSES
from simbev_ros.foundation.types import Float64Array
from simbev_training.cache.layout import BOX_DTYPE, FORMAT, FRAME_DTYPE, SCENE_FILE, SWEEP_DTYPE

WIDTH_PX, HEIGHT_PX = 64, 32
CAMERAS = 6
CAR, PEDESTRIAN = (10.0, 4.0, 0.8), (-6.0, -3.0, 0.9)
"""Centers of the boxes."""
YAW_RAD = 0.5


def write_cached_scene(cache: Path, frames: int = 2, name: str = "Plain-0000", split: str = "train") -> Path:
    """Write the scene; return its folder."""
    folder = cache / split / name
    folder.mkdir(parents=True)
    rng = np.random.default_rng(0)
    poses = np.tile(np.eye(4), (frames, 1, 1))
    poses[:, 0, 3] = 5.0 * np.arange(frames)
    ground = np.column_stack([rng.uniform(-40, 40, (3000, 2)), np.zeros(3000)])
    points = np.concatenate([ground, _inside(CAR, (4.0, 2.0, 1.6), rng), _inside(PEDESTRIAN, (0.6, 0.6, 1.8), rng)])
    sweeps, table = np.zeros(frames, SWEEP_DTYPE), np.zeros(frames, FRAME_DTYPE)
    boxes = np.zeros(2 * frames, BOX_DTYPE)
    for index in range(frames):
        sweeps[index] = (index * 250_000_000, poses[index], (index + 1) * len(points))
        table[index] = (10 * index, index * 250_000_000, poses[index], 2 * index + 2)
        for box, center, size, label in (
            (boxes[2 * index], CAR, (4.0, 2.0, 1.6), "car"),
            (boxes[2 * index + 1], PEDESTRIAN, (0.6, 0.6, 1.8), "pedestrian"),
        ):
            box["x"], box["y"], box["z"] = center
            box["length"], box["width"], box["height"] = size
            box["yaw"], box["vx"], box["points"], box["visibility"] = YAW_RAD, 2.0, 20, 1.0
            box["class"] = BOX_CLASSES.index(label)
    cells = np.zeros((frames, CELLS, CELLS), np.uint16)
    cells[:, 100:260, 150:210] |= 1 << BEV_CLASSES.index("road")
    row, column = int((72 - CAR[0]) / 0.4), int((72 - CAR[1]) / 0.4)
    cells[:, row - 3 : row + 4, column - 3 : column + 4] |= 1 << BEV_CLASSES.index("car")
    jpeg = np.asarray(cv2.imencode(".jpg", rng.integers(0, 255, (HEIGHT_PX, WIDTH_PX, 3), np.uint8))[1]).ravel()
    images = frames * CAMERAS
    arrays = {
        "frames": table,
        "sweeps": sweeps,
        "points": np.tile(np.rint(points * 100).astype(np.int16), (frames, 1)),
        "images": np.tile(jpeg, images),
        "image_ends": (len(jpeg) * (1 + np.arange(images))).reshape(frames, CAMERAS),
        "depth": np.full((frames, CAMERAS, HEIGHT_PX // 8, WIDTH_PX // 8), 1200, np.uint16),
        "cells": cells,
        "boxes": boxes,
        "pixels": np.stack([_pixel_from_ego(k * np.pi / 3) for k in range(CAMERAS)]),
    }
    for stem, array in arrays.items():
        np.save(folder / f"{stem}.npy", array)
    about = {"format": FORMAT, "name": name, "map": "Plain", "split": split, "weather": {}}
    about |= {"cameras": [f"cam_{k}" for k in range(CAMERAS)], "width_px": WIDTH_PX, "height_px": HEIGHT_PX}
    about |= {"lidar_m": [0.0, 0.0, 1.8], "ring_deg": 41.34 / 127}
    (folder / SCENE_FILE).write_text(json.dumps(about), encoding="utf-8")
    return folder


def _inside(center: tuple[float, ...], size: tuple[float, ...], rng: np.random.Generator) -> Float64Array:
    """(200, 3) points inside a box."""
    along = rng.uniform(-0.5, 0.5, (200, 3)) * size
    cosine, sine = np.cos(YAW_RAD), np.sin(YAW_RAD)
    turned = np.column_stack([cosine * along[:, 0] - sine * along[:, 1], sine * along[:, 0] + cosine * along[:, 1]])
    return np.column_stack([turned, along[:, 2]]) + center


def _pixel_from_ego(yaw_rad: float) -> Float64Array:
    """(3, 4) projection of a camera at a height of 1.5 m that looks into a direction."""
    cosine, sine = np.cos(yaw_rad), np.sin(yaw_rad)
    optical_from_ego = np.array([[sine, -cosine, 0, 0], [0, 0, -1, 1.5], [cosine, sine, 0, 0]])
    matrix = np.array([[40.0, 0, WIDTH_PX / 2 - 0.5], [0, 40.0, HEIGHT_PX / 2 - 0.5], [0, 0, 1]])
    return matrix @ optical_from_ego
