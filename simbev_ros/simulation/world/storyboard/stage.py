"""The stage of a storyboard: its entities, the actions that move them, and what else actions have set."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from datetime import datetime, timedelta
from typing import Protocol

import numpy as np

from simbev_ros.foundation.errors import InputError
from simbev_ros.scene.storyboard.bodies import Body, Mover
from simbev_ros.scene.storyboard.positions import Positions
from simbev_ros.simulation.world.storyboard.signals import StoryboardSignals


class Motion(Protocol):
    """An action that moves an entity for some time.

    Attributes:
        done: It has reached its goal, or another action has taken its place.
    """

    done: bool

    def distance_m(self, stage: "Stage", body: Body) -> float:
        """Set the speed after this tick; returns the distance of the tick."""

    def steer(self, stage: "Stage", body: Body, distance_m: float) -> None:
        """Move the entity by the distance of this tick."""


@dataclass(slots=True, eq=False)
class Stage:
    """State of the entities between two ticks, and of all that actions and conditions refer to.

    Attributes:
        mover: Roads and ground.
        positions: Resolves positions.
        bodies: The entities by name, in the order of the file.
        values: Parameters and variables by name.
        tick_s: Length of a tick.
        time_s: Time since the storyboard began.
        outside: Names of the entities that are driven from outside.
        longitudinal: Actions that set the speed, by entity.
        lateral: Actions that set the lateral position, by entity.
        lights: Modes of lights by entity and type of light: on, off or flashing.
        hidden: Entities that nobody sees.
        signals: Traffic signals.
        clock: A date, the time at which it was set, and whether it goes on.
        weather: Receives the elements ``Environment``.
        notes: What cannot be done, once each.
    """

    mover: Mover
    positions: Positions
    bodies: dict[str, Body]
    tick_s: float
    values: dict[str, str] = field(default_factory=dict)
    time_s: float = 0.0
    outside: frozenset[str] = frozenset()
    longitudinal: dict[str, Motion] = field(default_factory=dict)
    lateral: dict[str, Motion] = field(default_factory=dict)
    lights: dict[tuple[str, str], str] = field(default_factory=dict)
    hidden: set[str] = field(default_factory=set)
    signals: StoryboardSignals = field(default_factory=lambda: StoryboardSignals(()))
    clock: tuple[datetime, float, bool] | None = None
    weather: Callable[..., None] = lambda environment: None
    notes: dict[str, None] = field(default_factory=dict)

    @property
    def date_time(self) -> datetime | None:
        """The simulated date and time, if an action has set it."""
        if self.clock is None:
            return None
        date, since_s, animated = self.clock
        return date + timedelta(seconds=(self.time_s - since_s) * animated)

    @contextmanager
    def noted(self, consequence: str) -> Iterator[None]:
        """Note the InputError that the block may raise, such as for a position that does not exist now."""
        try:
            yield
        except InputError as error:
            if not any(note.startswith(str(error).rpartition(": ")[0]) for note in self.notes):  # of this element
                self.notes[f"{error}; {consequence}"] = None

    def take_over(self, motions: dict[str, Motion], body: Body, motion: Motion) -> None:
        """Let an action take the place of the one that moves an entity in the same domain."""
        if (former := motions.get(body.name)) is not None and former is not motion:
            former.done = True
        motions[body.name] = motion

    def move_bodies(self, time_s: float) -> None:
        """Move all entities to a time, one tick later; those driven from outside are where they have been put."""
        self.time_s = time_s
        self._drop_done()
        for body in self.bodies.values():
            if not body.is_present or body.name in self.outside:
                continue
            before_m, before_mps = body.position_m, body.speed_mps
            motion, steering = self.longitudinal.get(body.name), self.lateral.get(body.name)
            distance_m = body.speed_mps * self.tick_s if motion is None else motion.distance_m(self, body)
            body.along_share = 1.0
            if steering is None:
                body.lateral_mps = 0.0
                self.mover.drive(body, distance_m)
            else:
                steering.steer(self, body, distance_m)
            body.acceleration_mps2 = (body.speed_mps - before_mps) / self.tick_s
            self.mover.note_motion(body, before_m, self.tick_s)
        self._drop_done()

    def _drop_done(self) -> None:
        """Forget the actions that are done."""
        for motions in (self.longitudinal, self.lateral):
            for name in [name for name, motion in motions.items() if motion.done]:
                del motions[name]

    def gap_m(self, body: Body, other: Body) -> float:
        """How far another entity's reference point is ahead of an entity: along the roads, else along its heading."""
        if body.place is not None and other.place is not None:
            point = self.mover.roads.point_of(other.place)
            if (along_m := self.mover.roads.distance_m(body.place, point)) is not None:
                return along_m
        return float(body.axes[0] @ np.asarray(other.position_m - body.position_m)[:2])
