"""What guards a hazard area: cones, barriers and the warning sign ahead of it."""

import math
from collections.abc import Iterator

import numpy as np

from simbev_ros.config.draw import sample
from simbev_ros.config.hazards import Hazards
from simbev_ros.random import stream
from simbev_ros.scene.blueprints import blueprint_index, load_blueprints
from simbev_ros.scene.hazard_area import HazardArea, Place
from simbev_ros.scene.hazard_sites import HazardSites
from simbev_ros.scene.hazards import HazardKind, PropSpec

_CONE, _BARRIER, _WATER_BARRIER = "prop.traffic_cone", "prop.barrier", "prop.water_barrier"
_SIGN = {HazardKind.ACCIDENT: "prop.sign_accident", HazardKind.WORK_ZONE: "prop.sign_works"}
_GAP_M = 0.08  # between barriers
_TRIES = 16
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
        along_m = along_m[(along_m < begin_m) | (along_m > end_m)]
    there = stream(seed, f"{name}.cones").random(len(along_m)) >= config.cone_missing_probability
    stand = [_prop(_CONE, place) for place in area.guards(along_m[there])]
    return stand, int(np.count_nonzero(~there))


def barriers(area: HazardArea) -> Iterator[PropSpec]:
    """Of a work zone: across both ends of its body, and along its open side."""
    begin_m, end_m = area.body_m
    broad_m = _width_m(_BARRIER)
    count = int(area.width_m // broad_m)
    for along_m in (begin_m + BARRIER_M / 2.0, end_m - BARRIER_M / 2.0):
        for number in range(count):
            yield _prop(_BARRIER, area.place(along_m, area.width_m * (number + 0.5) / count))
    step_m = _width_m(_WATER_BARRIER) + _GAP_M
    for place in area.guards(np.arange(begin_m + BARRIER_M + step_m / 2.0, end_m - BARRIER_M, step_m)):
        yield _prop(_WATER_BARRIER, Place(place.position_m, place.yaw_rad + area.side * math.pi / 2.0))


def warning_sign(
    config: Hazards, kind: HazardKind, area: HazardArea, sites: HazardSites, seed: int, name: str
) -> tuple[PropSpec | None, float | None]:
    """The sign and its distance, drawn anew while it would stand in a junction; None where there is no place."""
    rng = stream(seed, f"{name}.sign")
    for _ in range(_TRIES):
        distance_m = sample(config.sign_distance_m, rng)
        found = sites.roadside(area, distance_m)
        if found is not None:
            return _prop(_SIGN[kind], found), distance_m
    return None, None


def _width_m(blueprint: str) -> float:
    return load_blueprints()[blueprint_index()[blueprint]].size_m[1]


def _prop(blueprint: str, place: Place) -> PropSpec:
    x_m, y_m, z_m = place.position_m.tolist()
    return PropSpec(blueprint=blueprint, x_m=x_m, y_m=y_m, z_m=z_m, yaw_rad=place.yaw_rad)
