"""Views of a scene: its specification and its states as each of its agents sees them.

Code that serves one agent takes an ``AgentView``, code that serves a scene a ``SceneSpec``.
"""

import math
from dataclasses import dataclass, replace

import numpy as np

from simbev_ros.config.annotation import Annotation
from simbev_ros.config.frames import Frames
from simbev_ros.config.rig import Rig
from simbev_ros.foundation.random import stream
from simbev_ros.foundation.types import Table
from simbev_ros.schema.scene.agent_spec import AgentSpec, StationSpec
from simbev_ros.schema.scene.spec import SceneSpec, VehicleSpec
from simbev_ros.schema.scene.state import ACTOR_DTYPE, EGO_ID, WorldState

STATION_IDS = 0x30000
"""Offset of the ids of roadside units, above those of actors, traffic lights and signs (``schema.boxes``)."""


@dataclass(frozen=True)
class AgentView:
    """A scene as one of its agents sees it.

    Attributes:
        scene: Specification of the scene.
        index: Index of the agent in ``scene.agents``; 0: the ego.
    """

    scene: SceneSpec
    index: int

    @property
    def spec(self) -> AgentSpec:
        """Specification of the agent."""
        return self.scene.agents[self.index]

    @property
    def agent(self) -> str:
        """Name of the agent."""
        return self.spec.rig.agent

    @property
    def is_ego(self) -> bool:
        """Whether the agent is the scene's first one."""
        return self.index == 0

    @property
    def rig(self) -> Rig:
        """The agent's sensors."""
        return self.spec.rig

    @property
    def frames(self) -> Frames:
        """The agent's coordinate frames."""
        return self.spec.frames

    @property
    def base_link_x_m(self) -> float:
        """X of the origin of base_link in the agent's ego frame."""
        return self.spec.base_link_x_m

    @property
    def annotation(self) -> Annotation:
        """Labels that the agent gets."""
        return self.spec.annotation

    def label_period_ticks(self, rate_hz: float | None = None) -> int:
        """Number of ticks between two labels of something with this rate, such as the images of a camera.

        A label is made at ticks with labels at which a sample is due as well. None: every tick.
        """
        return math.lcm(*map(self.scene.period_ticks, (self.annotation.rate_hz, rate_hz)))

    @property
    def station(self) -> StationSpec | None:
        """Pose of the agent if it is a roadside unit."""
        return self.spec.station

    @property
    def vehicle(self) -> VehicleSpec | None:
        """The agent's vehicle; None: the agent is a roadside unit."""
        return None if self.spec.vehicle is None else self.scene.vehicles[self.spec.vehicle]

    @property
    def ego_id(self) -> int:
        """Id of the agent's vehicle among the actors; a roadside unit has an id that no actor has."""
        return STATION_IDS + self.index - 1 if self.spec.vehicle is None else EGO_ID + self.spec.vehicle

    @property
    def reports_status(self) -> bool:
        """Whether the agent's vehicle publishes its status: it drives a route, or its driver sends stamped commands."""
        has_route = self.is_ego and self.scene.drive is not None
        return has_route or self.spec.driver not in ("traffic", "twist")

    @property
    def noise_seed(self) -> int:
        """Seed of the noise of the agent's sensors; agents with equal rigs have different noise.

        The ego's is the scene's seed. Any other agent's follows from its name, whichever other agents there are.
        """
        seed = self.scene.seed
        return seed if self.is_ego else int(stream(seed, f"agents.{self.agent}.noise").integers(1 << 63))

    def ego_state(self, state: WorldState) -> WorldState:
        """The state of the scene at one tick, in which the agent is the ego."""
        return replace(state, ego_id=self.ego_id, station=None if self.station is None else self._station_row())

    def ego_row(self, actors: Table) -> Table:
        """The agent's row, shape (): that of its vehicle in (N,) ``ACTOR_DTYPE``, or a roadside unit's own.

        Raises:
            ValueError: The agent's vehicle is not among the actors.
        """
        if self.station is not None:
            return self._station_row()
        rows = actors[actors["id"] == self.ego_id]
        if len(rows) != 1:
            raise ValueError(f"actor {self.ego_id}, which carries {self.agent}, is missing")
        return rows[0]

    def _station_row(self) -> Table:
        """Row of a roadside unit: it stands still, is upright and has no size."""
        assert self.station is not None
        row = np.zeros((), ACTOR_DTYPE)
        row["id"], row["yaw"] = self.ego_id, self.station.yaw_rad
        row["x"], row["y"], row["z"] = self.station.x_m, self.station.y_m, self.station.z_m
        return row


def agent_views(scene: SceneSpec) -> tuple[AgentView, ...]:
    """Views of all agents of a scene, the ego's first."""
    return tuple(AgentView(scene, index) for index in range(len(scene.agents)))


def agent_view(scene: SceneSpec, agent: str | None = None) -> AgentView:
    """View of one agent by name, or of the ego.

    Raises:
        KeyError: The scene has no agent of this name.
    """
    views = {view.agent: view for view in agent_views(scene)}
    if agent is not None and agent not in views:
        raise KeyError(f"{scene.name}: no agent {agent!r}; there are: {', '.join(views)}")
    return AgentView(scene, 0) if agent is None else views[agent]
