"""Places cars on the roads and pedestrians on the sidewalks around a viewpoint, to give a picture a sense of scale.

A map and a position enter; a table of actors leaves. The actors do not move.
"""

from collections.abc import Sequence

import numpy as np

from simbev_ros.foundation.geometry.ragged import ragged_indices
from simbev_ros.foundation.random import stream
from simbev_ros.foundation.semantics import Tag
from simbev_ros.foundation.types import Float64Array, Table
from simbev_ros.maps.network import RoadNetwork
from simbev_ros.maps.roads.lane_kind import CURB_HEIGHT_M, LaneKind
from simbev_ros.maps.roads.polylines import Polylines
from simbev_ros.scene.blueprints import load_blueprints
from simbev_ros.schema.scene.state import ACTOR_DTYPE

_MAX_DISTANCE_M, _MIN_DISTANCE_M = 130.0, 15.0
_MAX_LENGTH_M = 7.0
_CAR_SPACING_M, _CAR_SHARE = 9.0, 0.22
_WALKER_SPACING_M, _WALKER_SHARE, _ASIDE_M = 6.0, 0.16, 0.5


def bystanders(network: RoadNetwork, position_m: Float64Array, first_id: int, busy: float = 1.0) -> Table:
    """Actors around a position, but not close to it; always the same for one map and position.

    Args:
        network: The map.
        position_m: (3,) the position, map frame.
        first_id: Id of the first actor; the others count up from it.
        busy: Density of traffic; 1 is usual.

    Returns:
        (N,) ``ACTOR_DTYPE``.
    """
    rng = stream(network.seed, f"bystanders.{position_m[0]:.0f}.{position_m[1]:.0f}")
    kinds = load_blueprints()
    cars = [k for k, kind in enumerate(kinds) if kind.tag in (Tag.CAR, Tag.TRUCK) and kind.size_m[0] < _MAX_LENGTH_M]
    people = [k for k, kind in enumerate(kinds) if kind.tag == Tag.PEDESTRIAN and kind.suits(["mild"])]
    driving = _actors_on_lanes(
        network, LaneKind.DRIVING, position_m, _CAR_SPACING_M, rng.spawn(1)[0], cars, busy * _CAR_SHARE
    )
    share = busy * _WALKER_SHARE
    walking = _actors_on_lanes(
        network, LaneKind.SIDEWALK, position_m, _WALKER_SPACING_M, rng.spawn(1)[0], people, share
    )
    walking["z"] += CURB_HEIGHT_M
    walking["yaw"] += np.pi * rng.integers(0, 2, len(walking))
    aside_m = rng.uniform(-_ASIDE_M, _ASIDE_M, len(walking))
    walking["x"] -= aside_m * np.sin(walking["yaw"])
    walking["y"] += aside_m * np.cos(walking["yaw"])
    walking["gait"] = rng.uniform(0.0, 2.0 * np.pi, len(walking))
    walking["vx"], walking["vy"] = np.cos(walking["yaw"]), np.sin(walking["yaw"])
    table = np.concatenate([driving, walking])
    table["id"] = first_id + np.arange(len(table))
    return table


def _actors_on_lanes(
    network: RoadNetwork,
    kind: LaneKind,
    position_m: Float64Array,
    spacing_m: float,
    rng: np.random.Generator,
    blueprints: Sequence[int],
    share: float,
) -> Table:
    """Actors of random blueprints at a share of evenly spaced positions on lanes of a kind, outside junctions."""
    lines = Polylines.from_lines([lane.centerline_m for lane in network.lanes_of(kind) if not lane.junction])
    count = np.floor(lines.length_m / spacing_m).astype(np.int64)
    row, number = ragged_indices(count)
    s_m: Float64Array = (number + np.float64(0.5)) * spacing_m
    distance_m = np.hypot(*(lines.values(lines.parameter(row, s_m))[:, :2] - position_m[:2]).T)
    chosen = np.flatnonzero((distance_m > _MIN_DISTANCE_M) & (distance_m < _MAX_DISTANCE_M))
    chosen = chosen[rng.random(len(chosen)) < share]
    back_m, middle_m, front_m = (lines.values(lines.parameter(row[chosen], s_m[chosen] + step)) for step in (-1, 0, 1))
    step_m, kinds = front_m - back_m, load_blueprints()
    table = np.zeros(len(chosen), ACTOR_DTYPE)
    table["x"], table["y"], table["z"] = middle_m.T
    table["yaw"] = np.arctan2(step_m[:, 1], step_m[:, 0])
    if kind is LaneKind.DRIVING:
        table["pitch"] = -np.arctan2(step_m[:, 2], np.hypot(step_m[:, 0], step_m[:, 1]))
    frequency = np.array([kinds[k].frequency for k in blueprints])
    table["blueprint"] = rng.choice(blueprints, len(chosen), p=frequency / frequency.sum())
    of_each = [kinds[k] for k in table["blueprint"].tolist()]
    table["tag"] = [each.tag for each in of_each]
    table["color"] = [each.colors[int(rng.integers(len(each.colors)))] for each in of_each]
    table["length"], table["width"], table["height"] = np.array([each.size_m for each in of_each]).reshape(-1, 3).T
    return table
