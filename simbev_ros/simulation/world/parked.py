"""Parked vehicles: rows of the actors table that never move, drawn for the parking spots along the agents' routes.

They have no part in SUMO's traffic, which never touches the spots. Some open a door for a moment.
"""

from collections.abc import Iterator, Mapping, Sequence
from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np
import shapely

from simbev_ros.assets.street.parking_spots import USES, SpotKind
from simbev_ros.foundation.random import stream
from simbev_ros.foundation.semantics import Tag
from simbev_ros.foundation.tables import load_table
from simbev_ros.foundation.types import BoolArray, Float64Array, Table
from simbev_ros.foundation.units import NS_PER_S
from simbev_ros.maps.network import RoadNetwork
from simbev_ros.scene.blueprints import Blueprint, blueprint_index, blueprint_named, load_blueprints
from simbev_ros.scene.footprints import footprints
from simbev_ros.scene.streets.vehicle_route import draw_vehicle_route, duration_s
from simbev_ros.schema.scene.spec import SceneSpec
from simbev_ros.schema.scene.state import ACTOR_DTYPE, Behavior
from simbev_ros.simulation.world.pedestrians.crossing_sites import CrossingSite
from simbev_ros.simulation.world.pedestrians.itineraries import Leg

MAX_PARKED = 160
"""Maximum number of parked vehicles in a scene; the nearest ones to the agents' routes have precedence."""

_REACH_M = 110.0  # from the routes
_KEEP_FROM_HAZARD_M, _KEEP_FROM_PATH_M = 1.5, 1.3
_FROM_CURB_M, _FROM_TRAFFIC_M = 0.24, 0.2  # minimum: pedestrians and cyclists reach over the edges of their lanes
_FULL_TURN_M = 0.3  # room across a parking lane from which on vehicles may stand askew
_OPEN_S = 2.5, 7.0
_KEEP_FROM_DOORS_M = 5.0  # doors are shut while another actor is as near as this


class _Parked(NamedTuple):
    """A vehicle on a spot, ``along_m`` ahead of its center."""

    blueprint: Blueprint
    spot: Table
    along_m: float = 0.0


class ParkedVehicles:
    """The parked vehicles of a scene, and their doors over time.

    Attributes:
        rows: (K,) ``ACTOR_DTYPE`` with all doors shut; ids ascend.
    """

    def __init__(
        self,
        spec: SceneSpec,
        network: RoadNetwork,
        spots: Table,
        excursions: Mapping[int, tuple[Leg, ...]],
        first_id: int,
    ) -> None:
        """Draw the vehicles.

        Args:
            spec: The scene.
            network: Its roads.
            spots: (S,) ``SPOT_DTYPE``.
            excursions: Legs of the pedestrians that leave SUMO's network, by index: their paths stay free.
            first_id: Id of the first row.
        """
        rows = _draw_rows(spec, network, spots, excursions) if spec.parked_density and len(spots) else _rows(())
        rows["id"] = first_id + np.arange(len(rows))
        rng = stream(spec.seed, "parked.doors")
        from_s = rng.uniform(-_OPEN_S[1], duration_s(spec), len(rows))
        self._open_ticks = np.stack([from_s, from_s + rng.uniform(*_OPEN_S, len(rows))]) * NS_PER_S / spec.tick_ns
        self._door = np.where(rng.random(len(rows)) < _table()["door_probability"], rows["doors"], 0)
        rows["doors"] = 0
        self.rows = rows

    def rows_at(self, step: int, moving: Table) -> Table:
        """The rows some ticks after the scene's start, among (N,) ``ACTOR_DTYPE`` other actors."""
        opening = np.flatnonzero((self._open_ticks[0] <= step) & (step < self._open_ticks[1]) & (self._door > 0))
        if not len(opening):
            return self.rows
        rows: Table = self.rows.copy()
        gap_m = np.hypot(*(moving[axis] - rows[axis][opening, None] for axis in ("x", "y")))
        rows["doors"][opening] = np.where((gap_m > _KEEP_FROM_DOORS_M).all(axis=1), self._door[opening], 0)
        return rows


def _draw_rows(spec: SceneSpec, network: RoadNetwork, spots: Table, excursions: Mapping[int, tuple[Leg, ...]]) -> Table:
    """Rows of the vehicles near the routes and clear of hazards and paths; the column ``doors`` holds one to open."""
    routes = shapely.GeometryCollection(list(agent_routes(spec, network)))
    near = shapely.dwithin(routes, shapely.points(spots["x"], spots["y"]), _REACH_M)
    rows = np.concatenate([_rows(()), *(_take_spots(spec, spots[run]) for run in _runs(spots) if near[run].any())])
    shapes = footprints(np.column_stack([rows["length"], rows["width"]]), _xy_m(rows), rows["yaw"])
    rows = rows[is_clear(spec, shapes, excursions)]
    by_distance = np.argsort(shapely.distance(routes, shapely.points(_xy_m(rows))), kind="stable")
    return rows[np.sort(by_distance[:MAX_PARKED])]


