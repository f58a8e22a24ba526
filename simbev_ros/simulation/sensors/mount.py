"""Pose of a mounted sensor in the map frame, from the state of the vehicle that carries it."""

import numpy as np

from simbev_ros.config.sensor import Pose
from simbev_ros.foundation.types import Float64Array, Table
from simbev_ros.schema.scene.state import WorldState, map_from_actors


def map_from_sensor(pose: Pose, state: WorldState) -> Float64Array:
    """(4, 4) transform, map from sensor, of a sensor mounted on the ego; sensor frame x forward, y left, z up."""
    return map_from_actors(state.ego) @ pose.ego_from_sensor


def vector(row: Table, names: str) -> Float64Array:
    """(3,) float64 vector from three columns of one table row, such as ``vector(ego, "vx vy vz")``."""
    return np.array([row[name] for name in names.split()], np.float64)
