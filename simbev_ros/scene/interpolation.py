"""Actor states between two ticks, and the recent motion history that rolling sensors sample from."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from simbev_ros.foundation.types import BoolArray, Float64Array, Int64Array, Table
from simbev_ros.foundation.units import NS_PER_S
from simbev_ros.schema.scene.state import WorldState

_LINEAR = ("x", "y", "z", "vx", "vy", "vz")
_ANGULAR = ("roll", "pitch", "yaw", "steer", "gait")


def interpolate_actors(before: Table, after: Table, fraction: float | Float64Array) -> Table:
    """Interpolate (N,) actor rows at a fraction of the time from one tick (0) to another (1).

    Positions move in straight lines and angles change linearly, as in tf2 between two transforms. Fields that cannot be
    interpolated (doors, lights) have their value of the later tick.

    Args:
        before: (N,) ``ACTOR_DTYPE``.
        after: (N,) the same actors later.
        fraction: A scalar or (N,) fractions.
    """
    rows = after.copy()
    for name in _LINEAR:
        rows[name] = before[name] + fraction * (after[name].astype(np.float64) - before[name])
    for name in _ANGULAR:
        turn_rad = after[name].astype(np.float64) - before[name]
        rows[name] = before[name] + fraction * ((turn_rad + np.pi) % (2.0 * np.pi) - np.pi)
    # A wheel may turn by more than half a turn in a tick, so its angle is accumulated and never wrapped.
    turn_rad = after["wheel"].astype(np.float64) - before["wheel"]
    rows["wheel"] = after["wheel"].astype(np.float64) % (2.0 * np.pi) + (fraction - 1.0) * turn_rad
    return rows


@dataclass(frozen=True, slots=True)
class ActorHistory:
    """Recent motion of actors: their states now and at earlier ticks.

    Attributes:
        tables: (M, A) ``ACTOR_DTYPE``, newest first; each column is one actor.
        lags_s: (M,) age of each table, ascending from 0.
    """

    tables: Table
    lags_s: Float64Array

    @classmethod
    def of(cls, state: WorldState, earlier: Sequence[WorldState] = ()) -> "ActorHistory":
        """Build the history of a state's actors; before an actor's first known state it stands still.

        Args:
            state: The world now.
            earlier: Earlier states, in any order.
        """
        tables, lags_s = [state.actors], [0.0]
        for each in sorted(earlier, key=lambda each: -each.stamp_ns):
            tables.append(earlier_rows(state.actors, each.actors, otherwise=tables[-1]))
            lags_s.append((state.stamp_ns - each.stamp_ns) / NS_PER_S)
        return cls(np.stack(tables), np.array(lags_s))

    @classmethod
    def of_ego(cls, state: WorldState, earlier: Sequence[WorldState] = ()) -> "ActorHistory":
        """Build the history of a state's ego alone; a roadside unit, which is not an actor, has never moved.

        Args:
            state: The world now.
            earlier: Earlier states, in any order, whichever egos they have.
        """
        if state.station is not None:
            return cls(state.station[None, None], np.zeros(1))
        return cls.of(state, earlier).only(state.actors["id"] == state.ego_id)

    @property
    def now(self) -> Table:
        """(A,) newest table."""
        return self.tables[0]

    def only(self, chosen: BoolArray) -> "ActorHistory":
        """The history of the actors selected by an (A,) mask."""
        return ActorHistory(self.tables[:, chosen], self.lags_s)

    def at(self, actor: Int64Array, lag_s: Float64Array) -> Table:
        """(N,) interpolated rows of (N,) actors at (N,) ages; beyond the known history they stand still."""
        if len(self.lags_s) == 1:
            return self.now[actor]
        older = np.clip(np.searchsorted(self.lags_s, lag_s), 1, len(self.lags_s) - 1)
        fraction = (self.lags_s[older] - lag_s) / (self.lags_s[older] - self.lags_s[older - 1])
        return interpolate_actors(self.tables[older, actor], self.tables[older - 1, actor], np.clip(fraction, 0.0, 1.0))


def earlier_rows(actors: Table, earlier: Table, otherwise: Table | None = None) -> Table:
    """(N,) earlier rows of the same (N,) actors; new actors get their row of ``otherwise`` (default: as now)."""
    rows = (actors if otherwise is None else otherwise).copy()
    known = np.isin(actors["id"], earlier["id"])
    rows[known] = earlier[np.searchsorted(earlier["id"], actors["id"][known])]
    return rows
