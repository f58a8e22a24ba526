"""Layout of a cache: a folder for each split and scene with NumPy files.

=================  ===================================================================================================
``scene.json``     name, SHA-256 of the bag, map, split, cameras, image size, lidar and conditions of the scene
``frames.npy``     (F,) ``FRAME_DTYPE``: the key frames
``sweeps.npy``     (S,) ``SWEEP_DTYPE``: all sweeps of the lidar
``points.npy``     (P, 3) int16 points of all sweeps, cm, in the ego frame of their stamp
``images.npy``     (I,) uint8: the JPEG images of all frames, one behind the other
``image_ends.npy`` (F, K) int64: end of each image; it starts where the one before ends
``depth.npy``      (F, K, H / 8, W / 8) uint16: smallest depth of 8 x 8 pixels, cm; 0: none below 655 m
``cells.npy``      (F, 360, 360) uint16: the grid, bit k of a cell is class k
``boxes.npy``      (B,) ``BOX_DTYPE``: boxes of all frames
``pixels.npy``     (K, 3, 4) float64 projections from the ego frame to u * depth, v * depth, depth
=================  ===================================================================================================
"""

import numpy as np

FORMAT = 3
SCENE_FILE = "scene.json"
CM_PER_M = 100.0
MAX_POINT_M = 320.0
"""Points beyond it do not fit their type, and are left out."""

FRAME_DTYPE = np.dtype(
    [
        ("tick", "<i4"),
        ("stamp_ns", "<i8"),
        ("map_from_ego", "<f8", (4, 4)),
        ("boxes_end", "<i4"),
    ]
)
SWEEP_DTYPE = np.dtype([("stamp_ns", "<i8"), ("map_from_ego", "<f8", (4, 4)), ("points_end", "<i8")])
BOX_DTYPE = np.dtype(
    [
        ("x", "<f4"),  # m, level frame: center of the box
        ("y", "<f4"),
        ("z", "<f4"),
        ("length", "<f4"),
        ("width", "<f4"),
        ("height", "<f4"),
        ("yaw", "<f4"),  # rad, level frame
        ("vx", "<f4"),  # m/s over ground, level frame
        ("vy", "<f4"),
        ("visibility", "<f4"),
        ("points", "<i4"),  # of lidars and radars
        ("class", "u1"),  # index into BOX_CLASSES
    ]
)
KINDS = {
    "frames": (FRAME_DTYPE, 1),
    "sweeps": (SWEEP_DTYPE, 1),
    "points": (np.dtype("<i2"), 2),
    "images": (np.dtype("u1"), 1),
    "image_ends": (np.dtype("<i8"), 2),
    "depth": (np.dtype("<u2"), 1),
    "cells": (np.dtype("<u2"), 3),
    "boxes": (BOX_DTYPE, 1),
    "pixels": (np.dtype("<f8"), 3),
}
"""Type and min number of axes of each array."""
