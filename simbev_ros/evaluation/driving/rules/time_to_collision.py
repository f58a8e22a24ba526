"""Time to collision: how long until the ego and another actor meet if both keep their velocities (nuPlan)."""

import math
from collections.abc import Iterator

import numpy as np

from simbev_ros.evaluation.driving.infractions import Infraction, InfractionKind
from simbev_ros.evaluation.driving.moment import Moment, is_beside_in_height, positions_m, sizes_m
from simbev_ros.evaluation.driving.rules.collisions import is_relevant, touched
from simbev_ros.evaluation.driving.rules.lanes import RoadPlaces
from simbev_ros.foundation.geometry.footprints import footprints_overlap
from simbev_ros.foundation.types import Float64Array, Table

STEP_S, HORIZON_S = 0.1, 3.0
MIN_TIME_S = 0.95
"""Time to collision below which it is an infraction (nuPlan's ``least_min_ttc``)."""

_STOPPED_MPS = 0.005
_TIMES_S = np.arange(round(HORIZON_S / STEP_S) + 1) * STEP_S


class TimeToCollisionRule:
    """Yields when the time to collision falls below nuPlan's limit.

    Attributes:
        min_s: Minimum over the drive; infinite if there has been none within the horizon.
    """

    def __init__(self, places: RoadPlaces) -> None:
        self._places, self._is_short, self._hit = places, False, set[int]()
        self.min_s = math.inf

    def judge(self, moment: Moment) -> Iterator[Infraction]:
        """Yield the moment at which the time falls below the limit; actors that were hit do not count any more."""
        self._hit.update(moment.others["id"][touched(moment, 0.02)].tolist())
        others = moment.others[~np.isin(moment.others["id"], list(self._hit))]
        reach_m = (moment.speed_mps + np.hypot(others["vx"], others["vy"])) * HORIZON_S + 12.0
        near = is_beside_in_height(moment, others) & (np.hypot(*moment.seen_from_ego(others).T) < reach_m)
        rows, times_s = others[near], np.empty(0)
        if len(rows) and moment.speed_mps > _STOPPED_MPS:
            rows = rows[is_relevant(moment, rows, keeps_to_one_lane=self._places.keeps_to_one_lane(moment))]
            times_s = times_to_collision_s(moment, rows)
        shortest_s = float(times_s.min(initial=math.inf))
        self.min_s = min(self.min_s, shortest_s)
        was_short, self._is_short = self._is_short, shortest_s < MIN_TIME_S
        if self._is_short and not was_short:
            yield moment.infraction(
                InfractionKind.TIME_TO_COLLISION, shortest_s, str(int(rows["id"][np.argmin(times_s)]))
            )


def times_to_collision_s(moment: Moment, rows: Table) -> Float64Array:
    """(N,) times after which the boxes of actors and of the ego overlap; infinite beyond the horizon.

    Velocities and headings are constant, and the time is a multiple of 0.1 s, as in nuPlan.
    """
    count, steps = len(rows), len(_TIMES_S)
    now_m = np.stack([np.broadcast_to(moment.position_m[:2], (count, 2)), positions_m(rows)[:, :2]], axis=1)
    own_mps = np.broadcast_to(np.array([float(moment.ego["vx"]), float(moment.ego["vy"])]), (count, 2))
    velocity = np.stack([own_mps, np.stack([rows["vx"], rows["vy"]], axis=1)], axis=1)
    position_m = now_m[:, None] + velocity[:, None] * _TIMES_S[None, :, None, None]
    yaw_rad = np.stack([np.full(count, moment.yaw_rad), rows["yaw"]], axis=1)
    size_m = np.stack([np.broadcast_to(sizes_m(moment.ego), (count, 3)), sizes_m(rows)], axis=1)
    overlap = footprints_overlap(
        position_m.reshape(-1, 2, 2), np.repeat(yaw_rad, steps, axis=0), np.repeat(size_m, steps, axis=0)
    ).reshape(count, steps)
    return np.where(overlap.any(axis=1), _TIMES_S[np.argmax(overlap, axis=1)] if count else np.inf, np.inf)
