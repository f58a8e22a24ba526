"""Views of a scene: its specification and its states as each of its agents sees them.

Code that serves one agent takes a ``SceneSpec`` and reads ``rig``, ``frames``, ``annotation``, ``ego`` and
``noise_seed``. Given an agent's view, which is a ``SceneSpec`` too, it serves that agent.
"""

from dataclasses import replace
from typing import Any

import numpy as np
from pydantic import model_serializer

from simbev_ros.foundation.random import stream
from simbev_ros.foundation.types import Table
from simbev_ros.schema.scene.agent_spec import AgentSpec, StationSpec
from simbev_ros.schema.scene.spec import SceneSpec
from simbev_ros.schema.scene.state import ACTOR_DTYPE, EGO_ID, WorldState

STATION_IDS = 0x30000
"""Offset of the ids of roadside units, above those of actors, traffic lights and signs (``schema.boxes``)."""


class AgentScene(SceneSpec):
    """View of one of the agents beside the first one. It exists in memory only and cannot be serialized.

    Attributes:
        scene: The specification, ``whole``.
        agent_index: Index of the agent in ``agents``.
    """

    scene: SceneSpec
    agent_index: int

    @property
    def _agent(self) -> AgentSpec:
        return self.agents[self.agent_index]

    @property
    def whole(self) -> SceneSpec:
        """The specification of which this is a view."""
        return self.scene

    @property
    def ego_index(self) -> int | None:
        """As in ``SceneSpec``."""
        return self._agent.vehicle

    @property
    def ego_id(self) -> int:
        """As in ``SceneSpec``."""
        return STATION_IDS + self.agent_index if self.ego_index is None else EGO_ID + self.ego_index

    @property
    def station(self) -> StationSpec | None:
        """As in ``SceneSpec``."""
        return self._agent.station

    @property
    def noise_seed(self) -> int:
        """As in ``SceneSpec``. It follows from the agent's name, whichever other agents there are."""
        return int(stream(self.seed, f"agents.{self.rig.agent}.noise").integers(1 << 63))

    @model_serializer
    def _refuse(self) -> Any:
        raise TypeError(f"{self.rig.agent}'s view of {self.name} is no specification; serialize its whole")


def agent_views(spec: SceneSpec) -> tuple[SceneSpec, ...]:
    """Views of all agents of a scene, given any of them; the first agent's is the specification itself."""
    whole = spec.whole
    return (whole, *(_view(whole, index, agent) for index, agent in enumerate(whole.agents)))


def agent_view(spec: SceneSpec, name: str) -> SceneSpec:
    """View of one agent.

    Raises:
        KeyError: The scene has no agent of this name.
    """
    views = {view.rig.agent: view for view in agent_views(spec)}
    if name not in views:
        raise KeyError(f"{spec.name}: no agent {name!r}; there are: {', '.join(views)}")
    return views[name]


def _view(whole: SceneSpec, index: int, agent: AgentSpec) -> AgentScene:
    own = {
        "rig": agent.rig,
        "frames": agent.frames,
        "base_link_x_m": agent.base_link_x_m,
        "annotation": agent.annotation,
        "ego_driver": agent.driver,
    }
    return AgentScene.model_construct(**dict(whole) | own, scene=whole, agent_index=index)


def seen_by(view: SceneSpec, state: WorldState) -> WorldState:
    """The state of an agent's scene at one tick, in which the agent is the ego."""
    station = None if view.station is None else _station_row(view.station, view.ego_id)
    return replace(state, ego_id=view.ego_id, station=station)


def ego_row(view: SceneSpec, actors: Table) -> Table:
    """The row, shape (), of an agent: that of its vehicle in (N,) ``ACTOR_DTYPE``, or a roadside unit's own.

    Raises:
        ValueError: The agent's vehicle is not among the actors.
    """
    if view.station is not None:
        return _station_row(view.station, view.ego_id)
    rows = actors[actors["id"] == view.ego_id]
    if len(rows) != 1:
        raise ValueError(f"actor {view.ego_id}, which carries {view.rig.agent}, is missing")
    return rows[0]


def _station_row(station: StationSpec, station_id: int) -> Table:
    """Row of a roadside unit: it stands still, is upright and has no size."""
    row = np.zeros((), ACTOR_DTYPE)
    row["id"], row["yaw"] = station_id, station.yaw_rad
    row["x"], row["y"], row["z"] = station.x_m, station.y_m, station.z_m
    return row
