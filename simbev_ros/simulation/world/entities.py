"""Actors that commands put into a running scene, move, or take out of it: poses and velocities in, rows out.

An actor of the traffic that is moved leaves the traffic and becomes such an entity, under its id. An entity moves
with constant acceleration and angular acceleration until the next command, exactly, and without regard to others.
Unless it is given a vertical motion, it stays at its height above the ground. What it tows or carries goes with it.
"""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from simbev_ros.foundation.errors import InputError
from simbev_ros.foundation.geometry.transforms import rotations_from_rpy, rpy_from_rotation
from simbev_ros.foundation.types import Float64Array, Table
from simbev_ros.scene.blueprints import Blueprint, blueprint_index, blueprint_named, load_blueprints
from simbev_ros.scene.gait import stride_lengths_m
from simbev_ros.schema.boxes import LIGHT_IDS
from simbev_ros.schema.scene.state import ACTOR_DTYPE, COLLISION, ENTITY_PREFIX, Behavior, Event
from simbev_ros.schema.scene.weather import Weather
from simbev_ros.simulation.world.kinematics.contacts import BodyBoxes
from simbev_ros.simulation.world.lights import vehicle_lights

MAX_ENTITIES = 1000
"""Maximum number of spawned and moved actors in a scene."""
SPAWNED, DELETED, MOVED = (ENTITY_PREFIX + word for word in ("spawn", "delete", "set"))
"""Types of the events that record commands."""

_MAX_STEER_RAD = 0.7
_MIN_STEERING_MPS = 0.3
_AXES = ("x", "y", "z")
_COLUMNS = (_AXES, ("vx", "vy", "vz"), ("ax", "ay", "az"), ("wx", "wy", "wz"), ("roll", "pitch", "yaw"))
_STILL: Float64Array = np.zeros(3)


@dataclass(slots=True)
class EntityMotion:
    """Pose, velocities and accelerations of an entity, map frame.

    Attributes:
        position_m: (3,) center of the bottom face of its box.
        rotation: (3, 3) map from entity.
        velocity_mps: (3,).
        rates_radps: (3,) angular velocity.
        acceleration_mps2: (3,).
        angular_radps2: (3,) angular acceleration.
    """

    position_m: Float64Array
    rotation: Float64Array
    velocity_mps: Float64Array = field(default_factory=_STILL.copy)
    rates_radps: Float64Array = field(default_factory=_STILL.copy)
    acceleration_mps2: Float64Array = field(default_factory=_STILL.copy)
    angular_radps2: Float64Array = field(default_factory=_STILL.copy)

    @classmethod
    def of_row(cls, row: Table) -> "EntityMotion":
        """The motion of an actor, one ``ACTOR_DTYPE`` row; without accelerations, which are those of a moment."""
        position_m, velocity_mps, _, rates_radps, rpy_rad = (
            np.array([row[name] for name in names], np.float64) for names in _COLUMNS
        )
        return cls(position_m, rotations_from_rpy(rpy_rad), velocity_mps, rates_radps)

    @property
    def is_at_rest(self) -> bool:
        """Whether it stays where it is."""
        parts = self.velocity_mps, self.rates_radps, self.acceleration_mps2, self.angular_radps2
        return not any(each.any() for each in parts)

    def after(self, time_s: float) -> "EntityMotion":
        """The motion some time later."""
        turn = self.rates_radps * time_s + self.angular_radps2 * (time_s**2 / 2.0)
        return EntityMotion(
            self.position_m + self.velocity_mps * time_s + self.acceleration_mps2 * (time_s**2 / 2.0),
            _rotation(turn) @ self.rotation if turn.any() else self.rotation,
            self.velocity_mps + self.acceleration_mps2 * time_s,
            self.rates_radps + self.angular_radps2 * time_s,
            self.acceleration_mps2,
            self.angular_radps2,
        )


@dataclass(slots=True)
class _Entity:
    """An entity; the first of its ``rows`` is its own, the others hang on it at (K, 3) offsets in its frame."""

    rows: Table
    offsets_m: Float64Array
    motion: EntityMotion
    is_new: bool = True
    is_lit: bool | None = None
    is_driven: bool = False
    is_shown: bool = True
    lights: tuple[int, int] = (0, 0)  # bits that are on and off whatever the vehicle does

    @property
    def blueprint(self) -> Blueprint:
        return load_blueprints()[int(self.rows["blueprint"][0])]


