"""The messages that have arrived at an agent by a tick: which tick of which sender the newest ones are about."""

from collections.abc import Callable

import numpy as np

from simbev_ros.foundation.types import Table
from simbev_ros.foundation.units import NS_PER_S
from simbev_ros.schema.scene.agents import agent_views
from simbev_ros.schema.scene.spec import SceneSpec

_MEMORY_NS = NS_PER_S


def newest_messages(
    spec: SceneSpec, agent: str, tick: int, arrived_at: Callable[[int], Table | None]
) -> dict[str, int]:
    """Tick at which each sender sent its newest message that has arrived, by the sender's name.

    Args:
        spec: The scene, in which agents exchange messages.
        agent: The receiver.
        tick: The tick.
        arrived_at: Gives the (N,) ``V2X_DTYPE`` rows that arrived at a tick; None: the bag lacks them.
    """
    assert spec.v2x is not None
    senders = {
        view.ego_id: view.agent for view in agent_views(spec) if view.agent in spec.v2x.agents and view.agent != agent
    }
    memory_ticks = max(_MEMORY_NS // spec.tick_ns, spec.period_ticks(spec.v2x.rate_hz))
    newest = dict[str, int]()
    for earlier in range(tick, max(tick - memory_ticks, -1), -1):
        if len(newest) == len(senders) and min(newest.values()) >= earlier:
            break  # what arrived before cannot have been sent later
        rows = arrived_at(earlier)
        for sender, sent in () if rows is None else np.unique(rows[["sender", "tick"]]).tolist():
            if sender in senders:
                newest[senders[sender]] = max(sent, newest.get(senders[sender], -1))
    return {name: newest[name] for name in senders.values() if name in newest}
