"""Selects what of a scene goes into OPV2V's layout: its agents, their lidar and cameras, and the frames.

A scene enters; its ``ConnectedAgent``s and their common frames leave.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import permutations

import numpy as np

from simbev_exporters.recorded_sensors import recorded_cameras, recorded_lidar
from simbev_ros.dataset import Scene
from simbev_ros.dataset.frame_period import frame_period
from simbev_ros.foundation.errors import BagError
from simbev_ros.foundation.types import Float64Array, Int64Array

CAMERA_YAWS_DEG = (0.0, -100.0, 100.0, 180.0)
"""Yaw, positive to the left, of OPV2V's cameras 0 to 3: front, right rear, left rear, back."""

_MAX_CAMERA_OFFSET_DEG = 60.0


@dataclass(frozen=True, eq=False, slots=True)
class ConnectedAgent:
    """An agent of a scene in the layout.

    Attributes:
        scene: The scene as the agent sees it.
        folder: Name of the agent's folder: the id of its vehicle; -1, -2 and so on for roadside units.
        lidar: Name of the lidar.
        cloud: Key of the lidar's cloud.
        cameras: Names of the cameras by their number in the layout.
    """

    scene: Scene
    folder: str
    lidar: str
    cloud: str
    cameras: dict[int, str]

    @property
    def keys(self) -> tuple[str, ...]:
        """Keys that a frame needs."""
        return ("odom", "boxes", self.cloud, *(f"{name}/rgb" for name in self.cameras.values()))


def connected_agents(scene: Scene, cameras: Sequence[str] | None) -> list[ConnectedAgent]:
    """The agents of a scene that have a lidar, without which the layout has no agent; the first agent's first.

    Args:
        scene: The scene.
        cameras: Names of the cameras 0 to 3; None: of each agent those that look most in the directions of OPV2V's.

    Raises:
        BagError: No agent has a lidar.
    """
    found, stations = [], 0
    for name in scene.agents:
        seen = scene.of_agent(name)
        stations += seen.view.station is not None
        folder = seen.view.ego_id if seen.view.station is None else -stations
        lidar = recorded_lidar(seen)
        if lidar is not None:
            chosen = _cameras(seen) if cameras is None else _named(seen, cameras)
            found.append(ConnectedAgent(seen, str(folder), *lidar, chosen))
    if not found:
        raise BagError(f"{scene.path}: no agent has the cloud of a lidar, which OPV2V's layout needs")
    return found


def exported_ticks(agents: Sequence[ConnectedAgent], rate_hz: float) -> Int64Array:
    """(T,) ticks at which all agents have all data; readers expect the same frames of all agents.

    Raises:
        InputError: The rate does not divide that of the scene's frames.
        BagError: There is no such tick.
    """
    scene = agents[0].scene
    complete = np.all([agent.scene.has(agent.keys) for agent in agents], axis=0)
    ticks = np.flatnonzero(complete)
    ticks = ticks[ticks % frame_period(scene, rate_hz, "rate_hz") == 0]
    if not len(ticks):
        raise BagError(
            f"{scene.path}: at no frame of {rate_hz:g} per second have all agents a cloud, boxes and images of their "
            "cameras"
        )
    return np.asarray(ticks, np.int64)


def _named(scene: Scene, names: Sequence[str]) -> dict[int, str]:
    recorded = recorded_cameras(scene)
    return {number: name for number, name in enumerate(names) if name in recorded}


def _cameras(scene: Scene) -> dict[int, str]:
    """The recorded cameras that look most in the directions of the layout's, by number."""
    names = recorded_cameras(scene)
    if not names:
        return {}
    forward = np.array([scene.calibration[name].ego_from_sensor[:2, 0] for name in names])
    yaw_deg = np.degrees(np.arctan2(forward[:, 1], forward[:, 0]))
    offset_deg = np.abs((yaw_deg[:, None] - CAMERA_YAWS_DEG + 180.0) % 360.0 - 180.0)
    return {
        number: names[row]
        for number, row in enumerate(_best_rows(offset_deg))
        if row >= 0 and offset_deg[row, number] <= _MAX_CAMERA_OFFSET_DEG
    }


def _best_rows(cost: Float64Array) -> list[int]:
    """A row of its own for each column of (rows, columns), so that the sum is minimal; -1: there are too few rows."""
    columns = np.arange(cost.shape[1])
    rows = np.unique(np.argsort(cost, axis=0, kind="stable")[: len(columns)])  # others are never better
    rows = np.append(rows, np.full(max(len(columns) - len(rows), 0), -1))
    choices = np.array(list(permutations(rows.tolist(), len(columns))))
    with_none = np.vstack([cost, np.zeros(len(columns))])
    best: list[int] = choices[np.argmin(with_none[choices, columns].sum(axis=1))].tolist()
    return best
