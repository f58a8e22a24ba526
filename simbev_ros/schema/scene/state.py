"""The world state at one tick: the tables that the simulation writes and every sensor and annotator reads."""

from dataclasses import dataclass
from enum import IntEnum, IntFlag

import numpy as np

from simbev_ros.foundation.geometry.transforms import matrices_from_xyz_rpy
from simbev_ros.foundation.types import Float64Array, Table
from simbev_ros.schema.messages.message_rows import message_constants, row_dtype
from simbev_ros.schema.scene.weather import Weather

EGO_ID = message_constants("Actor")["EGO_ID"]
"""Id of the first agent's vehicle in every scene."""

ACTOR_DTYPE = row_dtype("Actor")
"""Row of /world/actors; ``interfaces/msg/Actor.msg`` says what its columns mean."""

SIGNAL_DTYPE = row_dtype("TrafficSignal")
"""Row of /world/signals, a head of a traffic light; ``interfaces/msg/TrafficSignal.msg`` has its columns."""


class Light(IntFlag):
    """Bit flags of an actor's lights."""

    LOW_BEAM = 1
    BRAKE = 2
    TURN_LEFT = 4  # set only while the blinker is in its bright half
    TURN_RIGHT = 8
    REVERSE = 16
    EMERGENCY = 32  # set only while the beacon is in its bright half
    HIGH_BEAM = 64


class Behavior(IntFlag):
    """Bit flags of an actor's behavior."""

    RECKLESS = 1
    DISTRACTED = 2
    JAYWALKING = 4
    PARKED = 8
    SITTING = 16


class SignalState(IntEnum):
    """State that a traffic light shows."""

    OFF = 0
    RED = 1
    YELLOW = 2
    GREEN = 3
    RED_YELLOW = 4


COLLISION = "collision"
"""Type of the events of two actors that touch for the first time."""
ENTITY_PREFIX = "entity."
"""Prefix of the types of the events that record commands to single actors."""
STORYBOARD_PREFIX = "scenario."
"""Prefix of the types of the events of a scenario."""
STORYBOARD_STOP = "scenario.stop"
"""Type of the event that ends a scenario and its scene."""


@dataclass(frozen=True, slots=True)
class Event:
    """Something that happened during the last tick.

    Attributes:
        type: ``COLLISION``; for a command to a single actor ``entity.spawn``, ``entity.set`` or ``entity.delete``; for
            an event along the route of the first agent its kind with ``.begin`` or ``.end``; of a scenario
            ``scenario.entity.<name>`` for each entity at tick 0, ``scenario.<path>`` with ``.begin``, ``.end``,
            ``.stop`` or ``.skip`` for its acts and events, and ``STORYBOARD_STOP``.
        ids: Ids of the actors, ascending; without the first agent if the event is one of its route.
        position_m: Position, map frame; that of the first agent if the event is one of its route.
        relative_speed_mps: Relative speed of two actors just before they touch; otherwise 0.
    """

    type: str
    ids: tuple[int, ...]
    position_m: tuple[float, float, float]
    relative_speed_mps: float


@dataclass(frozen=True, slots=True)
class WorldState:
    """The world at one tick, as one agent, the ego, sees it; ``AgentView.ego_state`` makes another one the ego.

    Attributes:
        stamp_ns: Simulated time.
        tick: 0 for the first recorded tick; negative during the warm-up.
        ego_id: Id of the ego's row.
        actors: (N,) ``ACTOR_DTYPE``, ascending by id, including the ego if it is a vehicle.
        signals: (S,) ``SIGNAL_DTYPE``; the row order is constant within a scene.
        weather: Weather and light at this tick.
        events: Events since the previous tick; always empty in nodes other than the world node.
        station: The ego's row, shape (), if the ego is a roadside unit, which is not an actor.
    """

    stamp_ns: int
    tick: int
    ego_id: int
    actors: Table
    signals: Table
    weather: Weather
    events: tuple[Event, ...] = ()
    station: Table | None = None

    @property
    def ego(self) -> Table:
        """The ego's row, shape ()."""
        if self.station is not None:
            return self.station
        return self.actors[np.searchsorted(self.actors["id"], self.ego_id)]

    @property
    def ego_ids(self) -> frozenset[int]:
        """Ids of the ego and, if it has one, its rider."""
        riders = self.actors["id"][self.actors["parent"] == self.ego_id]
        return frozenset([self.ego_id, *riders.tolist()])

    @property
    def distance_to_ego_m(self) -> Float64Array:
        """(N,) horizontal distance from the ego of each actor, box center to box center."""
        offset_x_m: Float64Array = self.actors["x"] - self.ego["x"]
        offset_y_m: Float64Array = self.actors["y"] - self.ego["y"]
        return np.hypot(offset_x_m, offset_y_m)


def map_from_actors(actors: Table) -> Float64Array:
    """(N, 4, 4) transforms from each actor's frame to the map, for (N,) ``ACTOR_DTYPE`` rows."""
    xyz = np.stack([actors["x"], actors["y"], actors["z"]], axis=-1)
    rpy = np.stack([actors["roll"], actors["pitch"], actors["yaw"]], axis=-1).astype(np.float64)
    return matrices_from_xyz_rpy(xyz, rpy)
