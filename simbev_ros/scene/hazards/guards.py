"""What guards a hazard area: cones, barriers, those that close a road, and the warning sign ahead of it."""

import math
from collections.abc import Iterable, Iterator

import numpy as np
import shapely
from shapely.geometry.base import BaseGeometry

from simbev_ros.config.draw import sample
from simbev_ros.config.hazards import Hazards
from simbev_ros.random import stream
from simbev_ros.scene.blueprints import blueprint_index, load_blueprints
from simbev_ros.scene.footprints import footprints
from simbev_ros.scene.hazards.area import HazardArea
from simbev_ros.scene.hazards.hazard import HazardKind, PropSpec
from simbev_ros.scene.hazards.roadside import Roadside
from simbev_ros.types import Float64Array

_CONE, _BARRIER, _WATER_BARRIER = "prop.traffic_cone", "prop.barrier", "prop.water_barrier"
_SIGN = {HazardKind.ACCIDENT: "prop.sign_accident", HazardKind.WORK_ZONE: "prop.sign_works"}
_GAP_M = 0.08  # between barriers
_CONE_M = 0.25  # to its end at least is room for a cone
_TRIES = 16
_NEAREST_SIGN_M, _FARTHEST_SIGN_M, _SIGN_STEP_M = 10.0, 300.0, 5.0
BARRIER_M = 1.0
"""Of the body's length at each end: there a work zone's barriers stand."""


def cones(config: Hazards, kind: HazardKind, area: HazardArea, seed: int, name: str) -> tuple[list[PropSpec], int]:
    """The cones, on the border to the open lanes, and how many of them are missing.

    A work zone has them on its tapers only, because the rest has barriers.
    """
    count = math.ceil(area.length_m / config.cone_spacing_m) + 1
    along_m = np.linspace(0.0, area.length_m, count)
    begin_m, end_m = area.body_m
    if kind is HazardKind.WORK_ZONE:
        along_m = along_m[(along_m < begin_m - _CONE_M) | (along_m > end_m + _CONE_M)]
    there = stream(seed, f"{name}.cones").random(len(along_m)) >= config.cone_missing_probability
    stand = list(_props(_CONE, *area.guards(along_m[there])))
    return stand, int(np.count_nonzero(~there))


def barriers(area: HazardArea) -> Iterator[PropSpec]:
    """Of a work zone: across both ends of its body, and along its open side."""
    begin_m, end_m = area.body_m
    across_m = _evenly(area.width_m)
    ends = [
        prop
        for along_m in (begin_m + BARRIER_M / 2.0, end_m - BARRIER_M / 2.0)
        for prop in _props(_BARRIER, *area.places(np.full(len(across_m), along_m), across_m))
    ]
    yield from ends
    step_m = _size_m(_WATER_BARRIER)[1] + _GAP_M
    place_m, yaw_rad = area.guards(np.arange(begin_m + BARRIER_M + step_m / 2.0, end_m - BARRIER_M, step_m))
    taken = ground_of(ends)
    for prop in _props(_WATER_BARRIER, place_m, yaw_rad + area.side * math.pi / 2.0):
        ground = ground_of([prop])
        if not ground.intersects(taken):  # as they do in bends
            taken = taken.union(ground)
            yield prop


def road_ends(roadside: Roadside, edges: Iterable[str]) -> Iterator[PropSpec]:
    """A row of barriers across the beginning of each street that is closed."""
    for edge in edges:
        width_m = roadside.width_m(edge)
        yield from _props(_BARRIER, *roadside.across(edge, _evenly(width_m), _size_m(_BARRIER)))


def warning_sign(
    config: Hazards, kind: HazardKind, area: HazardArea, roadside: Roadside, seed: int, name: str
) -> tuple[PropSpec | None, float | None]:
    """The sign and its distance, drawn anew while there is no place for it, and at last the nearest possible."""
    rng = stream(seed, f"{name}.sign")
    drawn_m = [sample(config.sign_distance_m, rng) for _ in range(_TRIES)]
    others_m = np.arange(_NEAREST_SIGN_M, _FARTHEST_SIGN_M, _SIGN_STEP_M)
    for distance_m in (*drawn_m, *others_m[np.argsort(np.abs(others_m - drawn_m[0]), kind="stable")].tolist()):
        found = roadside.ahead_of(area, distance_m, _size_m(_SIGN[kind]))
        if found is not None:
            return next(_props(_SIGN[kind], *found)), distance_m
    return None, None


def ground_of(props: Iterable[PropSpec]) -> BaseGeometry:
    """The ground that things cover."""
    things = list(props)
    sizes_m = np.array([_size_m(prop.blueprint) for prop in things]).reshape(-1, 2)
    middle_m = np.array([(prop.x_m, prop.y_m) for prop in things]).reshape(-1, 2)
    return shapely.union_all(footprints(sizes_m, middle_m, np.array([prop.yaw_rad for prop in things])))


def _evenly(width_m: float) -> Float64Array:
    """(N,) middles of as many barriers beside each other as have room."""
    count = max(1, int(width_m // _size_m(_BARRIER)[1]))
    middles_m: Float64Array = width_m * (np.arange(count) + 0.5) / count
    return middles_m


def _size_m(blueprint: str) -> tuple[float, float]:
    length_m, width_m, _ = load_blueprints()[blueprint_index()[blueprint]].size_m
    return length_m, width_m


def _props(blueprint: str, place_m: Float64Array, yaw_rad: Float64Array) -> Iterator[PropSpec]:
    for (x_m, y_m, z_m), yaw in zip(place_m.tolist(), yaw_rad.tolist(), strict=True):
        yield PropSpec(blueprint=blueprint, x_m=x_m, y_m=y_m, z_m=z_m, yaw_rad=yaw)
