"""The events of a scene's route over time: each one is prepared, begins as the ego comes, and ends."""

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass

import numpy as np

from simbev_ros.foundation.types import Float64Array, Table
from simbev_ros.foundation.units import NS_PER_S
from simbev_ros.scene.weather_course import WeatherCourse
from simbev_ros.schema.scene.drive_spec import EventKind
from simbev_ros.schema.scene.route_progress import STANDING_MPS, RouteProgress
from simbev_ros.schema.scene.spec import SceneSpec
from simbev_ros.schema.scene.state import Event
from simbev_ros.simulation.world.actors import Actors
from simbev_ros.simulation.world.cast import actor_ids
from simbev_ros.simulation.world.events import motions
from simbev_ros.simulation.world.events.motion import EgoOnRoute, EventMotion, Stage
from simbev_ros.simulation.world.population import Population

MOTIONS: Mapping[EventKind, Callable[[Stage], EventMotion]] = {
    **dict.fromkeys((EventKind.HARD_BRAKE, EventKind.SLOW_VEHICLE), motions.Leading),
    **dict.fromkeys((EventKind.RED_LIGHT_RUNNER, EventKind.UNPROTECTED_LEFT, EventKind.MERGE), motions.Crossing),
    **dict.fromkeys((EventKind.ROUNDABOUT, EventKind.CYCLIST_AT_RIGHT_TURN), motions.Crossing),
    EventKind.CUT_IN: motions.CuttingIn,
    EventKind.HIDDEN_PEDESTRIAN: motions.HiddenPedestrian,
    EventKind.OPENING_DOOR: motions.OpeningDoor,
    EventKind.BLOCKED_LANE: motions.BlockedLane,
    EventKind.EMERGENCY_VEHICLE: motions.Pursuing,
    EventKind.FOG_BANK: motions.FogBank,
}
"""The motion of each kind of event."""


@dataclass(slots=True)
class EventRecord:
    """When an event happened.

    Attributes:
        number: Its index in the specification.
        begin_tick: The tick before which SUMO or the weather acted on it first; None: it has not begun.
        end_tick: The tick at which it was over.
    """

    number: int
    begin_tick: int | None = None
    end_tick: int | None = None


class RouteEvents:
    """All events of a scene. Events of one vehicle follow each other.

    Attributes:
        records: When each event happened, in the specification's order.
    """

    def __init__(
        self,
        spec: SceneSpec,
        population: Population,
        actors: Actors,
        weather: WeatherCourse,
        next_tick: Callable[[], int],
    ) -> None:
        """Prepare the events of a scene whose actors could be placed; ``next_tick`` returns the next one to come."""
        drive = spec.drive
        events = () if drive is None else drive.events
        self.records = tuple(EventRecord(number) for number in range(len(events)))
        self._ids = [actor_ids(spec, event.vehicles, event.pedestrians) for event in events]
        self._kinds = [event.kind for event in events]
        self._tick_s, self._next_tick = spec.tick_ns / NS_PER_S, next_tick
        self._motions: dict[int, tuple[EventMotion, tuple[int, ...]]] = {}
        self._triggers_m = [event.trigger_m for event in events]
        vehicles, pedestrians = population.vehicles, population.pedestrians
        for number, event in enumerate(events):
            if {*event.vehicles} <= {*vehicles} and {*event.pedestrians} <= {*pedestrians}:
                rows = tuple(map(vehicles.index, event.vehicles))
                walkers = tuple(map(pedestrians.index, event.pedestrians))
                stage = Stage(event, population.sumo, actors, weather, next_tick, self._tick_s, rows, walkers)
                self._motions[number] = MOTIONS[event.kind](stage), rows
        followed = sorted({row for _, some in self._motions.values() for row in some} | {0})
        self._progress = {} if drive is None else {row: RouteProgress(drive.route) for row in followed}
        self._front_m: Float64Array | None = None
        self._stood_s = 0.0

    def events_at(self, tick: int, actors: Table) -> Iterator[Event]:
        """Yield what begins and ends at a tick, with these (N,) ``ACTOR_DTYPE`` rows, the first agent's first."""
        for record in self.records:
            for when, at in (("begin", record.begin_tick), ("end", record.end_tick)):
                if at == tick:
                    x_m, y_m, z_m = (float(actors[0][axis]) for axis in "xyz")
                    kind, ids = self._kinds[record.number], self._ids[record.number]
                    yield Event(f"{kind.value}.{when}", ids, (x_m, y_m, z_m), 0.0)

    def advance(self, front_m: Float64Array) -> None:
        """Act on the next step of the traffic, with the (V, 3) fronts of the vehicles now."""
        if not self._motions:
            return
        before_m = front_m if self._front_m is None else self._front_m
        self._front_m = front_m
        speed_mps = float(np.linalg.norm((front_m - before_m)[0, :2])) / self._tick_s
        stands = speed_mps < STANDING_MPS and self._next_tick() > 0
        self._stood_s = self._stood_s + self._tick_s if stands else 0.0
        along_m = {row: progress.advance_to(front_m[row]).distance_m for row, progress in self._progress.items()}
        ego, busy = EgoOnRoute(along_m[0], speed_mps, self._stood_s), set[int]()
        for number, (motion, rows) in self._motions.items():
            record, own_m = self.records[number], np.array([along_m[row] for row in rows])
            if record.end_tick is not None or busy.intersection(rows):
                continue
            busy.update(rows)
            may_begin = self._next_tick() >= 0 and ego.front_m >= self._triggers_m[number]
            if record.begin_tick is None and motion.begins(ego, own_m) and may_begin:
                record.begin_tick = self._next_tick()
            if record.begin_tick is not None and motion.advance(ego, own_m):
                record.end_tick = self._next_tick()
