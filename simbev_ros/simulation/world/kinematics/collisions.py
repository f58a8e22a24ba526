"""Collisions: bodies that touch do not pass through each other, but slide on together and come to rest.

An impact is plastic: both bodies continue with the velocity that conserves their momentum, and brake with locked
wheels. The mass of a body is taken as the volume of its box; parked vehicles are not pushed away. Input and output are
the poses about to be published, in the map frame.
"""

from dataclasses import dataclass

import numpy as np

from simbev_ros.foundation.types import BoolArray, Float64Array, Int64Array
from simbev_ros.simulation.world.kinematics.contacts import BodyBoxes

_SKID_MPS2 = 7.0
_IMMOVABLE = 1e12
_MIN_IMPACT_MPS = 1.0  # bodies that slide together have no relative speed; at this speed it is a new impact
_MIN_JOLT_MPS2 = 11.0  # minimum acceleration that counts as an impact for a body pushed by others
_BISECTION_STEPS = 8  # halvings of the tick of an impact: 4 mm for a step of 1 m
_MOMENTUM_SWEEPS = 8  # sweeps over all contacts of a tick, until bodies pushed by each other share one velocity
_MAX_DRIFT_M = 1.5  # along each axis, between two searches for bodies near each other
_NONE = np.zeros((0, 2), np.int64)
_REMOVED_M = 1000.0
_MAX_EXACT_ROUNDS = 4  # rounds of consequential impacts within a tick; bodies that touch later stay where they were


@dataclass(frozen=True, slots=True)
class Impact:
    """Two bodies touch for the first time, or a third body makes them hit each other again.

    Attributes:
        bodies: Indices of the two bodies.
        position_m: (3,) between their centers, weighted by their sizes.
        relative_speed_mps: Relative speed before the impact.
    """

    bodies: tuple[int, int]
    position_m: Float64Array
    relative_speed_mps: float


