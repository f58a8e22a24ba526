"""The messages that have arrived at an agent by a tick: which tick of which sender the newest ones are about."""

from collections.abc import Callable
from typing import TYPE_CHECKING, Final

import numpy as np

from simbev_ros.foundation.types import Table
from simbev_ros.foundation.units import NS_PER_S
from simbev_ros.schema.scene.agents import agent_views

if TYPE_CHECKING:
    from simbev_ros.dataset.scene import Scene

MESSAGES: Final = "v2x"
"""Key of what arrives at an agent at a tick."""

_MEMORY_NS = NS_PER_S


def newest_messages(scene: "Scene", tick: int, arrived_at: Callable[[int], Table | None]) -> dict[str, int]:
    """Tick at which each sender sent its newest message that has arrived, by the sender's name.

    Args:
        scene: The scene as the receiver sees it.
        tick: The tick.
        arrived_at: Gives the (N,) ``V2X_DTYPE`` rows that arrived at a tick; None: the bag lacks them.

    Raises:
        KeyError: The scene has no messages for this agent.
    """
    if MESSAGES not in scene.sources or scene.spec.v2x is None:
        raise KeyError(f"scene {scene.name} has no messages to {scene.agent}")
    senders = {
        view.ego_id: view.agent
        for view in agent_views(scene.spec)
        if view.agent in scene.spec.v2x.agents and view.agent != scene.agent
    }
    memory_ticks = max(_MEMORY_NS // scene.tick_ns, scene.spec.period_ticks(scene.spec.v2x.rate_hz))
    newest = dict[str, int]()
    for earlier in range(tick, max(tick - memory_ticks, -1), -1):
        if len(newest) == len(senders) and min(newest.values()) >= earlier:
            break  # what arrived before cannot have been sent later
        rows = arrived_at(earlier)
        for sender, sent in () if rows is None else np.unique(rows[["sender", "tick"]]).tolist():
            if sender in senders:
                newest[senders[sender]] = max(sent, newest.get(senders[sender], -1))
    return {name: newest[name] for name in senders.values() if name in newest}
