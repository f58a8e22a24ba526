"""Messages between agents (V2X): the pose and the boxes that each agent sends, and which agents receive them.

The world state and the boxes around each agent enter, tick by tick; ``V2X_DTYPE`` tables leave: what is sent, and what
arrives. Everything random follows from the seed, the agents' names and the tick.
"""

import math
from collections.abc import Mapping
from typing import NamedTuple

import numpy as np

from simbev_ros.config.draw import sample
from simbev_ros.foundation.random import stream
from simbev_ros.foundation.types import BoolArray, Float64Array, Table
from simbev_ros.foundation.units import NS_PER_S
from simbev_ros.schema.boxes import NO_CLASS
from simbev_ros.schema.scene.agents import AgentView, agent_views
from simbev_ros.schema.scene.spec import SceneSpec
from simbev_ros.schema.scene.state import WorldState
from simbev_ros.schema.scene.v2x_spec import V2xSpec
from simbev_ros.schema.v2x import OWN_POSE, V2X_DTYPE
from simbev_ros.simulation.annotation.boxes.boxes import class_of_blueprint

_FROM_BOXES = [name for name in V2X_DTYPE.names or () if name not in ("sender", "tick")]
_FROM_VEHICLE = [*("x", "y", "z", "roll", "pitch", "yaw", "length", "width", "height"), *("vx", "vy", "vz")]


class Exchange(NamedTuple):
    """Messages of one tick, by the agent's name, each (N,) ``V2X_DTYPE``.

    Attributes:
        sent: The message of each sender; empty at ticks at which none is due.
        arrived: All that arrives at each receiver: by sender in the order of the agents, then by tick.
    """

    sent: Mapping[str, Table]
    arrived: Mapping[str, Table]


class _Message(NamedTuple):
    """A message on its way to a receiver; they are sorted by sender and tick."""

    sender_index: int
    tick: int
    arrival_tick: int
    rows: Table


class V2xNetwork:
    """The agents of one scene that exchange messages. Nothing has been sent before its first tick."""

    def __init__(self, spec: SceneSpec, settings: V2xSpec) -> None:
        """Start with no messages on their way.

        Args:
            spec: The specification.
            settings: Its messages, ``spec.v2x``.
        """
        self._settings, self._seed, self._tick_ns = settings, spec.seed, spec.tick_ns
        self._views = {view.agent: view for view in agent_views(spec) if view.agent in settings.agents}
        self._period_ticks = spec.period_ticks(settings.rate_hz)
        self._on_their_way: dict[str, list[_Message]] = {name: [] for name in self._views}

    def exchange(self, state: WorldState, boxes: Mapping[str, Table]) -> Exchange:
        """Send the messages that are due at a tick, later than all earlier ones, and deliver those that arrive.

        Args:
            state: State of the scene.
            boxes: (N,) ``BOX_DTYPE`` around each agent; an agent without them sends its pose alone.
        """
        sent = {}
        if state.tick % self._period_ticks == 0:
            carriers = {name: view.ego_row(state.actors) for name, view in self._views.items()}
            for name, view in self._views.items():
                sent[name] = message_of(view, self._settings, carriers[name], boxes.get(name), state.tick)
                self._send(name, sent[name], carriers, state.tick)
        return Exchange(sent, {name: self._arriving(name, state.tick) for name in self._views})

    def _send(self, sender: str, rows: Table, carriers: Mapping[str, Table], tick: int) -> None:
        """Put a message on its way to all agents that it will reach."""
        index = list(self._views).index(sender)
        message = _Message(index, tick, tick + self._latency_ticks(sender, tick), rows)
        for receiver, waiting in self._on_their_way.items():
            is_near = _distance_m(carriers[sender], carriers[receiver]) <= self._settings.range_m
            if receiver != sender and is_near and not self._is_lost(sender, receiver, tick):
                waiting.append(message)

    def _latency_ticks(self, sender: str, tick: int) -> int:
        """Latency of a message, rounded up to whole ticks."""
        latency_s = sample(self._settings.latency_s, stream(self._seed, f"v2x_latency.{sender}", tick))
        return math.ceil(latency_s * NS_PER_S / self._tick_ns - 1e-6)

    def _is_lost(self, sender: str, receiver: str, tick: int) -> bool:
        loss = self._settings.loss
        return loss > 0.0 and bool(stream(self._seed, f"v2x.{sender}.{receiver}", tick).random() < loss)

    def _arriving(self, receiver: str, tick: int) -> Table:
        """Take what arrives at a tick from the messages on their way, with what arrived at ticks left out."""
        waiting = self._on_their_way[receiver]
        arriving = sorted((each for each in waiting if each.arrival_tick <= tick), key=lambda each: each[:2])
        self._on_their_way[receiver] = [each for each in waiting if each.arrival_tick > tick]
        return np.concatenate([np.zeros(0, V2X_DTYPE), *(each.rows for each in arriving)])


