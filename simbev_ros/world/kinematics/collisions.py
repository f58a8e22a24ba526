"""Collisions: bodies that touch do not pass through each other, but slide on together and stay where they come to rest.

An impact is plastic: both go on with the velocity that keeps their momentum, and brake with locked wheels. A mass is
taken to be as the volume of the body's box. All is in the map frame, of the poses that are about to be published.
"""

from dataclasses import dataclass

import numpy as np

from simbev_ros.types import BoolArray, Float64Array, Int64Array
from simbev_ros.world.kinematics.contacts import Boxes

_SKID_MPS2 = 7.0
_BLOW_MPS = 1.0  # two who slide on together have no relative speed; with so much they are hit anew
_JOLT_MPS2 = 11.0  # who is pushed on by others feels a blow, too
_HALVINGS = 8  # of the tick of an impact: of 1 m of way, 4 mm
_SWEEPS = 8  # over all who touch within a tick, until those pushed one by another have one velocity
_EXACT_ROUNDS = 4  # of impacts that follow from each other within one tick; who touches later stays where it was


@dataclass(frozen=True, slots=True)
class Impact:
    """Two bodies touch for the first time, or a third one has made them hit each other anew.

    Attributes:
        bodies: Which two.
        position_m: (3,) between their middles, weighted by their sizes.
        relative_speed_mps: Before the impact.
    """

    bodies: tuple[int, int]
    position_m: Float64Array
    relative_speed_mps: float