class Entities:
    """The entities of one scene.

    Attributes:
        events: Commands and first contacts since the latest ``advance_entities``.
    """

    def __init__(
        self, tick_s: float, first_id: int, heights_m: Callable[[Float64Array], Float64Array] | None = None
    ) -> None:
        """Start without entities.

        Args:
            tick_s: Length of a tick.
            first_id: Id of the first one that is spawned; all other actors have lower ones.
            heights_m: Function from (N, 3) points to the (N,) heights of the ground there; None: it is level.
        """
        self._tick_s, self._next_id, self._heights_m = tick_s, first_id, heights_m
        self._entities: dict[int, _Entity] = {}
        self._spawned: set[int] = set()
        self._hidden: set[int] = set()
        self._commands: list[Event] = []
        self._touching: set[tuple[int, int]] = set()
        self.events: tuple[Event, ...] = ()

    def __len__(self) -> int:
        return len(self._entities)

    def __contains__(self, actor: object) -> bool:
        return actor in self._entities

    @property
    def spawned(self) -> frozenset[int]:
        """Ids of the entities that commands have put into the scene."""
        return frozenset(self._spawned)

    def motion(self, actor: int) -> EntityMotion:
        """Motion of an entity; raises KeyError if the actor is none."""
        return self._entities[actor].motion

    def spawn(self, blueprint: Blueprint, motion: EntityMotion) -> int:
        """Put a new entity into the scene, with what belongs to its model; returns its id.

        Raises:
            InputError: There are too many.
        """
        first, parts = self._next_id, list(_parts(blueprint))
        self.require_room(first + len(parts))
        rows = np.zeros(len(parts), ACTOR_DTYPE)
        rows["id"] = first + np.arange(len(parts))
        rows["color"] = [each.colors[first % len(each.colors)] for each, _ in parts]  # alternately
        rows["blueprint"] = [blueprint_index()[each.name] for each, _ in parts]
        rows["tag"] = [each.tag for each, _ in parts]
        rows["parent"] = [first * (each.kind == "rider") for each, _ in parts]
        rows["length"], rows["width"], rows["height"] = np.array([each.size_m for each, _ in parts]).T
        self._next_id = first + len(parts)
        self._add(first, rows, np.array([offset_m for _, offset_m in parts]), motion)
        self._spawned.add(first)
        self._note(SPAWNED, first)
        return first

    def adopt(self, rows: Table, offsets_m: Float64Array) -> None:
        """Make an entity of an actor that has left the traffic.

        Args:
            rows: (1 + K,) ``ACTOR_DTYPE``: the actor, and what hangs on it.
            offsets_m: (1 + K, 3) where, in its frame.
        """
        self._hidden.update(rows["id"].tolist())
        self._add(int(rows["id"][0]), rows, offsets_m, EntityMotion.of_row(rows[0]))

    def place(self, actor: int, motion: EntityMotion) -> None:
        """Set the motion of an entity."""
        entity = self._entities[actor]
        entity.motion, entity.is_new = motion, True
        self._note(MOVED, actor)

    def drive(self, actor: int, motion: EntityMotion, *, shown: bool, lights_on: int, lights_off: int) -> None:
        """Set the motion that an entity has at the coming tick, without a command; do so for each tick from now on.

        Args:
            actor: Its id.
            motion: Its motion then.
            shown: Whether it is in the scene.
            lights_on: Bits of lights that are on.
            lights_off: Bits of lights that are off.
        """
        entity = self._entities[actor]
        entity.motion, entity.is_driven, entity.is_shown = motion, True, shown
        entity.lights = lights_on, lights_off

    def delete(self, actor: int) -> None:
        """Take an entity out of the scene."""
        self._note(DELETED, actor)
        del self._entities[actor]
        self._spawned.discard(actor)

    def advance_entities(self, weather: Weather) -> None:
        """Advance by one tick; entities that have just been placed are where they were placed."""
        for entity in self._entities.values():
            if not (entity.is_new or entity.is_driven):
                if entity.motion.is_at_rest and entity.is_lit == weather.needs_low_beam:
                    continue
                entity.motion = self._on_ground(entity.motion, entity.motion.after(self._tick_s))
            _fill(entity, 0.0 if entity.is_new else self._tick_s, weather)
            own, (on, off) = entity.rows["parent"] == 0, entity.lights
            entity.rows["lights"][own] = (entity.rows["lights"][own] & ~np.uint16(off)) | np.uint16(on)
            entity.is_new, entity.is_lit = False, weather.needs_low_beam
        self.events, self._commands = tuple(self._commands), []

    def overlay(self, actors: Table) -> Table:
        """(N,) ``ACTOR_DTYPE``, ascending by id: other actors without those that left the traffic, and the entities."""
        if not self._entities and not self._hidden:
            return actors
        kept = actors[~np.isin(actors["id"], sorted(self._hidden))]
        rows = np.concatenate(
            [kept, *(each.rows for each in self._entities.values() if each.is_shown)], dtype=actors.dtype
        )
        return rows[np.argsort(rows["id"])]

    def note_contacts(self, actors: Table) -> None:
        """Add an event for each entity that touches another of the (N,) actors, unless it did at the tick before."""
        if not self._entities:
            return
        pairs = _touching(actors, self._entities)
        placed = {actor for event in self.events for actor in event.ids}  # perhaps in contact
        new = [pair for pair in sorted(pairs - self._touching) if placed.isdisjoint(pair)]
        self.events += tuple(_contact(actors, *pair) for pair in new)
        self._touching = pairs

    def ahead(self, time_s: float) -> Iterator[tuple[int, tuple[float, float, float], EntityMotion]]:
        """Yield id, size and motion, some time ahead, of each entity."""
        for actor, entity in self._entities.items():
            if not entity.is_shown:
                continue
            yield actor, entity.blueprint.size_m, entity.motion.after(time_s)

    def _add(self, actor: int, rows: Table, offsets_m: Float64Array, motion: EntityMotion) -> None:
        self._entities[actor] = entity = _Entity(rows.copy(), offsets_m, motion)
        _pose(entity)

    def _note(self, kind: str, actor: int) -> None:
        """Record a command that has acted on an entity."""
        entity = self._entities[actor]
        _pose(entity)
        x_m, y_m, z_m = entity.motion.position_m.tolist()
        self._commands.append(Event(kind, (actor,), (x_m, y_m, z_m), 0.0))

    def require_room(self, next_id: int = 0) -> None:
        """Raise InputError if there cannot be one more, or not with ids up to the next one after it."""
        if len(self) >= MAX_ENTITIES or next_id >= LIGHT_IDS:
            raise InputError(f"a scene can have {MAX_ENTITIES} entities that were spawned or moved")

    def _on_ground(self, before: EntityMotion, after: EntityMotion) -> EntityMotion:
        """Keep the height above the ground, unless the vertical motion is given."""
        is_given = before.velocity_mps[2] or before.acceleration_mps2[2]
        if self._heights_m is not None and not is_given and (before.position_m != after.position_m).any():
            was_m, is_m = self._heights_m(np.stack([before.position_m, after.position_m])).tolist()
            after.position_m[2] += is_m - was_m if np.isfinite(is_m - was_m) else 0.0
        return after


