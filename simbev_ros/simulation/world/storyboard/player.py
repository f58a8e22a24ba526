"""Plays the storyboard of a scene: its entities become actors of the world, tick by tick."""

import logging
import math
from collections.abc import Callable
from dataclasses import replace

import numpy as np

from simbev_ros.foundation.geometry.transforms import rotations_from_rpy
from simbev_ros.foundation.types import Float64Array, Table
from simbev_ros.foundation.units import NS_PER_S
from simbev_ros.maps.network import RoadNetwork
from simbev_ros.scene.blueprints import blueprint_named
from simbev_ros.scene.storyboard.bodies import Body, body_of, mover_on
from simbev_ros.scene.storyboard.environment import weather_of
from simbev_ros.scene.storyboard.model import Element
from simbev_ros.scene.storyboard.positions import Positions
from simbev_ros.scene.storyboard.reading import read_resolved
from simbev_ros.scene.weather_course import WeatherCourse
from simbev_ros.schema.scene.spec import SceneSpec
from simbev_ros.schema.scene.state import EGO_ID, STORYBOARD_PREFIX, STORYBOARD_STOP, Event, Light
from simbev_ros.simulation.world.entities import Entities, EntityMotion
from simbev_ros.simulation.world.storyboard.signals import StoryboardSignals
from simbev_ros.simulation.world.storyboard.stage import Stage
from simbev_ros.simulation.world.storyboard.storyboard import Storyboard

_LOGGER = logging.getLogger(__name__)
_LIGHTS = {
    "lowBeam": Light.LOW_BEAM,
    "highBeam": Light.HIGH_BEAM,
    "brakeLights": Light.BRAKE,
    "warningLights": Light.TURN_LEFT | Light.TURN_RIGHT,
    "indicatorLeft": Light.TURN_LEFT,
    "indicatorRight": Light.TURN_RIGHT,
    "reversingLights": Light.REVERSE,
    "specialPurposeLights": Light.EMERGENCY,
}
_FLASHES_HZ = 1.5
_JUMP_M = 2.0
_WORDS = {"startTransition": "begin", "endTransition": "end", "stopTransition": "stop", "skipTransition": "skip"}
_NAMED = ("Act", "Event")