class Collisions:
    """What becomes of G bodies that touch.

    Attributes:
        crashed: (G,) bool; who has had a collision, and no longer follows its point.
        impacts: Those of the latest tick.
    """

    def __init__(self, boxes: Boxes, position_m: Float64Array, rpy_rad: Float64Array, tick_s: float) -> None:
        """At rest at (G, 3) positions and (G, 3) roll, pitch, yaw; who touches here may do so until they are apart."""
        self.crashed: BoolArray = np.zeros(len(position_m), bool)
        self.impacts: tuple[Impact, ...] = ()
        self._boxes = boxes
        self._tick_s = tick_s
        self._position_m, self._rpy_rad = position_m, rpy_rad
        self._velocity_mps = np.zeros_like(position_m)
        self._step_m = np.zeros_like(position_m)
        self._mass = boxes.size_m.prod(axis=1)
        self._excused = _keys(boxes.touching(position_m, rpy_rad[:, 2]))
        self._met: set[tuple[int, int]] = set()
        self._contacts: dict[tuple[int, int], None] = {}

    @property
    def rest_m(self) -> Float64Array:
        """(G, 3) where those that slide will come to rest, if nothing else happens."""
        speed_mps = np.linalg.norm(self._velocity_mps, axis=1, keepdims=True)
        rest_m: Float64Array = self._position_m + self.crashed[:, None] * self._velocity_mps * speed_mps / (
            2.0 * _SKID_MPS2
        )
        return rest_m

    @property
    def yaw_rad(self) -> Float64Array:
        """(G,) headings."""
        yaw_rad: Float64Array = self._rpy_rad[:, 2]
        return yaw_rad

    def resolve(self, wanted_m: Float64Array, wanted_rad: Float64Array) -> tuple[Float64Array, Float64Array]:
        """The poses to publish where those wanted are (G, 3) positions and (G, 3) roll, pitch, yaw."""
        self.impacts = ()
        self._contacts = {}
        crashed = self.crashed[:, None]
        way_m = np.where(crashed, self._slide(), wanted_m - self._position_m)
        turn_rad = np.where(crashed, 0.0, (wanted_rad - self._rpy_rad + np.pi) % (2.0 * np.pi) - np.pi)
        self._velocity_mps = way_m / self._tick_s
        share = np.ones((len(way_m), 1))
        position_m = np.where(crashed, self._position_m + way_m, wanted_m)
        rpy_rad = np.where(crashed, self._rpy_rad, wanted_rad)
        touching = self._boxes.touching(position_m, rpy_rad[:, 2])
        rounds = 0
        while len(pairs := self._accused(touching)):
            self._collide(pairs, position_m)
            free = self._free_share(pairs, share * way_m, share * turn_rad) if rounds < _EXACT_ROUNDS else 0.0
            np.minimum.at(share, pairs, share[pairs] * np.reshape(free, (-1, 1, 1)))
            position_m = np.where(share < 1.0, self._position_m + share * way_m, position_m)
            rpy_rad = np.where(share < 1.0, self._rpy_rad + share * turn_rad, rpy_rad)
            touching = self._boxes.touching(position_m, rpy_rad[:, 2])
            rounds += 1
        # Only now: until here somebody may have been put back to where they touched at first.
        self._excused &= _keys(touching)
        self._report_pushed(position_m)
        self._step_m = position_m - self._position_m
        self._position_m, self._rpy_rad = position_m, rpy_rad
        return position_m, rpy_rad

    def _slide(self) -> Float64Array:
        """(G, 3) ways of this tick with locked wheels."""
        speed_mps = np.linalg.norm(self._velocity_mps, axis=1, keepdims=True)
        slower_mps = np.maximum(speed_mps - _SKID_MPS2 * self._tick_s, 0.0)
        way_m: Float64Array = self._velocity_mps * (slower_mps / np.maximum(speed_mps, 1e-9)) * self._tick_s
        return way_m

    def _accused(self, pairs: Int64Array) -> Int64Array:
        """Those of (K, 2) pairs that did not touch from the beginning."""
        accused: Int64Array = pairs[[key not in self._excused for key in map(tuple, pairs.tolist())]]
        return accused

    def _collide(self, pairs: Int64Array, position_m: Float64Array) -> None:
        """Give both of each of (K, 2) pairs the velocity that keeps their momentum; report blows."""
        for a, b in pairs.tolist():
            both = [a, b]
            self._contacts[a, b] = None
            speed_mps = float(np.linalg.norm(self._velocity_mps[a] - self._velocity_mps[b]))
            if (a, b) not in self._met or speed_mps > _BLOW_MPS:
                self._report((a, b), position_m, speed_mps)
            self.crashed[both] = True
        for pair in [*self._contacts] * _SWEEPS:
            both, mass = list(pair), self._mass[list(pair)]
            self._velocity_mps[both] = mass @ self._velocity_mps[both] / mass.sum()

    def _report(self, pair: tuple[int, int], position_m: Float64Array, speed_mps: float) -> None:
        """Note down a blow."""
        self._met.add(pair)
        size_m = self._boxes.size_m[list(pair), 0]
        place_m = (position_m[pair[0]] * size_m[1] + position_m[pair[1]] * size_m[0]) / size_m.sum()
        self.impacts = (*self.impacts, Impact(pair, place_m, speed_mps))

    def _report_pushed(self, position_m: Float64Array) -> None:
        """Note down blows between those who slid on together until somebody else hit one of them."""
        change_mps = np.linalg.norm(position_m - self._position_m - self._step_m, axis=1) / self._tick_s
        told = {impact.bodies for impact in self.impacts}
        for pair in self._contacts:
            felt_mps = float(change_mps[list(pair)].max())
            if pair not in told and felt_mps > _JOLT_MPS2 * self._tick_s:
                self._report(pair, position_m, felt_mps)

    def _free_share(self, pairs: Int64Array, way_m: Float64Array, turn_rad: Float64Array) -> Float64Array:
        """(K,) how much of their (G, 3) ways and turns (K, 2) pairs can do before they touch."""
        low, high = np.zeros(len(pairs)), np.ones(len(pairs))
        for _ in range(_HALVINGS):
            middle = (low + high) / 2.0
            position_m = self._position_m[pairs] + middle[:, None, None] * way_m[pairs]
            yaw_rad = self._rpy_rad[pairs, 2] + middle[:, None] * turn_rad[pairs, 2]
            touch = self._boxes.overlap(pairs, position_m, yaw_rad)
            low, high = np.where(touch, low, middle), np.where(touch, middle, high)
        return low


def _keys(pairs: Int64Array) -> set[tuple[int, int]]:
    return {(a, b) for a, b in pairs.tolist()}