def _parts(blueprint: Blueprint) -> Iterator[tuple[Blueprint, Sequence[float]]]:
    """A model, and the models that belong to it, each with its offset."""
    yield blueprint, (0.0, 0.0, 0.0)
    if blueprint.rider:
        yield blueprint_named(blueprint.rider), blueprint.rider_seat_m
    if blueprint.tows:
        towed = blueprint_named(blueprint.tows)
        yield towed, (blueprint.hitch_m - towed.hitch_m, 0.0, 0.0)


def _fill(entity: _Entity, time_s: float, weather: Weather) -> None:
    """Fill the changing columns of an entity's rows, after some time since the latest tick."""
    _pose(entity)
    rows, motion = entity.rows, entity.motion
    speed_mps = float(motion.velocity_mps @ motion.rotation[:, 0])
    forward_mps2 = float(motion.acceleration_mps2 @ motion.rotation[:, 0])
    for row, model in zip(rows, [load_blueprints()[index] for index in rows["blueprint"].tolist()], strict=True):
        if model.wheel_radius_m:
            row["wheel"] += speed_mps * time_s / model.wheel_radius_m
        stride_m = stride_lengths_m(np.array([model.tall_m]), np.abs([speed_mps]))[0] if model.on_foot else 0.0
        if stride_m or model.stride_m:
            turn_rad = 2.0 * np.pi * speed_mps * time_s / (stride_m or model.stride_m)
            row["gait"] = (row["gait"] + turn_rad) % (2.0 * np.pi)
    if entity.blueprint.kind != "vehicle":
        return
    off, speed, acceleration = np.zeros(1, bool), np.array([speed_mps]), np.array([forward_mps2])
    is_parked = bool(rows["behavior"][0] & Behavior.PARKED)
    if not is_parked or motion.velocity_mps.any():
        rows["lights"][rows["parent"] == 0] = vehicle_lights(
            np.zeros(1, np.int64), speed, acceleration, off, off, weather, off
        )
        rows["behavior"][0] &= ~np.uint16(Behavior.PARKED)
    if abs(speed_mps) > _MIN_STEERING_MPS:
        steer_rad = np.arctan(entity.blueprint.wheelbase_m * motion.rates_radps[2] / speed_mps)
        rows["steer"][0] = np.clip(steer_rad, -_MAX_STEER_RAD, _MAX_STEER_RAD)


