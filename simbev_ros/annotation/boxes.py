"""3D boxes of the actors around the ego."""

import numpy as np

from simbev_ros.annotation.levels import EgoLevel, on_ego_level
from simbev_ros.scene.blueprints import load_blueprints
from simbev_ros.scene.state import ACTOR_DTYPE, WorldState, map_from_actors
from simbev_ros.semantics import BOX_CLASSES
from simbev_ros.types import Float64Array, Table, UInt8Array

BOX_DTYPE = np.dtype(
    [
        ("x", "<f8"),  # m, map frame: centre of the box
        ("y", "<f8"),
        ("z", "<f8"),
        ("roll", "<f4"),  # rad, fixed axes x y z (REP-103): R = Rz(yaw) Ry(pitch) Rx(roll)
        ("pitch", "<f4"),
        ("yaw", "<f4"),
        ("length", "<f4"),  # m, along x y z of the box
        ("width", "<f4"),
        ("height", "<f4"),
        ("vx", "<f4"),  # m/s, map frame
        ("vy", "<f4"),
        ("vz", "<f4"),
        ("ax", "<f4"),  # m/s², map frame
        ("ay", "<f4"),
        ("az", "<f4"),
        ("wx", "<f4"),  # rad/s, map frame
        ("wy", "<f4"),
        ("wz", "<f4"),
        ("distance", "<f4"),  # m, from the centre of the ego's box to that of this one
        ("angle", "<f4"),  # rad, direction to the centre in the ego frame, 0 ahead, left positive
        ("visibility", "<f4"),  # visible pixels over those of the object drawn alone, all cameras together; NaN: unseen
        ("limit", "<f4"),  # m/s that a speed limit's sign allows, else 0
        ("lidar_points", "<i4"),  # of all lidars inside the box; -1: none was received at this tick
        ("radar_points", "<i4"),
        ("id", "<u4"),
        ("parent", "<u4"),  # id of the actor that it belongs to, else 0
        ("color", "<u4"),  # 0xRRGGBB, sRGB
        ("blueprint", "<u2"),  # index into the catalogue
        ("lights", "<u2"),  # Light bits
        ("behavior", "<u2"),  # Behavior bits
        ("class", "u1"),  # index into BOX_CLASSES
        ("tag", "u1"),  # semantic Tag
        ("doors", "u1"),  # bit k: door k is open
        ("on_ego_level", "u1"),  # 1: on a road of the ego's level; 0: on one that passes above or beneath it
        ("valid", "u1"),  # 1: at least one point of a lidar or radar is inside
        ("difficulty", "u1"),  # index into DIFFICULTIES
        ("state", "u1"),  # SignalState of a traffic light
        ("sign", "u1"),  # index into SIGN_TYPES of a traffic sign
    ]
)
"""One row per box. Field names and order are those of /ego/boxes."""

DIFFICULTIES: tuple[str, ...] = ("easy", "medium", "hard")

SIGN_TYPES: tuple[str, ...] = ("", "stop", "yield", "speed_limit", "works", "accident")
"""Of no sign, of those of the map, and of those that warn of hazards."""

_SHARED_COLUMNS = [name for name in BOX_DTYPE.names or () if name in (ACTOR_DTYPE.names or ())]
NO_CLASS = 255


def class_of_blueprint() -> UInt8Array:
    """(B,) index into BOX_CLASSES of each blueprint of the catalogue, ``NO_CLASS`` where it has none."""
    names = [blueprint.box_class for blueprint in load_blueprints()]
    return np.array([BOX_CLASSES.index(name) if name else NO_CLASS for name in names], np.uint8)


def box_centers_m(actors: Table) -> Float64Array:
    """(N, 3) centres of the boxes of (N,) ``ACTOR_DTYPE`` rows, map frame."""
    pose = map_from_actors(actors)
    center_m: Float64Array = pose[:, :3, 3] + pose[:, :3, 2] * (actors["height"] / 2.0)[:, None]
    return center_m


def boxes(state: WorldState, radius_m: float, ego_level: EgoLevel | None = None) -> Table:
    """Boxes of all actors of a detection class within a radius of the ego, the ego itself left out.

    Args:
        state: The world now.
        radius_m: Largest distance between the centres of the ego's box and the other.
        ego_level: The level that the ego is on; None: everything counts.

    Returns:
        (N,) ``BOX_DTYPE``, ascending id.
    """
    actors = state.actors
    classes = class_of_blueprint()[actors["blueprint"]]
    center_m = box_centers_m(actors)
    ego = int(np.searchsorted(actors["id"], state.ego_id))
    to_center_ego = (center_m - center_m[ego]) @ map_from_actors(state.ego)[:3, :3]
    distance_m = np.linalg.norm(to_center_ego, axis=1)
    chosen = (distance_m <= radius_m) & (classes != NO_CLASS) & (actors["id"] != state.ego_id)
    result = np.zeros(int(chosen.sum()), BOX_DTYPE)
    result["visibility"], result["lidar_points"], result["radar_points"] = np.nan, -1, -1
    for name in _SHARED_COLUMNS:
        result[name] = actors[name][chosen]
    result["x"], result["y"], result["z"] = center_m[chosen].T
    result["distance"] = distance_m[chosen]
    result["angle"] = np.arctan2(to_center_ego[:, 1], to_center_ego[:, 0])[chosen]
    result["class"] = classes[chosen]
    result["on_ego_level"] = on_ego_level(state, ego_level)[chosen]
    return result
