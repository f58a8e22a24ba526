"""Guards of a hazard area: cones, barriers, the barriers that close a road, and the warning sign ahead of the area."""

import math
from collections.abc import Iterable, Iterator

import numpy as np
from shapely.geometry.base import BaseGeometry

from simbev_ros.config.draw import sample
from simbev_ros.config.hazards import Hazards
from simbev_ros.foundation.geometry import overlay
from simbev_ros.foundation.random import stream
from simbev_ros.foundation.types import Float64Array
from simbev_ros.scene.blueprints import blueprint_named
from simbev_ros.scene.footprints import footprints
from simbev_ros.scene.hazards.area import HazardArea
from simbev_ros.scene.hazards.roadside import Roadside
from simbev_ros.schema.scene.hazard import HazardKind, PropSpec

_CONE, _BARRIER, _WATER_BARRIER = "prop.traffic_cone", "prop.barrier", "prop.water_barrier"
_SIGN = {HazardKind.ACCIDENT: "prop.sign_accident", HazardKind.WORK_ZONE: "prop.sign_works"}
_BARRIER_GAP_M = 0.08  # gap between barriers
_CONE_CLEARANCE_M = 0.25  # minimum distance from the body's end to a cone
_TRIES = 16
_MIN_SIGN_M, _MAX_SIGN_M, _SIGN_STEP_M = 10.0, 300.0, 5.0
BARRIER_ROW_M = 1.0
"""Length at each end of a work zone's body that its rows of barriers take up."""


def place_cones(
    config: Hazards, kind: HazardKind, area: HazardArea, seed: int, name: str
) -> tuple[list[PropSpec], int]:
    """The cones on the border to the open lanes, and the number of missing ones.

    A work zone has cones on its tapers only, because barriers guard the rest.
    """
    count = math.ceil(area.length_m / config.cone_spacing_m) + 1
    along_m = np.linspace(0.0, area.length_m, count)
    start_m, end_m = area.body_m
    if kind is HazardKind.WORK_ZONE:
        along_m = along_m[(along_m < start_m - _CONE_CLEARANCE_M) | (along_m > end_m + _CONE_CLEARANCE_M)]
    is_present = stream(seed, f"{name}.cones").random(len(along_m)) >= config.cone_missing_probability
    present = list(_props(_CONE, *area.guard_positions(along_m[is_present])))
    return present, int(np.count_nonzero(~is_present))


def place_barriers(area: HazardArea) -> Iterator[PropSpec]:
    """The barriers of a work zone: across both ends of its body and along its open side."""
    start_m, end_m = area.body_m
    across_m = _barrier_row_m(area.width_m)
    ends = [
        prop
        for along_m in (start_m + BARRIER_ROW_M / 2.0, end_m - BARRIER_ROW_M / 2.0)
        for prop in _props(_BARRIER, *area.positions(np.full(len(across_m), along_m), across_m))
    ]
    yield from ends
    step_m = _size_m(_WATER_BARRIER)[1] + _BARRIER_GAP_M
    position_m, yaw_rad = area.guard_positions(
        np.arange(start_m + BARRIER_ROW_M + step_m / 2.0, end_m - BARRIER_ROW_M, step_m)
    )
    occupied = props_footprint(ends)
    for prop in _props(_WATER_BARRIER, position_m, yaw_rad + area.side * math.pi / 2.0):
        footprint = props_footprint([prop])
        if not footprint.intersects(occupied):  # in bends they would overlap
            occupied = occupied.union(footprint)
            yield prop


def place_road_closures(roadside: Roadside, edges: Iterable[str]) -> Iterator[PropSpec]:
    """A row of barriers across the start of each closed street."""
    for edge in edges:
        width_m = roadside.width_m(edge)
        yield from _props(_BARRIER, *roadside.row_across(edge, _barrier_row_m(width_m), _size_m(_BARRIER)))


def place_warning_sign(
    config: Hazards, kind: HazardKind, area: HazardArea, roadside: Roadside, seed: int, name: str
) -> tuple[PropSpec | None, float | None]:
    """The warning sign and its distance; None where there is no room at any distance.

    Redraws the distance while there is no room, and then falls back to the possible distance nearest to the first draw.
    """
    rng = stream(seed, f"{name}.sign")
    drawn_m = [sample(config.sign_distance_m, rng) for _ in range(_TRIES)]
    fallback_m = np.arange(_MIN_SIGN_M, _MAX_SIGN_M, _SIGN_STEP_M)
    for distance_m in (*drawn_m, *fallback_m[np.argsort(np.abs(fallback_m - drawn_m[0]), kind="stable")].tolist()):
        pose = roadside.sign_ahead_of(area, distance_m, _size_m(_SIGN[kind]))
        if pose is not None:
            return next(_props(_SIGN[kind], *pose)), distance_m
    return None, None


def props_footprint(props: Iterable[PropSpec]) -> BaseGeometry:
    """The ground that props cover."""
    prop_list = list(props)
    sizes_m = np.array([_size_m(prop.blueprint) for prop in prop_list]).reshape(-1, 2)
    center_m = np.array([(prop.x_m, prop.y_m) for prop in prop_list]).reshape(-1, 2)
    return overlay.union_all(footprints(sizes_m, center_m, np.array([prop.yaw_rad for prop in prop_list])))


def _barrier_row_m(width_m: float) -> Float64Array:
    """(N,) center positions across a width of as many adjacent barriers as fit."""
    count = max(1, int(width_m // _size_m(_BARRIER)[1]))
    return width_m * (np.arange(count) + 0.5) / count


def _size_m(blueprint: str) -> tuple[float, float]:
    length_m, width_m, _ = blueprint_named(blueprint).size_m
    return length_m, width_m


def _props(blueprint: str, position_m: Float64Array, yaw_rad: Float64Array) -> Iterator[PropSpec]:
    for (x_m, y_m, z_m), yaw in zip(position_m.tolist(), yaw_rad.tolist(), strict=True):
        yield PropSpec(blueprint=blueprint, x_m=x_m, y_m=y_m, z_m=z_m, yaw_rad=yaw)
