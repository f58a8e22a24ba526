"""Builds traffic lights: posts, masts with arms, and heads; each lamp refers to its row of the signals table."""

from collections import defaultdict
from collections.abc import Iterator, Sequence
from functools import lru_cache

import numpy as np
import shapely

from simbev_ros.assets.architecture.facades import lay_along_front
from simbev_ros.assets.materials import Material
from simbev_ros.assets.mesh.mesh import Mesh
from simbev_ros.assets.mesh.primitives import Finish, box, cylinder, extrusion, lathe, tube
from simbev_ros.assets.placement.region_ground import RegionGround
from simbev_ros.assets.street.poles import with_lamp_index
from simbev_ros.foundation.geometry.transforms import matrices_from_xyz_rpy
from simbev_ros.foundation.semantics import Tag
from simbev_ros.foundation.types import Float64Array
from simbev_ros.maps.network import Signal

_LAMPS = (
    (Material.SIGNAL_RED, (214, 42, 34)),
    (Material.SIGNAL_YELLOW, (232, 176, 30)),
    (Material.SIGNAL_GREEN, (38, 178, 96)),
)
_LAMP_SPACING_M, _LAMP_RADIUS_M = 0.31, 0.105
_HEAD_M = (0.2, 0.34, 1.0)
_POST_REACH_M = 1.0
_POLE = Finish(Material.METAL, Tag.POLE, (88, 92, 95))
_HOUSING = Finish(Material.METAL, Tag.TRAFFIC_LIGHT, (34, 36, 36))


def signal_poles(ground: RegionGround) -> Iterator[tuple[Mesh, Float64Array]]:
    """Yield each pole of a region with all of its heads, in the frame of its foot, and its (4, 4) pose, map frame."""
    signals = ground.network.signals
    feet_m = np.array([signal.pole_m[:2] for signal in signals]).reshape(-1, 2)
    by_pole: dict[tuple[float, ...], list[tuple[int, Signal]]] = defaultdict(list)
    for row in np.flatnonzero(ground.owns(feet_m)).tolist():
        by_pole[tuple(np.round(signals[row].pole_m, 2))].append((row, signals[row]))
    head = signal_head()
    for members in by_pole.values():
        foot_m = members[0][1].pole_m
        pieces = _carrier([signal for _, signal in members])
        for row, signal in members:
            pose = matrices_from_xyz_rpy(signal.position_m - foot_m, np.array([0.0, 0.0, signal.yaw_rad]))
            pieces.append(with_lamp_index(head, tuple(lamp for lamp, _ in _LAMPS), row).transform(pose))
        yield Mesh.merge(pieces), matrices_from_xyz_rpy(foot_m, np.zeros(3))


def _carrier(signals: Sequence[Signal]) -> list[Mesh]:
    """Post, or mast with an arm, and brackets of the heads; origin at the foot."""
    heads_m = np.array([signal.position_m - signal.pole_m for signal in signals])
    facing = np.array([[np.cos(signal.yaw_rad), np.sin(signal.yaw_rad), 0.0] for signal in signals])
    holds_m = heads_m - np.sum(heads_m * facing, axis=1, keepdims=True) * facing
    reaches_m = np.hypot(holds_m[:, 0], holds_m[:, 1])
    brackets = [
        box(_POLE, (0.3, 0.06, 0.05)).transform(matrices_from_xyz_rpy(middle_m, np.array([0.0, 0.0, signal.yaw_rad])))
        for signal, middle_m in zip(signals, (heads_m + holds_m) / 2.0, strict=True)
    ]
    foot = lathe(_POLE, np.array([[0.2, -0.5], [0.2, 0.25], [0.13, 0.35]]), segments=8)
    top_m = float(heads_m[:, 2].max()) + 0.5
    if reaches_m.max() < _POST_REACH_M:
        return [foot, cylinder(_POLE, (0.0, 0.0, 0.0), (0.0, 0.0, top_m), 0.065, segments=8), *brackets]
    end_m = holds_m[np.argmax(reaches_m)]
    start_m = end_m * [0.0, 0.0, 1.0]
    arm = tube(_POLE, np.array([start_m, end_m + (end_m - start_m) * 0.06]), np.array([0.09, 0.055]), segments=7)
    mast = cylinder(_POLE, (0.0, 0.0, 0.0), (0.0, 0.0, top_m), 0.13, end_radius_m=0.1, segments=10)
    return [foot, mast, arm, *brackets]


@lru_cache(maxsize=1)
def signal_head() -> Mesh:
    """Housing with three lamps, red at the top, and visors; lamps shine along x; origin at its center."""
    front_m = _HEAD_M[0] / 2.0
    arc = np.linspace(-0.15, np.pi + 0.15, 7)
    rim = np.column_stack([np.cos(arc), np.sin(arc)])
    visor = np.concatenate([rim * 0.135, rim[::-1] * 0.118])
    pieces = [box(_HOUSING, _HEAD_M, bevel_m=0.03), box(_HOUSING, (0.02, 0.52, 1.2), (front_m - 0.04, 0.0, 0.0))]
    for (lamp, color), z_m in zip(_LAMPS, (_LAMP_SPACING_M, 0.0, -_LAMP_SPACING_M), strict=True):
        finish = Finish(lamp, Tag.TRAFFIC_LIGHT, color)
        pieces.append(cylinder(finish, (front_m - 0.01, 0.0, z_m), (front_m + 0.02, 0.0, z_m), _LAMP_RADIUS_M))
        shell = shapely.Polygon(visor + np.array([0.0, z_m]))
        pieces.append(lay_along_front(extrusion(_HOUSING, shell, front_m - 0.01, front_m + 0.2)))
    return Mesh.merge(pieces)