class Collisions:
    """Motion of G bodies, some of which collide.

    Attributes:
        crashed: (G,) bool; whether a body has collided and no longer follows its point.
        impacts: Impacts of the latest tick.
    """

    def __init__(
        self,
        boxes: BodyBoxes,
        position_m: Float64Array,
        rpy_rad: Float64Array,
        tick_s: float,
        parked: int = 0,
        coupled: Int64Array = _NONE,
    ) -> None:
        """Start at rest at (G, 3) positions and (G, 3) roll, pitch, yaw; pairs that touch now may do so until apart.

        The last ``parked`` bodies never move. The (T, 2) ``coupled`` pairs, vehicles and what they tow, crash together.
        """
        self.crashed: BoolArray = np.zeros(len(position_m), bool)
        self.impacts: tuple[Impact, ...] = ()
        self._boxes = boxes
        self._tick_s = tick_s
        self._position_m, self._rpy_rad = position_m, rpy_rad
        self._velocity_mps = np.zeros_like(position_m)
        self._last_step_m = np.zeros_like(position_m)
        self._mass = boxes.size_m.prod(axis=1)
        self._mass[len(self._mass) - parked :] = _IMMOVABLE
        self._searched_m, self._near_pairs = np.full((len(position_m), 2), np.inf), np.zeros((0, 2), np.int64)
        self._initial_pairs = _pair_set(self._touching_pairs(position_m, rpy_rad))
        self._coupled, self._couplings = coupled, _pair_set(coupled)
        self._reported_pairs: set[tuple[int, int]] = set()
        self._contacts: dict[tuple[int, int], None] = {}

    @property
    def rest_m(self) -> Float64Array:
        """(G, 3) positions where sliding bodies will come to rest if nothing else happens."""
        speed_mps = np.linalg.norm(self._velocity_mps, axis=1, keepdims=True)
        return self._position_m + self.crashed[:, None] * self._velocity_mps * speed_mps / (2.0 * _SKID_MPS2)

    @property
    def yaw_rad(self) -> Float64Array:
        """(G,) headings."""
        return self._rpy_rad[:, 2]

    def resolve(self, desired_m: Float64Array, desired_rad: Float64Array) -> tuple[Float64Array, Float64Array]:
        """Turn desired (G, 3) positions and (G, 3) roll, pitch, yaw into the poses to publish."""
        self.impacts = ()
        self._contacts = {}
        crashed = self.crashed[:, None]
        step_m = np.where(crashed, self._sliding_step_m(), desired_m - self._position_m)
        turn_rad = np.where(crashed, 0.0, (desired_rad - self._rpy_rad + np.pi) % (2.0 * np.pi) - np.pi)
        self._velocity_mps = step_m / self._tick_s
        fraction = np.ones((len(step_m), 1))
        position_m = np.where(crashed, self._position_m + step_m, desired_m)
        rpy_rad = np.where(crashed, self._rpy_rad, desired_rad)
        touching = self._touching_pairs(position_m, rpy_rad)
        rounds = 0
        while len(pairs := self._new_pairs(touching)):
            self._collide(pairs, position_m)
            free = (
                self._free_fraction(pairs, fraction * step_m, fraction * turn_rad)
                if rounds < _MAX_EXACT_ROUNDS
                else 0.0
            )
            np.minimum.at(fraction, pairs, fraction[pairs] * np.reshape(free, (-1, 1, 1)))
            fraction[self._coupled] = fraction[self._coupled].min(axis=1, keepdims=True)
            position_m = np.where(fraction < 1.0, self._position_m + fraction * step_m, position_m)
            rpy_rad = np.where(fraction < 1.0, self._rpy_rad + fraction * turn_rad, rpy_rad)
            touching = self._touching_pairs(position_m, rpy_rad)
            rounds += 1
        # Not earlier: until here a body may have been put back to where it touched at first.
        self._initial_pairs &= _pair_set(touching)
        self._report_pushed(position_m)
        self._last_step_m = position_m - self._position_m
        self._position_m, self._rpy_rad = position_m, rpy_rad
        return position_m, rpy_rad

    def remove(self, bodies: Int64Array) -> None:
        """Take (K,) bodies out of everybody's way, far below the ground; they never come back."""
        self.crashed[bodies] = True
        self._position_m = self._position_m.copy()
        self._position_m[bodies, 2] -= _REMOVED_M
        self._velocity_mps[bodies] = 0.0

    def _touching_pairs(self, position_m: Float64Array, rpy_rad: Float64Array) -> Int64Array:
        """The touching pairs among those that were near each other at the latest search."""
        if np.abs(position_m[:, :2] - self._searched_m).max(initial=0.0) > _MAX_DRIFT_M:
            self._searched_m = position_m[:, :2].copy()
            self._near_pairs = self._boxes.near_pairs(position_m, 3.0 * _MAX_DRIFT_M)
        return self._boxes.touching_pairs(position_m, rpy_rad[:, 2], self._near_pairs)

    def _sliding_step_m(self) -> Float64Array:
        """(G, 3) steps of this tick with locked wheels."""
        speed_mps = np.linalg.norm(self._velocity_mps, axis=1, keepdims=True)
        slower_mps = np.maximum(speed_mps - _SKID_MPS2 * self._tick_s, 0.0)
        return self._velocity_mps * (slower_mps / np.maximum(speed_mps, 1e-9)) * self._tick_s

    def _new_pairs(self, pairs: Int64Array) -> Int64Array:
        """The (K, 2) pairs without those that have touched from the beginning or are coupled."""
        known = self._initial_pairs | self._couplings
        return pairs[[key not in known for key in map(tuple, pairs.tolist())]]

    def _collide(self, pairs: Int64Array, position_m: Float64Array) -> None:
        """Give both bodies of each of (K, 2) pairs the velocity that conserves their momentum; report impacts."""
        for a, b in pairs.tolist():
            both = [a, b]
            self._contacts[a, b] = None
            speed_mps = float(np.linalg.norm(self._velocity_mps[a] - self._velocity_mps[b]))
            if (a, b) not in self._reported_pairs or speed_mps > _MIN_IMPACT_MPS:
                self._report((a, b), position_m, speed_mps)
            self.crashed[both] = True
        for a, b in self._coupled.tolist():
            if self.crashed[a] or self.crashed[b]:
                self._contacts[a, b] = None
                self.crashed[[a, b]] = True
        for pair in [*self._contacts] * _MOMENTUM_SWEEPS:
            both, mass = list(pair), self._mass[list(pair)]
            self._velocity_mps[both] = mass @ self._velocity_mps[both] / mass.sum()

    def _report(self, pair: tuple[int, int], position_m: Float64Array, speed_mps: float) -> None:
        """Record an impact."""
        self._reported_pairs.add(pair)
        size_m = self._boxes.size_m[list(pair), 0]
        position = (position_m[pair[0]] * size_m[1] + position_m[pair[1]] * size_m[0]) / size_m.sum()
        self.impacts = (*self.impacts, Impact(pair, position, speed_mps))

    def _report_pushed(self, position_m: Float64Array) -> None:
        """Record impacts between bodies that slid together until another body hit one of them."""
        change_mps = np.linalg.norm(position_m - self._position_m - self._last_step_m, axis=1) / self._tick_s
        reported = {impact.bodies for impact in self.impacts}
        for pair in self._contacts:
            jolt_mps = float(change_mps[list(pair)].max())
            if pair not in reported | self._couplings and jolt_mps > _MIN_JOLT_MPS2 * self._tick_s:
                self._report(pair, position_m, jolt_mps)

    def _free_fraction(self, pairs: Int64Array, step_m: Float64Array, turn_rad: Float64Array) -> Float64Array:
        """(K,) fraction of their (G, 3) steps and turns that (K, 2) pairs can complete before they touch."""
        low, high = np.zeros(len(pairs)), np.ones(len(pairs))
        for _ in range(_BISECTION_STEPS):
            middle = (low + high) / 2.0
            position_m = self._position_m[pairs] + middle[:, None, None] * step_m[pairs]
            yaw_rad = self._rpy_rad[pairs, 2] + middle[:, None] * turn_rad[pairs, 2]
            touch = self._boxes.overlap(pairs, position_m, yaw_rad)
            low, high = np.where(touch, low, middle), np.where(touch, middle, high)
        return low


def _pair_set(pairs: Int64Array) -> set[tuple[int, int]]:
    return {(a, b) for a, b in pairs.tolist()}
