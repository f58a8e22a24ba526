"""3D boxes around the ego: of actors, and of what stands still but counts as an object, traffic lights and signs.

An actor's box holds its mesh as it is posed now, doors shut: people's boxes grow and shrink with their strides, and
their centres move against the actors' places. In /world/actors sizes are constant, and hold all strides.
"""

from dataclasses import dataclass

import numpy as np

from simbev_ros.annotation.bev.levels import EgoLevel, on_ego_level
from simbev_ros.annotation.boxes.extents import Extents
from simbev_ros.scene.blueprints import load_blueprints
from simbev_ros.scene.state import ACTOR_DTYPE, WorldState, map_from_actors
from simbev_ros.semantics import BOX_CLASSES, SIGN_TYPES, Tag
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
        ("id", "<u4"),  # of an actor; what stands still has ids of its own, from ``LIGHT_IDS`` and ``SIGN_IDS`` on
        ("parent", "<u4"),  # id of the actor that it belongs to, else 0
        ("color", "<u4"),  # 0xRRGGBB, sRGB
        ("blueprint", "<u2"),  # index into the catalogue, ``NO_BLUEPRINT`` where it stands still
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

LIGHT_IDS, SIGN_IDS = 0x10000, 0x20000
"""A traffic light's id is the first plus that of /world/signals; a sign's is the second plus its number in the map's
layout, from 1 on. Ids of actors are below, as they must fit instance images."""

NO_CLASS, NO_BLUEPRINT = 255, 65535

_SHARED_COLUMNS = [name for name in BOX_DTYPE.names or () if name in (ACTOR_DTYPE.names or ())]


@dataclass(frozen=True, slots=True)
class Standing:
    """What of a map stands still and has a box; ``standing.standing_of`` finds it.

    Attributes:
        boxes: (S,) ``BOX_DTYPE``, ascending id.
        foot_m: (S, 3) feet of their posts, map frame.
    """

    boxes: Table
    foot_m: Float64Array


def blank(count: int) -> Table:
    """(count,) ``BOX_DTYPE`` boxes of which no sensor knows anything yet."""
    result = np.zeros(count, BOX_DTYPE)
    result["visibility"], result["lidar_points"], result["radar_points"] = np.nan, -1, -1
    return result


def class_of_blueprint() -> UInt8Array:
    """(B,) index into BOX_CLASSES of each blueprint of the catalogue, ``NO_CLASS`` where it has none."""
    names = [blueprint.box_class for blueprint in load_blueprints()]
    return np.array([BOX_CLASSES.index(name) if name else NO_CLASS for name in names], np.uint8)


def box_centers_m(actors: Table) -> Float64Array:
    """(N, 3) centres of the boxes of (N,) ``ACTOR_DTYPE`` rows, map frame."""
    pose = map_from_actors(actors)
    center_m: Float64Array = pose[:, :3, 3] + pose[:, :3, 2] * (actors["height"] / 2.0)[:, None]
    return center_m


def boxes(
    state: WorldState,
    radius_m: float,
    ego_level: EgoLevel | None = None,
    extents: Extents | None = None,
    standing: Standing | None = None,
) -> Table:
    """Boxes of all that has a detection class within a radius of the ego, the ego itself left out.

    Args:
        state: The world now.
        radius_m: Largest distance between the centres of the ego's box and the other.
        ego_level: The level that the ego is on; None: everything counts.
        extents: Of the catalogue's models, for boxes that fit the meshes as they are posed; None: the actors' sizes.
        standing: Traffic lights and signs of the map; None: none.

    Returns:
        (N,) ``BOX_DTYPE``, ascending id.
    """
    parts = [_near(_of_actors(state, radius_m, ego_level, extents), state, radius_m)]
    if standing is not None:
        parts.append(_of_standing(standing, state, radius_m, ego_level))
    return np.concatenate(parts)


def _of_actors(state: WorldState, radius_m: float, ego_level: EgoLevel | None, extents: Extents | None) -> Table:
    """Boxes of actors, of all within the radius at least."""
    actors, classes = state.actors, class_of_blueprint()[state.actors["blueprint"]]
    apart_m = np.hypot(actors["x"] - state.ego["x"], actors["y"] - state.ego["y"])
    counts = (classes != NO_CLASS) & (actors["id"] != state.ego_id)
    chosen = counts & (apart_m <= radius_m + state.ego["height"] + actors["length"] + actors["height"])
    actors = actors[chosen]
    result = blank(len(actors))
    for name in _SHARED_COLUMNS:
        result[name] = actors[name]
    center_m = box_centers_m(actors)
    if extents is not None:
        low_m, high_m = extents.of(actors)
        result["length"], result["width"], result["height"] = (high_m - low_m).T
        pose = map_from_actors(actors)
        center_m = pose[:, :3, 3] + np.einsum("nij,nj->ni", pose[:, :3, :3], (low_m + high_m) / 2.0)
    result["x"], result["y"], result["z"] = center_m.T
    result["class"] = classes[chosen]
    result["sign"] = _sign_of_blueprint()[actors["blueprint"]]
    result["on_ego_level"] = on_ego_level(state, ego_level)[chosen]
    return result


def _of_standing(standing: Standing, state: WorldState, radius_m: float, ego_level: EgoLevel | None) -> Table:
    """Boxes within the radius of what stands still, as it is now."""
    result = _near(standing.boxes, state, radius_m)
    is_light = result["tag"] == Tag.TRAFFIC_LIGHT
    result["state"][is_light] = state.signals["state"][result["id"][is_light] - LIGHT_IDS - 1]
    if ego_level is not None and len(result):
        feet_m = standing.foot_m[np.searchsorted(standing.boxes["id"], result["id"])]
        result["on_ego_level"] = ego_level.members.holds(feet_m)
    return result


def _near(table: Table, state: WorldState, radius_m: float) -> Table:
    """The boxes whose centres are within a radius of that of the ego's, with their distance and angle."""
    ego = state.ego
    center_m = np.stack([table["x"], table["y"], table["z"]], axis=1)
    to_center_ego = (center_m - box_centers_m(ego[None])) @ map_from_actors(ego)[:3, :3]
    distance_m = np.linalg.norm(to_center_ego, axis=1)
    chosen = distance_m <= radius_m
    result: Table = table[chosen]
    result["distance"] = distance_m[chosen]
    result["angle"] = np.arctan2(to_center_ego[:, 1], to_center_ego[:, 0])[chosen]
    return result


def _sign_of_blueprint() -> UInt8Array:
    """(B,) index into SIGN_TYPES of each blueprint of the catalogue."""
    kind = {f"prop.sign_{name}": index for index, name in enumerate(SIGN_TYPES)}
    return np.array([kind.get(blueprint.name, 0) for blueprint in load_blueprints()], np.uint8)
