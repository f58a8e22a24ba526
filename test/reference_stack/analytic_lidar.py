"""An analytic lidar for tests: intersects rays with a plane and upright boxes."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from simbev_ros.reference_stack.arrays import Floats, Integers

RINGS, COLUMNS = 32, 1024
HEIGHT_M = 1.8
RANGE_M = 80.0


@dataclass(frozen=True)
class Block:
    """An upright box standing on z = 0, ego frame."""

    x_m: float
    y_m: float
    yaw_rad: float
    size_m: tuple[float, float, float]


def scan(blocks: Sequence[Block], slope: float = 0.0) -> tuple[Floats, Integers]:
    """Scan blocks on a plane that rises with ``slope`` in the forward direction.

    Returns:
        (N, 3) points, lidar frame, and (N,) rings.
    """
    elevation = np.radians(np.linspace(-30.0, 10.0, RINGS))
    azimuth = np.linspace(-np.pi, np.pi, COLUMNS, endpoint=False)
    ring, angle = (each.ravel() for each in np.meshgrid(np.arange(RINGS), azimuth, indexing="ij"))
    flat = np.cos(elevation[ring])
    rays = np.stack([flat * np.cos(angle), flat * np.sin(angle), np.sin(elevation[ring])], axis=1)
    falls = rays[:, 2] - slope * rays[:, 0]
    range_m = np.divide(-HEIGHT_M, falls, out=np.full(len(rays), np.inf), where=falls < 0)
    for block in blocks:
        range_m = np.minimum(range_m, _ranges_m(rays, block))
    hit = range_m < RANGE_M
    return rays[hit] * range_m[hit, None], ring[hit]


def _ranges_m(rays: Floats, block: Block) -> Floats:
    """(N,) distance at which rays from the lidar enter a block; inf if they miss it."""
    cosine, sine = np.cos(block.yaw_rad), np.sin(block.yaw_rad)
    turn = np.array([[cosine, sine, 0.0], [-sine, cosine, 0.0], [0.0, 0.0, 1.0]])
    length_m, width_m, height_m = block.size_m
    low_m, high_m = np.array([-length_m / 2, -width_m / 2, 0.0]), np.array([length_m / 2, width_m / 2, height_m])
    origin_m = turn @ np.array([-block.x_m, -block.y_m, HEIGHT_M])
    direction = rays @ turn.T
    direction = np.where(np.abs(direction) < 1e-12, 1e-12, direction)
    sides = np.stack([(low_m - origin_m) / direction, (high_m - origin_m) / direction])
    enter, leave = sides.min(axis=0).max(axis=1), sides.max(axis=0).min(axis=1)
    return np.where((enter < leave) & (enter > 0), enter, np.inf)