class StoryboardPlayer:
    """The storyboard of one scene.

    Attributes:
        events: Acts and events of the storyboard that have begun or ended at the latest tick.
    """

    def __init__(
        self,
        spec: SceneSpec,
        network: RoadNetwork,
        entities: Entities,
        weather: WeatherCourse,
        heights_m: Callable[[Float64Array], Float64Array] | None,
    ) -> None:
        """Read the storyboard of ``spec``; ``heights_m`` as in ``Entities``.

        Raises:
            InputError: The stored document is not that of a scenario.
        """
        assert spec.storyboard is not None
        self._spec, self._entities, self._weather, self._heights_m = spec, entities, weather, heights_m
        self._datum, self._tick_s, self._tick = network.datum, spec.tick_ns / NS_PER_S, -spec.warm_up_ticks
        scenario = read_resolved(spec.storyboard.document)
        cast = {each.name: blueprint_named(each.blueprint) for each in spec.storyboard.cast}
        bodies = {each.name: body_of(each, cast[each.name]) for each in scenario.entities}
        mover = mover_on(network, heights_m)
        self._stage = Stage(mover, Positions(mover, bodies, network.datum, network.origin_m), bodies, self._tick_s)
        self._stage.signals = StoryboardSignals(scenario.road_network.signal_controllers, network.signals)
        self._stage.weather = self._change_weather
        self._stage.values = {each.name: each.value for each in (*scenario.parameters, *scenario.variables)}
        self._ego = spec.storyboard.cast[0].name
        if spec.agents[0].driver != "traffic":
            self._stage.outside = frozenset([self._ego])
        self._storyboard = Storyboard(scenario.storyboard, self._stage)
        self._ids: dict[str, int] = {self._ego: EGO_ID}
        self._before: dict[str, tuple[Float64Array, float]] = {}
        self._told = 0
        self.events: tuple[Event, ...] = ()

    def shown_signals(self, table: Table) -> Table:
        """(S,) ``SIGNAL_DTYPE`` at the latest tick, from that of the traffic."""
        return self._stage.signals.shown(table)

    @property
    def moves_ego(self) -> bool:
        """Whether the storyboard moves the first agent."""
        return self._ego not in self._stage.outside

    def advance(self, tick: int, actors: Table) -> None:
        """Advance to a tick, the first of the warm-up first, and set the motions of its entities.

        Args:
            tick: The tick; until tick 0 the entities come along to where they are then.
            actors: (N,) ``ACTOR_DTYPE`` of the traffic at this tick.
        """
        self._tick, stage, self.events = tick, self._stage, ()
        if tick == -self._spec.warm_up_ticks:
            self._storyboard.initialize()
            self._stage.signals.advance(0.0)
            self._enter()
        if not self.moves_ego:
            self._observe(stage.bodies[self._ego], actors[actors["id"] == EGO_ID][0])
        if tick >= 0:
            if tick:
                stage.move_bodies(tick * self._spec.tick_ns / NS_PER_S)
            stage.signals.advance(stage.time_s)
            self._storyboard.advance()
            self.events = self._events()
        for note in [*stage.notes][self._told :]:
            _LOGGER.warning("%s: %s", self._spec.name, note)
        self._told = len(stage.notes)
        for name, actor in self._ids.items():
            if name not in stage.outside:
                self._show(actor, stage.bodies[name] if tick >= 0 else self._earlier(stage.bodies[name], -tick))

    def _enter(self) -> None:
        """Make entities of all bodies but the first agent's."""
        assert self._spec.storyboard is not None
        for each in self._spec.storyboard.cast[1:]:
            motion = self._motion(self._stage.bodies[each.name])
            self._ids[each.name] = self._entities.spawn(blueprint_named(each.blueprint), motion)

    def _earlier(self, body: Body, ticks: int) -> Body:
        """A copy of a body some ticks before it began, at its speed then."""
        earlier = replace(body)
        if body.is_present and body.speed_mps:
            self._stage.mover.drive(earlier, -body.speed_mps * ticks * self._tick_s)
        return earlier

    def _observe(self, body: Body, row: Table) -> None:
        """Take the state of a body from the actor that another driver moves."""
        yaw_rad = float(row["yaw"])
        body.is_present, body.yaw_rad = True, yaw_rad
        body.position_m = np.array([row["x"], row["y"], row["z"]], np.float64)
        body.position_m[:2] -= np.array(body.center_m) @ body.axes
        before_m, before_mps = self._before.get(body.name, (body.position_m, 0.0))[0], body.speed_mps
        body.speed_mps = float(np.array([row["vx"], row["vy"]], np.float64) @ body.axes[0])
        body.acceleration_mps2 = (body.speed_mps - before_mps) / self._tick_s
        body.place = self._stage.mover.lane_at(body.position_m, yaw_rad)
        if self._tick > 0:
            self._stage.mover.note_motion(body, before_m, self._tick_s)
        self._before[body.name] = body.position_m, yaw_rad

    def _show(self, actor: int, body: Body) -> None:
        """Set the motion of an actor to that of its body."""
        lights_on, lights_off = self._lights(body.name)
        motion = self._motion(body)
        shown = actor == EGO_ID or (body.is_present and body.name not in self._stage.hidden)
        self._entities.drive(actor, motion, shown=shown, lights_on=lights_on, lights_off=lights_off)
        self._before[body.name] = body.position_m.copy(), body.yaw_rad

    def _motion(self, body: Body) -> EntityMotion:
        """Pose and velocities of the center of a body's box; accelerations are those along and across its path."""
        before_m, before_rad = self._before.get(body.name, (body.position_m, body.yaw_rad))
        moved_m, turned_rad = body.position_m - before_m, math.remainder(body.yaw_rad - before_rad, math.tau)
        is_continuous = math.hypot(*moved_m[:2]) <= abs(body.speed_mps) * self._tick_s * 2.0 + _JUMP_M
        yaw_rate = turned_rad / self._tick_s if is_continuous else 0.0
        arm_m = np.array(body.center_m) @ body.axes
        velocity_mps = body.velocity_mps + yaw_rate * np.array([-arm_m[1], arm_m[0]])
        climb_mps = float(moved_m[2]) / self._tick_s if is_continuous else 0.0
        across = body.acceleration_mps2 * body.axes[0] + body.speed_mps * yaw_rate * body.axes[1]
        position_m, roll_rad, pitch_rad = self._footing(body, body.position_m + np.append(arm_m, 0.0))
        return EntityMotion(
            position_m,
            rotations_from_rpy(np.array([roll_rad, pitch_rad, body.yaw_rad])),
            np.array([*velocity_mps, climb_mps]),
            np.array([0.0, 0.0, yaw_rate]),
            np.array([*across, 0.0]),
        )

    def _footing(self, body: Body, center_m: Float64Array) -> tuple[Float64Array, float, float]:
        """The center of a body's bottom face on the ground, and roll and pitch, from the heights at its four sides."""
        if self._heights_m is None:
            return center_m, body.roll_rad, body.pitch_rad
        half_m = np.array(body.size_m[:2]) * (0.3, 0.45)
        arms_m = np.array([[1.0, 0.0], [-1.0, 0.0], [0.0, 1.0], [0.0, -1.0]]) * half_m @ body.axes
        heights_m = self._heights_m(center_m + np.column_stack([arms_m, np.zeros(4)]))
        if not np.isfinite(heights_m).all():
            return center_m, body.roll_rad, body.pitch_rad
        front_m, rear_m, left_m, right_m = heights_m.tolist()
        at_m = np.array([*center_m[:2], heights_m.mean()])
        return at_m, math.atan2(left_m - right_m, 2.0 * half_m[1]), math.atan2(rear_m - front_m, 2.0 * half_m[0])

    def _lights(self, name: str) -> tuple[int, int]:
        """Bits of the lights that actions have switched on, and off."""
        on = off = 0
        bright = (self._stage.time_s * _FLASHES_HZ) % 1.0 < 0.5
        for (body, kind), mode in self._stage.lights.items():
            if body == name and kind in _LIGHTS:
                flashes = mode == "flashing" or (mode == "on" and _LIGHTS[kind] & (Light.TURN_LEFT | Light.TURN_RIGHT))
                is_on = mode != "off" and (bright or not flashes)
                on, off = (on | _LIGHTS[kind], off) if is_on else (on, off | _LIGHTS[kind])
        return on, off & ~on

    def _change_weather(self, environment: Element) -> None:
        """Change the weather now, or in ``Init`` for the whole scene."""
        self._weather.change(weather_of(environment, self._datum), self._tick, 1)

    def _events(self) -> tuple[Event, ...]:
        """Events of this tick: who plays whom at tick 0, acts and events of the storyboard, and its stop."""
        found = []
        if self._tick == 0:
            found = [self._event(f"entity.{name}", (name,)) for name in self._ids]
        for transition, part in self._storyboard.changes:
            if part.kind in _NAMED:
                found.append(self._event(f"{part.path}.{_WORDS[transition]}", part.actors))
        if self._storyboard.has_stopped:
            found.append(self._event("", ()))
        return tuple(found)

    def _event(self, name: str, who: tuple[str, ...]) -> Event:
        x_m, y_m, z_m = self._stage.bodies[who[0] if who else self._ego].position_m.tolist()
        kind = STORYBOARD_PREFIX + name if name else STORYBOARD_STOP
        return Event(kind, tuple(sorted(self._ids[each] for each in who)), (x_m, y_m, z_m), 0.0)
