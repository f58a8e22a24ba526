"""Hand-made roads for tests with expectations worked out on paper."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from simbev_ros.foundation.types import Float64Array
from simbev_ros.maps.roads.lane_kind import LaneKind
from simbev_ros.maps.roads.layout import Layout, Strip

Height = Callable[[Float64Array], Float64Array]


def straight(
    name: str, start_m: tuple[float, float], end_m: tuple[float, float], height: Height, width_m: float = 3.5
) -> Strip:
    """A driving lane along a line in plan, a point every 2 m, its borders at ``height`` of (N, 2) points."""
    start, end = np.array(start_m), np.array(end_m)
    length_m = float(np.linalg.norm(end - start))
    along = np.linspace(0.0, 1.0, int(np.ceil(length_m / 2.0)) + 1)[:, None]
    middle = start + along * (end - start)
    left = np.array([-(end - start)[1], (end - start)[0]]) / length_m
    sides = [middle + side * width_m / 2.0 * left for side in (1.0, -1.0)]
    left_m, right_m = (np.column_stack([side, height(side)]) for side in sides)
    return Strip(name, name, LaneKind.DRIVING, left_m, right_m, road=name)


def side_by_side(count: int, **road: object) -> list[Strip]:
    """Lanes of one direction side by side, number 0 leftmost."""
    lanes = []
    for number in range(count):
        strip = straight(**{**road, "name": f"{road['name']}{number}"})  # type: ignore[arg-type]
        right = (strip.right_m - strip.left_m) * number
        lanes.append(replace(strip, left_m=strip.left_m + right, right_m=strip.right_m + right, index=-1 - number))
    return lanes


def layout_of_strips(*strips: Strip) -> Layout:
    return Layout(tuple(strips), (), (), ())


def level_ground(xy_m: Float64Array) -> Float64Array:
    return np.zeros(len(xy_m))
