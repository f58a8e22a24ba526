"""The scene that the world node plays, with all that belongs to it, and the status of its run."""

import json
from collections.abc import Mapping
from dataclasses import dataclass, field

from simbev_ros.maps.network import RoadNetwork
from simbev_ros.ros.msgs.world import QuaternionSigns
from simbev_ros.ros.nodes.command_queue import CommandQueue
from simbev_ros.ros.nodes.lockstep import LockstepWindow
from simbev_ros.ros.nodes.world_displays import WorldDisplays
from simbev_ros.scene.ending import SceneEnd, SceneEndDetector
from simbev_ros.scene.request import SceneRequest
from simbev_ros.schema.scene.agents import AgentView
from simbev_ros.schema.scene.drive_tables import ProgressTables
from simbev_ros.schema.scene.spec import SceneSpec
from simbev_ros.schema.scene.state import WorldState
from simbev_ros.simulation.world.source import StateSource

_NONE_FINISHED = -(2**31)


@dataclass
class LoadedScene:
    """A scene that is loaded, plays or has ended.

    Attributes:
        request: The request for the scene.
        views: The agents' views of it.
        source: Simulation or replay that computes its states.
        ending: Decides when the scene ends.
        displays: Publishes displays that have subscribers.
        progress: Progress of the first agent along its route; None: it has none.
        queues: Commands to the vehicles of agents, by the agents' names.
        indicators: Commands to their indicators, likewise.
        network: The roads of its map.
        state: Its latest state; None before the first one.
        signs: Signs of the agents' rotations.
        end: How the scene has ended; None: it has not.
    """

    request: SceneRequest
    views: tuple[AgentView, ...]
    source: StateSource
    ending: SceneEndDetector
    displays: WorldDisplays
    progress: ProgressTables | None
    queues: dict[str, CommandQueue]
    indicators: dict[str, CommandQueue]
    network: RoadNetwork
    state: WorldState | None = None
    signs: QuaternionSigns = field(default_factory=QuaternionSigns)
    end: SceneEnd | None = None

    @property
    def spec(self) -> SceneSpec:
        """Specification of the scene."""
        return self.request.spec

    @property
    def vehicles(self) -> Mapping[str, int | None]:
        """Index in ``spec.vehicles`` of each agent's vehicle; None for roadside units."""
        return {view.agent: view.spec.vehicle for view in self.views}


def run_status(scene: LoadedScene | None, next_tick: int, paused: bool, lockstep: LockstepWindow) -> str:
    """JSON: name of the scene that runs (empty: none), next tick, tick that all have finished, first tick, paused."""
    if scene is None or scene.end is not None:
        return json.dumps({"running": ""})
    finished = lockstep.finished_by_all() if lockstep.participants else next_tick - 1
    return json.dumps(
        {
            "running": scene.spec.name,
            "next_tick": next_tick,
            "finished_tick": _NONE_FINISHED if finished is None else min(finished, next_tick - 1),
            "first_tick": -scene.spec.lead_in_ticks,
            "paused": paused,
        }
    )