def agent_routes(spec: SceneSpec, network: RoadNetwork) -> Iterator[shapely.Geometry]:
    """Lines along which the agents can drive at the speed limits, and points at which agents stand."""
    for agent in spec.agents:
        if agent.vehicle is None:
            assert agent.station is not None
            yield shapely.Point(agent.station.x_m, agent.station.y_m)
            continue
        edges = draw_vehicle_route(spec, network, agent.vehicle).edges
        lanes = [lanes[-1] for edge in edges if (lanes := network.lanes_of_edge(edge))]
        entered_s = np.cumsum([0.0, *(lane.length_m / lane.speed_mps for lane in lanes)])
        for lane, at_s in zip(lanes, entered_s.tolist(), strict=False):
            if at_s <= duration_s(spec):
                yield shapely.LineString(lane.centerline_m[:, :2])


def _runs(spots: Table) -> Iterator[slice]:
    """Rows of spots along one curb, and single bays and drives."""
    starts = np.flatnonzero(spots["first"] | (spots["kind"] != SpotKind.CURB)).tolist()
    for start, stop in zip(starts, [*starts[1:], len(spots)], strict=True):
        yield slice(start, stop)


def _take_spots(spec: SceneSpec, spots: Table) -> Table:
    """Rows of the vehicles on (S,) spots along one curb, or in one bay or drive."""
    rng = stream(spec.seed, f"parked.{spots['x'][0]:.2f}.{spots['y'][0]:.2f}")
    kind, table = SpotKind(spots["kind"][0]).name.lower(), _table()
    by_day, by_night = table["occupancy"][kind][USES[spots["use"][0]]]
    share = spec.parked_density * (by_night if spec.weather.sun_altitude_deg < 0.0 else by_day)
    share = float(np.clip(rng.normal(share, table["share_sd"]), 0.0, 1.0))
    if kind == "curb":
        parked = list(_line_up(spots, share, rng))
    else:
        blueprint = _draw_blueprint(rng, float(spots["length"][0]), float(spots["width"][0]))
        parked = [_Parked(blueprint, spots[0])] if blueprint is not None and rng.random() < share else []
    return _rows([_row(each, kind, rng) for each in parked])


def _line_up(spots: Table, share: float, rng: np.random.Generator) -> Iterator[_Parked]:
    """Fill a row of spots along a curb from its start, with gaps."""
    min_gap_m, mean_gap_m = _table()["gap_m"]
    step_m, width_m = float(spots["length"][0]), float(spots["width"].min()) - _FROM_CURB_M - _FROM_TRAFFIC_M
    from_m, end_m = min_gap_m / 2.0 + float(rng.exponential(mean_gap_m)), len(spots) * step_m - min_gap_m / 2.0
    while (blueprint := _draw_blueprint(rng, end_m - from_m, width_m)) is not None:
        length_m = blueprint.size_m[0]
        if rng.random() < share:
            at = (from_m + length_m / 2.0) / step_m - 0.5
            nearest = min(max(round(at), 0), len(spots) - 1)
            yield _Parked(blueprint, spots[nearest], (at - nearest) * step_m)
        from_m += length_m + min_gap_m + float(rng.exponential(mean_gap_m))


