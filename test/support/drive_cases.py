"""Drives on a made-up street along x: a lane in each direction, a junction from x = 100 to 120, ground at height 0."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from made_up_scene import made_up_spec

from simbev_ros.evaluation.driving.infractions import Infraction
from simbev_ros.evaluation.driving.referee import Referee
from simbev_ros.foundation.geometry.geodesy import MapDatum
from simbev_ros.foundation.semantics import Tag
from simbev_ros.foundation.types import Float64Array, Table
from simbev_ros.maps.land_features import MapFeatures
from simbev_ros.maps.network import Lane, RoadNetwork, Signal
from simbev_ros.maps.roads.lane_kind import LaneKind
from simbev_ros.maps.roads.layout import Layout, Sign, SignKind, Strip
from simbev_ros.maps.surroundings import SurroundingsRecipe
from simbev_ros.schema.scene.drive_spec import Command, DriveSpec, RouteSpec
from simbev_ros.schema.scene.spec import SceneSpec
from simbev_ros.schema.scene.state import ACTOR_DTYPE, EGO_ID, SIGNAL_DTYPE, SignalState, WorldState

TICK_S = 0.05
CAR_M = (4.0, 2.0, 1.5)
LIMIT_MPS = 15.0
ENDS_M = {"in": (0.0, 100.0), "inside": (100.0, 120.0), "out": (120.0, 400.0)}
LEFT_M, RIGHT_M = 1.75, -1.75
"""Centers of the lanes toward -x and +x."""

At = Callable[[float], tuple[float, float, float]]
"""Function from a time (s) to x, y (m) and yaw (rad)."""


def network(*, signal: bool = False, stop: bool = False) -> RoadNetwork:
    """The street, maybe with a traffic light or a stop sign at the end of the lane ``in``."""
    lanes, strips = [], []
    for name, (start_m, end_m) in ENDS_M.items():
        x_m = np.linspace(start_m, end_m, round((end_m - start_m) / 5.0) + 1)
        junction = "J" if name == "inside" else ""
        following = {"in": ("inside",), "inside": ("out",), "out": ()}[name]
        for side, y_m in (("", RIGHT_M), ("back_", LEFT_M)):
            line_m = np.column_stack([x_m, np.full(len(x_m), y_m), np.zeros(len(x_m))])
            line_m = line_m if not side else line_m[::-1].copy()
            left = np.array([0.0, 1.75 if not side else -1.75, 0.0])
            after = following if not side else ()
            lane = Lane(side + name, side + name, 0, LaneKind.DRIVING, line_m, 3.5, LIMIT_MPS, junction, after)
            lanes.append(lane)
            strips.append(
                Strip(lane.id, lane.id, lane.kind, line_m + left, line_m - left, junction=junction, speed_mps=LIMIT_MPS)
            )
    signs = (Sign(SignKind.STOP, np.array([99.0, -4.5, 0.0]), np.pi, ("in",)),) if stop else ()
    head = Signal(np.array([100.0, -4.0, 3.0]), np.pi, np.array([100.0, -4.0, 0.0]), "A", 0, "in")
    return RoadNetwork(
        "street",
        {lane.id: lane for lane in lanes},
        {},
        (head,) if signal else (),
        MapDatum(42.0, -83.0, 100.0),
        Path("net"),
        Path("xodr"),
        Layout(tuple(strips), (), (), signs),
        MapFeatures(SurroundingsRecipe(use="farmland")),
        0,
    )


def spec(
    *, start_m: float = 10.0, goal_m: float = 310.0, vehicles: Sequence[Mapping[str, Any]] = (), **drive: Any
) -> SceneSpec:
    """A scene whose first agent drives along the right lane; ``vehicles`` change the others, of which there are 9."""
    x_m = np.arange(start_m, goal_m + 0.5).tolist()
    count = len(x_m)
    route = RouteSpec(
        x_m=tuple(x_m),
        y_m=(RIGHT_M,) * count,
        z_m=(0.0,) * count,
        distance_m=tuple(x - start_m for x in x_m),
        limit_mps=(LIMIT_MPS,) * count,
        lane=tuple("in" if x < 100 else "inside" if x < 120 else "out" for x in x_m),
        command=(Command.FOLLOW,) * count,
    )
    values = {"goal_radius_m": 2.0, "standstill_s": 60.0, "off_route_m": 30.0} | drive
    made = made_up_spec([], ticks=6000)
    cars = [made.vehicles[0].model_copy(update=each) for each in [{}, *vehicles, *[{}] * (9 - len(vehicles))]]
    return made.model_copy(update={"vehicles": tuple(cars), "drive": DriveSpec(route=route, **values)})


def actor(actor_id: int, at: At, time_s: float, tag: Tag = Tag.CAR, size_m: Sequence[float] = CAR_M) -> Table:
    """Row of an actor with velocities and accelerations as central differences."""
    before, now, after = (np.array(at(time_s + step)) for step in (-TICK_S, 0.0, TICK_S))
    row = np.zeros((), ACTOR_DTYPE)
    row["id"], row["tag"] = actor_id, tag
    row["x"], row["y"], row["yaw"] = now
    row["vx"], row["vy"], row["wz"] = (after - before) / (2.0 * TICK_S)
    row["ax"], row["ay"] = ((after - 2.0 * now + before) / TICK_S**2)[:2]
    row["length"], row["width"], row["height"] = size_m
    return row


def state(scene: SceneSpec, tick: int, rows: Sequence[Table], light: SignalState | None = None) -> WorldState:
    """World state of actors and maybe the traffic light."""
    signals = np.zeros(0 if light is None else 1, SIGNAL_DTYPE)
    signals["state"] = 0 if light is None else light
    return WorldState(scene.stamp_ns(tick), tick, EGO_ID, np.stack(rows), signals, scene.weather)


def drive(
    at: At,
    seconds: float,
    scene: SceneSpec | None = None,
    roads: RoadNetwork | None = None,
    *,
    others: Callable[[float], Sequence[Table]] = lambda _: (),
    light: Callable[[float], SignalState | None] = lambda _: None,
    referee: Referee | None = None,
) -> tuple[Referee, list[Infraction]]:
    """Let a referee judge a drive of the ego and other actors; returns it and the infractions."""
    scene = scene or spec()
    referee = referee or Referee(scene, roads or network())
    found: list[Infraction] = []
    for tick in range(round(seconds / TICK_S) + 1):
        time_s = tick * TICK_S
        rows = [actor(EGO_ID, at, time_s), *others(time_s)]
        found += referee.judge(state(scene, tick, rows, light(time_s)))
    return referee, found


def straight(speed_mps: float, x_m: float = 10.0, y_m: float = RIGHT_M, yaw_rad: float = 0.0) -> At:
    """Constant speed along the heading."""
    along = np.array([np.cos(yaw_rad), np.sin(yaw_rad)]) * speed_mps
    return lambda time_s: (x_m + along[0] * time_s, y_m + along[1] * time_s, yaw_rad)


def braking(speed_mps: float, deceleration_mps2: float, from_s: float = 0.0, x_m: float = 10.0) -> At:
    """Constant speed along x, then a constant deceleration to standstill."""

    def at(time_s: float) -> tuple[float, float, float]:
        braked_s = min(max(time_s - from_s, 0.0), speed_mps / deceleration_mps2)
        driven_m = speed_mps * min(time_s, from_s) + speed_mps * braked_s - deceleration_mps2 * braked_s**2 / 2.0
        return x_m + driven_m, RIGHT_M, 0.0

    return at


def with_lane(roads: RoadNetwork, name: str, **changes: Any) -> RoadNetwork:
    """The roads with other fields of a lane."""
    return replace(roads, lanes={**roads.lanes, name: replace(roads.lanes[name], **changes)})


def points(values: Sequence[Sequence[float]]) -> Float64Array:
    """Numbers as an array."""
    return np.array(values, np.float64)
