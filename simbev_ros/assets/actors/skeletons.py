"""Computes the poses of the rigid parts of many actors of many models in one vectorized step."""

from collections.abc import Sequence
from itertools import pairwise

import numpy as np

from simbev_ros.assets.actors.actor_model import ActorModel, Cycle, Part
from simbev_ros.foundation.geometry.ragged import ragged_indices
from simbev_ros.foundation.types import Float64Array, Int64Array, Table


class Skeletons:
    """Kinematics of the rigid parts of all models.

    A row is one part of one actor: actors in their order, and within an actor its parts in the order of the model.
    """

    def __init__(self, models: Sequence[ActorModel]) -> None:
        """Collect the parts of models, indexed by blueprint."""
        counts = np.array([len(model.parts) for model in models], np.int64)
        self._cycles = [model.cycle for model in models]
        self._has_cycle = np.array([cycle is not None for cycle in self._cycles], bool)
        self._end = np.cumsum(counts)
        self._first = self._end - counts
        parts = [part for model in models for part in model.parts]
        numbers = np.array([_numbers(part) for part in parts]).reshape(-1, 8)
        self._pivot_m, (self._spins, self._steers, self._cranks, door, self._opening_rad) = (
            numbers[:, :3],
            numbers[:, 3:].T,
        )
        self._door = door.astype(np.uint8)
        self._to_parent = np.array([index - part.parent for model in models for index, part in enumerate(model.parts)])
        self._depth = np.array([_depth(model.parts, index) for model in models for index in range(len(model.parts))])

    def rows(self, actors: Table) -> tuple[Int64Array, Int64Array]:
        """(R,) actor and (R,) part, numbered through all models, of each row, for (N,) ``ACTOR_DTYPE`` actors."""
        blueprint = actors["blueprint"].astype(np.int64)
        first, counts = self._first[blueprint], self._end[blueprint] - self._first[blueprint]
        actor, number = ragged_indices(counts)
        return actor, first[actor] + number

    def poses(self, actors: Table) -> Float64Array:
        """(R, 4, 4) transforms that move each part's vertices from the rest pose to the actors' pose, actor frame."""
        actor, part = self.rows(actors)
        angle_y = self._spins[part] * actors["wheel"][actor] + self._cranks[part] * actors["gait"][actor].astype(
            np.float64
        )
        is_open = actors["doors"][actor] >> self._door[part] & 1
        angle_z = self._steers[part] * actors["steer"][actor] + self._opening_rad[part] * is_open
        body = np.flatnonzero(part == self._first[actors["blueprint"][actor]])
        walker, turn_rad, walker_rise_m = self._strides(actors)
        if len(walker):
            count = np.diff(np.append(body, len(actor)))[walker]
            angle_y[np.repeat(body[walker], count) + ragged_indices(count)[1]] += turn_rad
        poses = _rotations_about(self._pivot_m[part], angle_y, angle_z)
        poses[body[walker], 2, 3] += walker_rise_m
        depth = self._depth[part]
        for level in range(1, int(depth.max(initial=0)) + 1):
            rows = np.flatnonzero(depth == level)
            poses[rows] = poses[rows - self._to_parent[part[rows]]] @ poses[rows]
        return poses

    def _strides(self, actors: Table) -> tuple[Int64Array, Float64Array, Float64Array]:
        """(A,) actors with a cycle, alike ones in sequence, (R,) rotations about y of their parts, and (A,) rises."""
        walker = np.flatnonzero(self._has_cycle[actors["blueprint"]])
        walker = walker[np.argsort(actors["blueprint"][walker], kind="stable")]
        if not len(walker):
            return walker, np.empty(0), np.empty(0)
        blueprints, starts = np.unique(actors["blueprint"][walker], return_index=True)
        cycles = [cycle for blueprint in blueprints.tolist() if (cycle := self._cycles[blueprint])]
        alike = [slice(*ends) for ends in pairwise([*starts.tolist(), len(walker)])]
        speed_mps = np.hypot(actors["vx"][walker], actors["vy"][walker]).astype(np.float64)
        return walker, *_interpolate(cycles, alike, speed_mps, actors["gait"][walker].astype(np.float64))


def part_poses(model: ActorModel, actors: Table) -> Float64Array:
    """(N, P, 4, 4) transforms as in ``Skeletons.poses``, for (N,) ``ACTOR_DTYPE`` actors that share a model."""
    alike = actors.copy()
    alike["blueprint"] = 0
    return Skeletons((model,)).poses(alike).reshape(len(actors), len(model.parts), 4, 4)


def _interpolate(
    cycles: Sequence[Cycle], alike: Sequence[slice], speed_mps: Float64Array, gait_rad: Float64Array
) -> tuple[Float64Array, Float64Array]:
    """Rotations of all parts and (A,) rises of A actors, bilinear in speed and gait; ``alike`` ones share a cycle."""
    speeds, steps, parts = np.repeat(
        [(*cycle.rise_m.shape, cycle.turn_rad.shape[2]) for cycle in cycles],
        [own.stop - own.start for own in alike],
        axis=0,
    ).T
    row = np.concatenate(
        [
            np.interp(speed_mps[own], cycle.speed_mps, np.arange(len(cycle.speed_mps)))
            for cycle, own in zip(cycles, alike, strict=True)
        ]
    )
    slow = np.minimum(row.astype(np.int64), speeds - 2)
    step = gait_rad / (2.0 * np.pi) * steps
    before = np.floor(step).astype(np.int64)
    faster, later = row - slow, step - before
    shares = np.stack([(1.0 - faster) * (1.0 - later), (1.0 - faster) * later, faster * (1.0 - later), faster * later])
    samples = (slow + np.array([[0], [0], [1], [1]])) * steps + (before + np.array([[0], [1], [0], [1]])) % steps
    turns, rises = [], []
    for cycle, own in zip(cycles, alike, strict=True):
        turns.append(cycle.turn_rad.reshape(cycle.rise_m.size, -1)[samples[:, own]].reshape(4, -1))
        rises.append(cycle.rise_m.ravel()[samples[:, own]])
    turn_rad = np.repeat(shares, parts, axis=1) * np.concatenate(turns, axis=1)
    return turn_rad.sum(axis=0), (shares * np.concatenate(rises, axis=1)).sum(axis=0)


def _numbers(part: Part) -> tuple[float, ...]:
    """Kinematic parameters of a part as numbers."""
    return (*part.pivot_m, part.spins, part.steers, part.cranks, part.door, part.opening_rad)


def _depth(parts: Sequence[Part], index: int) -> int:
    """Number of ancestors of a part."""
    parent = parts[index].parent
    return 0 if parent < 0 else 1 + _depth(parts, parent)


def _rotations_about(pivots_m: Float64Array, angle_y_rad: Float64Array, angle_z_rad: Float64Array) -> Float64Array:
    """(R, 4, 4) rotations Rz Ry about (R, 3) fixed points."""
    cy, sy, cz, sz = np.cos(angle_y_rad), np.sin(angle_y_rad), np.cos(angle_z_rad), np.sin(angle_z_rad)
    turns = np.zeros((len(pivots_m), 4, 4))
    turns[:, 0, 0], turns[:, 0, 1], turns[:, 0, 2] = cz * cy, -sz, cz * sy
    turns[:, 1, 0], turns[:, 1, 1], turns[:, 1, 2] = sz * cy, cz, sz * sy
    turns[:, 2, 0], turns[:, 2, 2] = -sy, cy
    turns[:, :3, 3] = pivots_m - (turns[:, :3, :3] @ pivots_m[:, :, None])[..., 0]
    turns[:, 3, 3] = 1.0
    return turns