def _row(parked: _Parked, kind: str, rng: np.random.Generator) -> Table:
    """Row of one vehicle, shape (), with small errors of its driver."""
    blueprint, spot, along_m = parked
    table, (length_m, width_m, height_m), side = _table(), blueprint.size_m, float(spot["side"])
    turn_rad, aside_m = (float(rng.normal(0.0, table[name][kind])) for name in ("yaw_sd_rad", "across_sd_m"))
    slack_m = max(float(spot["length"]) - length_m, 0.0) / 2.0
    along_m += float(np.clip(rng.normal(0.0, table["along_sd_m"][kind]), -slack_m, slack_m))
    room_m = float(spot["width"]) - width_m
    if side:  # from the curb to the middle of the vehicle
        turn_rad *= min(1.0, (room_m - _FROM_CURB_M - _FROM_TRAFFIC_M) / _FULL_TURN_M)
        gap_m = min(max(table["curb_gap_m"] + aside_m, _FROM_CURB_M), room_m - _FROM_TRAFFIC_M)
        aside_m = side * (width_m / 2.0 + gap_m)
    else:
        aside_m = min(max(aside_m, -room_m / 2.0), room_m / 2.0)
    yaw_rad, is_reversed = float(spot["yaw"]), rng.random() < table["reversed"][kind]
    sign = -1.0 if is_reversed else 1.0
    row = np.zeros((), ACTOR_DTYPE)
    row["x"] = spot["x"] + along_m * np.cos(yaw_rad) - aside_m * np.sin(yaw_rad)
    row["y"] = spot["y"] + along_m * np.sin(yaw_rad) + aside_m * np.cos(yaw_rad)
    across_m = aside_m - side * float(spot["width"]) / 2.0
    row["z"] = spot["z"] - along_m * np.tan(spot["pitch"]) + across_m * np.tan(spot["roll"])
    row["roll"], row["pitch"] = sign * spot["roll"], sign * spot["pitch"]
    row["yaw"] = np.angle(sign * np.exp(1j * (yaw_rad + turn_rad)))
    row["length"], row["width"], row["height"] = length_m, width_m, height_m
    row["wheel"] = rng.uniform(0.0, 2.0 * np.pi)
    row["steer"] = rng.uniform(-1.0, 1.0) * table["steer_rad"] * (rng.random() < table["steered_share"])
    row["steer"] *= blueprint.kind == "vehicle"
    row["color"] = blueprint.colors[int(rng.integers(len(blueprint.colors)))]
    row["blueprint"], row["tag"] = blueprint_index()[blueprint.name], blueprint.tag
    row["behavior"] = Behavior.PARKED
    if blueprint.doors and kind != "bay":  # there the next vehicle is too near
        row["doors"] = 2 if sign * side > 0.0 else 1
    return row


def _rows(rows: Sequence[Table]) -> Table:
    """(K,) ``ACTOR_DTYPE`` of K rows."""
    return np.array(rows, ACTOR_DTYPE) if len(rows) else np.zeros(0, ACTOR_DTYPE)


def _xy_m(rows: Table) -> Float64Array:
    """(K, 2) positions."""
    return np.column_stack([rows["x"], rows["y"]])


def is_clear(spec: SceneSpec, shapes: Any, excursions: Mapping[int, tuple[Leg, ...]]) -> BoolArray:
    """(K,) which of K footprints keep off hazard areas, what stands around them, and the paths of jaywalkers."""
    things: list[shapely.Geometry] = [shapely.Polygon(hazard.outline_m) for hazard in spec.hazards]
    things += [shapely.Point(prop.x_m, prop.y_m) for hazard in spec.hazards for prop in hazard.props]
    stands = [(vehicle.blueprint, stand) for vehicle in spec.vehicles if (stand := vehicle.stands_at) is not None]
    for name, stand in stands:
        center_m, yaw_rad = np.array([[stand.x_m, stand.y_m]]), np.array([stand.yaw_rad])
        things += footprints(np.array(blueprint_named(name).size_m), center_m, yaw_rad).tolist()
    sites = (leg.excursion for legs in excursions.values() for leg in legs if isinstance(leg.excursion, CrossingSite))
    paths = [shapely.LineString(site.ends_m[:, :2]) for site in sites]
    is_clear: BoolArray = np.ones(len(shapes), bool)
    for obstacles, distance_m in ((things, _KEEP_FROM_HAZARD_M), (paths, _KEEP_FROM_PATH_M)):
        is_clear[shapely.STRtree(obstacles).query(shapes, predicate="dwithin", distance=distance_m)[0]] = False
    return is_clear


def _draw_blueprint(rng: np.random.Generator, length_m: float, width_m: float) -> Blueprint | None:
    """Draw a blueprint that fits into a room, weighted by how often it is parked; None: none fits."""
    blueprints, size_m, weight = _kinds()
    weight = weight * (size_m <= (length_m, width_m)).all(axis=1)
    cumulative = np.cumsum(weight)
    if cumulative[-1] == 0.0:
        return None
    return blueprints[int(np.searchsorted(cumulative, rng.random() * cumulative[-1], side="right"))]


@lru_cache(maxsize=1)
def _kinds() -> tuple[tuple[Blueprint, ...], Float64Array, Float64Array]:
    """Blueprints that are parked, their (B, 2) lengths and widths, and their (B,) weights."""
    shares = {Tag[name]: share for name, share in _table()["share"].items()}
    kinds = tuple(
        each
        for each in load_blueprints()
        if each.kind in ("vehicle", "trailer")
        and not (each.emergency or each.land or each.tows)
        and each.frequency > 0.0
    )
    weights = np.array([each.frequency * shares.get(each.tag, 1.0) for each in kinds])
    return kinds, np.array([each.size_m[:2] for each in kinds]), weights


@lru_cache(maxsize=1)
def _table() -> Mapping[str, Any]:
    return load_table("simbev_ros.simulation.world", "parking.yaml")
