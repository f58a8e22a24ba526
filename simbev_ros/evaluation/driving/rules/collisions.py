"""Collisions of the ego with actors and with the static world, and whose fault they are.

The world stops bodies just before their boxes overlap (``simulation.world.kinematics.collisions``), so boxes nearer to
each other than the remaining gap touch. An open door, which stops nobody, is touched where its mesh is. Fault follows
nuPlan: the ego is not at fault when it stands or is hit from behind; it is when it hits what stands or what is in front
of it, and beside it unless it keeps to one lane.
"""

from collections.abc import Iterator, Mapping
from typing import Protocol

import numpy as np

from simbev_ros.assets.actors.catalog import load_models
from simbev_ros.assets.actors.skeletons import part_poses
from simbev_ros.evaluation.driving.infractions import Infraction, InfractionKind
from simbev_ros.evaluation.driving.moment import Moment, is_beside_in_height, positions_m, sizes_m
from simbev_ros.evaluation.driving.rules.lanes import RoadPlaces
from simbev_ros.evaluation.driving.static_world import SolidMesh
from simbev_ros.foundation.geometry.footprints import footprints_overlap
from simbev_ros.foundation.semantics import Tag
from simbev_ros.foundation.types import BoolArray, Float64Array, Table
from simbev_ros.schema.scene.state import map_from_actors

CONTACT_M = 0.02
"""Gap below which boxes touch: the world's bisection leaves 1/256 of the movement within a tick."""

_AGAIN_M, _AGAIN_S = 5.0, 5.0  # a party that is touched again counts once more from here on (CARLA's leaderboard)
_STOPPED_MPS = 0.05  # nuPlan
_DOOR_M = 1.5  # maximum length of a door
_AHEAD_COS, _BEHIND_COS = np.cos(np.radians(30.0)), np.cos(np.radians(150.0))  # nuPlan
_KINDS: Mapping[Tag, InfractionKind] = {
    Tag.PEDESTRIAN: InfractionKind.PEDESTRIAN_COLLISION,
    **dict.fromkeys(
        (Tag.RIDER, Tag.CAR, Tag.TRUCK, Tag.BUS, Tag.TRAIN, Tag.MOTORCYCLE, Tag.BICYCLE),
        InfractionKind.VEHICLE_COLLISION,
    ),
}
_VULNERABLE = (Tag.PEDESTRIAN, Tag.BICYCLE)
STATIC_ID = 0
"""Id under which contacts with the static world are counted; no actor has it."""


class Obstacles(Protocol):
    """The static world, such as ``rules.solid_mesh.SolidMesh``."""

    def touched_by(self, position_m: Float64Array, yaw_rad: float, size_m: Float64Array) -> bool:
        """Whether a box touches it: (3,) center of its bottom, heading, and (3,) length, width, height."""


class CollisionRule:
    """Yields a collision when a contact begins; contacts that exist at the first tick count after a break."""

    def __init__(self, places: RoadPlaces, obstacles: Obstacles | None) -> None:
        self._places, self._obstacles = places, obstacles
        self._touching: set[int] | None = None
        self._last: dict[int, Moment] = {}

    def judge(self, moment: Moment) -> Iterator[Infraction]:
        """Yield the collisions that begin."""
        rows = moment.others[touched(moment, CONTACT_M) | open_doors_touched(moment)]
        by_id: dict[int, Table | None] = {int(row["id"]): row for row in rows}
        if self._touches_static(moment):
            by_id[STATIC_ID] = None
        begun = [] if self._touching is None else [each for each in by_id if each not in self._touching]
        self._touching = {*by_id}
        for actor_id in begun:
            if not self._is_same(moment, actor_id):
                yield self._collision(moment, actor_id, by_id[actor_id])
            self._last[actor_id] = moment

    def _touches_static(self, moment: Moment) -> bool:
        if self._obstacles is None:
            return False
        return self._obstacles.touched_by(moment.position_m, moment.yaw_rad, sizes_m(moment.ego))

    def _is_same(self, moment: Moment, actor_id: int) -> bool:
        """Whether the latest contact with a party was so recent and near that this one is a part of it."""
        last = self._last.get(actor_id)
        if last is None:
            return False
        moved_m = float(np.hypot(*(moment.position_m - last.position_m)[:2]))
        return moved_m < _AGAIN_M and (moment.state.tick - last.state.tick) * moment.tick_s < _AGAIN_S

    def _collision(self, moment: Moment, actor_id: int, row: Table | None) -> Infraction:
        ego_mps, other_mps = moment.velocity_before(moment.state.ego_id), moment.velocity_before(actor_id)
        tag = Tag.STATIC if row is None else Tag(int(row["tag"]))
        return moment.infraction(
            _KINDS.get(tag, InfractionKind.STATIC_COLLISION),
            float(np.hypot(*(ego_mps - other_mps))),
            "" if row is None else str(actor_id),
            at_fault=self._is_at_fault(moment, row, float(np.hypot(*ego_mps)), float(np.hypot(*other_mps))),
            vulnerable=tag in _VULNERABLE,
            speed_mps=float(np.hypot(*ego_mps)),
        )

    def _is_at_fault(self, moment: Moment, row: Table | None, ego_mps: float, other_mps: float) -> bool:
        if ego_mps <= _STOPPED_MPS:
            return False
        if row is None or other_mps <= _STOPPED_MPS:
            return True
        if bearings(moment, row[None])[0] < _BEHIND_COS:
            return False
        return _is_hit_by_front(moment, row[None]) or not self._places.keeps_to_one_lane(moment)