def _pose(entity: _Entity) -> None:
    """Write the motion of an entity to its rows; those that hang on it move with it."""
    rows, motion = entity.rows, entity.motion
    arm_m = entity.offsets_m @ motion.rotation.T
    values = (
        motion.position_m + arm_m,
        motion.velocity_mps + (np.cross(motion.rates_radps, arm_m) if motion.rates_radps.any() else 0.0 * arm_m),
        motion.acceleration_mps2,
        motion.rates_radps,
        rpy_from_rotation(motion.rotation),
    )
    for names, vectors in zip(_COLUMNS, values, strict=True):
        for name, column in zip(names, vectors.T, strict=True):
            rows[name] = column


def _rotation(turn_rad: Float64Array) -> Float64Array:
    """(3, 3) rotation by a (3,) vector (Rodrigues' formula)."""
    angle_rad = float(np.linalg.norm(turn_rad))
    x, y, z = turn_rad / angle_rad
    cross = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    return np.asarray(np.eye(3) + np.sin(angle_rad) * cross + (1.0 - np.cos(angle_rad)) * cross @ cross)


def _touching(actors: Table, entities: Mapping[int, _Entity]) -> set[tuple[int, int]]:
    """Pairs of ids, ascending, of an entity and another actor whose boxes overlap; riders count as their vehicles."""
    rows = actors[actors["parent"] == 0]
    is_entity = np.isin(rows["id"], list(entities))
    rows = np.concatenate([rows[is_entity], rows[~is_entity]], dtype=actors.dtype)
    position_m, size_m = (
        np.column_stack([rows[name].astype(np.float64) for name in names])
        for names in (_AXES, ("length", "width", "height"))
    )
    boxes = BodyBoxes(size_m, int(np.count_nonzero(is_entity)))
    pairs = boxes.touching_pairs(position_m, rows["yaw"].astype(np.float64))
    owner = {part: actor for actor, entity in entities.items() for part in entity.rows["id"].tolist()}
    return {
        (min(pair), max(pair))
        for pair in rows["id"][pairs].tolist()
        if owner.get(pair[0]) != owner.get(pair[1], pair[1])
    }


def _contact(actors: Table, a: int, b: int) -> Event:
    """Event of two actors that touch, at the middle between them."""
    pair = actors[np.isin(actors["id"], [a, b])]
    x_m, y_m, z_m = (float(pair[name].mean()) for name in _AXES)
    relative_mps = float(np.linalg.norm([np.ptp(pair[name].astype(np.float64)) for name in ("vx", "vy", "vz")]))
    return Event(COLLISION, (a, b), (x_m, y_m, z_m), relative_mps)