def message_of(view: AgentView, settings: V2xSpec, carrier: Table, boxes: Table | None, tick: int) -> Table:
    """(N,) ``V2X_DTYPE`` message of an agent: its own pose, then the boxes that it sees.

    Args:
        view: The agent's view of the scene.
        settings: Which boxes count as seen, and the errors.
        carrier: The agent's ``ACTOR_DTYPE`` row, shape ().
        boxes: (M,) ``BOX_DTYPE`` around the agent; None: unknown.
        tick: The tick.
    """
    seen = np.zeros(0, V2X_DTYPE) if boxes is None else boxes[_are_seen(boxes, settings)]
    rows = np.zeros(1 + len(seen), V2X_DTYPE)
    for name in _FROM_BOXES:
        rows[name][1:] = seen[name]
    for name in _FROM_VEHICLE:
        rows[name][0] = carrier[name]
    own = rows[0]
    own["id"], own["class"] = OWN_POSE, NO_CLASS if view.station else class_of_blueprint()[carrier["blueprint"]]
    own["lidar_points"], own["radar_points"], own["visibility"] = -1, -1, np.nan
    rows["sender"], rows["tick"] = view.ego_id, tick
    _add_errors(rows, view, settings, tick)
    return rows


def _are_seen(boxes: Table, settings: V2xSpec) -> BoolArray:
    """(N,) whether an agent sees the boxes around it."""
    seen = np.zeros(len(boxes), np.bool_)
    if settings.min_points is not None:
        points = np.maximum(boxes["lidar_points"], 0) + np.maximum(boxes["radar_points"], 0)
        seen |= points >= settings.min_points
    if settings.min_visibility is not None:
        seen |= (boxes["visibility"] > 0.0) & (boxes["visibility"] >= settings.min_visibility)
    return seen


def _add_errors(rows: Table, view: AgentView, settings: V2xSpec, tick: int) -> None:
    """Move and turn a message with the error of the sender's pose, and each box with an error of its own."""
    draws = stream(view.noise_seed, "v2x.errors", tick).standard_normal((len(rows), 3))
    if settings.pose_sigma_m or settings.pose_yaw_sigma_deg:
        turn_rad = math.radians(settings.pose_yaw_sigma_deg) * float(draws[0, 2])
        _turn(rows, ("x", "y"), (float(rows["x"][0]), float(rows["y"][0])), turn_rad)
        _turn(rows, ("vx", "vy"), (0.0, 0.0), turn_rad)
        _shift(rows, settings.pose_sigma_m * draws[:1, :2], turn_rad)
    if settings.position_sigma_m or settings.yaw_sigma_deg:
        turns_rad = math.radians(settings.yaw_sigma_deg) * draws[1:, 2]
        _shift(rows[1:], settings.position_sigma_m * draws[1:, :2], turns_rad)


def _turn(rows: Table, names: tuple[str, str], pivot: tuple[float, float], turn_rad: float) -> None:
    """Turn vectors in the columns of x and y counterclockwise around a pivot."""
    x, y = (rows[name] - zero for name, zero in zip(names, pivot, strict=True))
    cosine, sine = math.cos(turn_rad), math.sin(turn_rad)
    rows[names[0]] = pivot[0] + x * cosine - y * sine
    rows[names[1]] = pivot[1] + x * sine + y * cosine


def _shift(rows: Table, offsets_m: Float64Array, turns_rad: Float64Array | float) -> None:
    """Add (N, 2) or (1, 2) offsets to positions, and angles to headings."""
    rows["x"] += offsets_m[:, 0]
    rows["y"] += offsets_m[:, 1]
    rows["yaw"] = (rows["yaw"] + turns_rad + math.pi) % (2.0 * math.pi) - math.pi


def _distance_m(first: Table, second: Table) -> float:
    """Distance between the positions of two ``ACTOR_DTYPE`` rows, shape ()."""
    return math.dist(*([float(row[name]) for name in "xyz"] for row in (first, second)))