def touched(moment: Moment, gap_m: float) -> BoolArray:
    """(N,) whether the boxes of ``moment.others`` and of the ego overlap when both are grown by half a gap."""
    others = moment.others
    size_m, own_m = sizes_m(others)[:, :2] + gap_m, sizes_m(moment.ego)[:2] + gap_m
    near = np.hypot(*moment.seen_from_ego(others).T) < (np.hypot(*size_m.T) + np.hypot(*own_m)) / 2.0
    found = near & is_beside_in_height(moment, others)
    found[found] = _overlap(moment, others[found], size_m[found], own_m)
    return found


def bearings(moment: Moment, rows: Table) -> Float64Array:
    """(N,) cosines of the angles between the ego's heading and the directions from its rear axle to actors."""
    seen_m = moment.seen_from_ego(rows) + np.array([0.3 * float(moment.ego["length"]), 0.0])
    cosines: Float64Array = seen_m[:, 0] / np.maximum(np.hypot(*seen_m.T), 1e-9)
    return cosines


def is_relevant(moment: Moment, rows: Table, *, keeps_to_one_lane: bool) -> BoolArray:
    """(N,) whether the ego must mind actors: those ahead; those beside it as well if it does not keep to one lane."""
    relevant: BoolArray = bearings(moment, rows) > (_AHEAD_COS if keeps_to_one_lane else _BEHIND_COS)
    return relevant


def _is_hit_by_front(moment: Moment, row: Table) -> bool:
    """Whether an actor touches the ego's front: a strip as wide as the ego about its foremost 10 cm."""
    width_m = float(moment.ego["width"])
    strip = np.array([[0.1 + CONTACT_M, width_m]])
    position_m = np.stack([moment.front_m[None], positions_m(row)[:, :2]], axis=1)
    yaw_rad = np.array([[moment.yaw_rad, float(row["yaw"][0])]])
    size_m = np.stack([strip, sizes_m(row)[:, :2] + CONTACT_M], axis=1)
    return bool(footprints_overlap(position_m, yaw_rad, size_m)[0])


def _overlap(moment: Moment, rows: Table, size_m: Float64Array, own_m: Float64Array) -> BoolArray:
    own_xy, own_yaw = np.broadcast_to(moment.position_m[:2], (len(rows), 2)), np.full(len(rows), moment.yaw_rad)
    return footprints_overlap(
        np.stack([own_xy, positions_m(rows)[:, :2]], axis=1),
        np.stack([own_yaw, rows["yaw"].astype(np.float64)], axis=1),
        np.stack([np.broadcast_to(own_m, size_m.shape), size_m], axis=1),
    )


def open_doors_touched(moment: Moment) -> BoolArray:
    """(N,) whether the box of the ego touches the mesh of an open door of each of ``moment.others``."""
    others, own_m = moment.others, sizes_m(moment.ego)
    found: BoolArray = others["doors"] > 0
    if found.any():
        reach_m = (np.hypot(*sizes_m(others)[:, :2].T) + np.hypot(*own_m[:2])) / 2.0 + _DOOR_M
        found &= np.hypot(*moment.seen_from_ego(others).T) < reach_m
    for row in np.flatnonzero(found):
        doors = SolidMesh(open_doors_m(others[[row]]))
        found[row] = doors.touched_by(moment.position_m, moment.yaw_rad, own_m)
    return found


def open_doors_m(vehicle: Table) -> Float64Array:
    """(T, 3, 3) triangles of the open doors of a (1,) vehicle, map frame."""
    model, bits = load_models()[int(vehicle["blueprint"][0])], int(vehicle["doors"][0])
    is_open = np.array([part.opening_rad != 0.0 and bool(bits >> part.door & 1) for part in model.parts])
    triangles = model.mesh.triangles[is_open[model.mesh.part[model.mesh.triangles[:, 0]]]]
    map_from_part = (map_from_actors(vehicle)[:, None] @ part_poses(model, vehicle))[0][model.mesh.part[triangles]]
    turned_m = np.einsum("tcij,tcj->tci", map_from_part[..., :3, :3], model.mesh.vertices[triangles])
    return turned_m + map_from_part[..., :3, 3]
