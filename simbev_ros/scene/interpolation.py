"""Where actors are between two ticks."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from simbev_ros.scene.state import WorldState
from simbev_ros.types import BoolArray, Float64Array, Int64Array, Table

_LINEAR = ("x", "y", "z", "vx", "vy", "vz")
_ANGLES = ("roll", "pitch", "yaw", "steer", "gait")
_NS_PER_S = 1e9


def actors_between(before: Table, after: Table, share: float | Float64Array) -> Table:
    """(N,) rows of actors at a share of the way from one tick (0) to another (1).

    Places move in straight lines and angles turn evenly, which is what tf2 does between two transforms. What cannot be
    between (doors, lights) is as at the later tick.

    Args:
        before: (N,) ``ACTOR_DTYPE``.
        after: (N,) the same actors later.
        share: A number, or (N,) of them.
    """
    rows = after.copy()
    for name in _LINEAR:
        rows[name] = before[name] + share * (after[name].astype(np.float64) - before[name])
    for name in _ANGLES:
        turn_rad = after[name].astype(np.float64) - before[name]
        rows[name] = before[name] + share * ((turn_rad + np.pi) % (2.0 * np.pi) - np.pi)
    # Wheels may turn by more than half a turn in a tick, so theirs is an angle that is never reduced.
    turn_rad = after["wheel"].astype(np.float64) - before["wheel"]
    rows["wheel"] = after["wheel"].astype(np.float64) % (2.0 * np.pi) + (share - 1.0) * turn_rad
    return rows


@dataclass(frozen=True, slots=True)
class Course:
    """Where actors have been lately.

    Attributes:
        tables: (M, A) ``ACTOR_DTYPE``, the newest first; a column is an actor.
        lags_s: (M,) age of each, ascending from 0.
    """

    tables: Table
    lags_s: Float64Array

    @classmethod
    def of(cls, state: WorldState, earlier: Sequence[WorldState] = ()) -> "Course":
        """Of the actors of a state; those that are missing in an earlier one stood still since then.

        Args:
            state: The world now.
            earlier: The world before, in any order.
        """
        tables, lags_s = [state.actors], [0.0]
        for each in sorted(earlier, key=lambda each: -each.stamp_ns):
            tables.append(known_before(state.actors, each.actors, otherwise=tables[-1]))
            lags_s.append((state.stamp_ns - each.stamp_ns) / _NS_PER_S)
        return cls(np.stack(tables), np.array(lags_s))

    @property
    def now(self) -> Table:
        """(A,) the newest table."""
        newest: Table = self.tables[0]
        return newest

    def only(self, chosen: BoolArray) -> "Course":
        """The course of (A,) chosen actors."""
        return Course(self.tables[:, chosen], self.lags_s)

    def at(self, actor: Int64Array, lag_s: Float64Array) -> Table:
        """(N,) rows of (N,) actors so long ago; farther back than is known they stand still."""
        if len(self.lags_s) == 1:
            return self.now[actor]
        older = np.clip(np.searchsorted(self.lags_s, lag_s), 1, len(self.lags_s) - 1)
        share = (self.lags_s[older] - lag_s) / (self.lags_s[older] - self.lags_s[older - 1])
        return actors_between(self.tables[older, actor], self.tables[older - 1, actor], np.clip(share, 0.0, 1.0))


def known_before(actors: Table, earlier: Table, otherwise: Table | None = None) -> Table:
    """(N,) earlier rows of the same (N,) actors, as ``otherwise`` (default: as now) where there are none."""
    rows = (actors if otherwise is None else otherwise).copy()
    known = np.isin(actors["id"], earlier["id"])
    rows[known] = earlier[np.searchsorted(earlier["id"], actors["id"][known])]
    return rows
