"""Ground-truth 3D boxes around the ego: actors, and the static objects traffic lights and signs.

A ``WorldState`` enters, ``BOX_DTYPE`` rows leave. An actor's box fits its mesh in the current pose, doors shut: a
pedestrian's box grows and shrinks with the stride, and its center moves relative to the actor's position. In
/world/actors sizes are constant and contain all strides.
"""

from dataclasses import dataclass

import numpy as np

from simbev_ros.foundation.semantics import BOX_CLASSES, SIGN_TYPES, Tag
from simbev_ros.foundation.types import Float64Array, Table, UInt8Array
from simbev_ros.scene.blueprints import load_blueprints
from simbev_ros.schema.boxes import BOX_DTYPE, LIGHT_IDS, NO_CLASS, blank_boxes, box_centers_m
from simbev_ros.schema.scene.state import ACTOR_DTYPE, WorldState, map_from_actors
from simbev_ros.simulation.annotation.bev.levels import EgoLevel, on_ego_level
from simbev_ros.simulation.annotation.boxes.extents import Extents

_SHARED_COLUMNS = [name for name in BOX_DTYPE.names or () if name in (ACTOR_DTYPE.names or ())]


@dataclass(frozen=True, slots=True)
class StaticObjects:
    """Boxes of a map's traffic lights and signs; ``standing.find_static_objects`` creates it.

    Attributes:
        boxes: (S,) ``BOX_DTYPE``, ascending id.
        foot_m: (S, 3) feet of their posts, map frame.
    """

    boxes: Table
    foot_m: Float64Array


def class_of_blueprint() -> UInt8Array:
    """(B,) index into BOX_CLASSES of each blueprint of the catalog, ``NO_CLASS`` where it has none."""
    names = [blueprint.box_class for blueprint in load_blueprints()]
    return np.array([BOX_CLASSES.index(name) if name else NO_CLASS for name in names], np.uint8)


def boxes_around_ego(
    state: WorldState,
    radius_m: float,
    ego_level: EgoLevel | None = None,
    extents: Extents | None = None,
    static_objects: StaticObjects | None = None,
) -> Table:
    """Boxes of all objects with a detection class within a radius of the ego, without the ego itself.

    Args:
        state: The world state to label.
        radius_m: Maximum distance between the centers of the ego's box and another box.
        ego_level: The road level that the ego is on; None: everything counts.
        extents: Extents of the catalog's models, for boxes that fit the posed meshes; None: use the actors' sizes.
        static_objects: Traffic lights and signs of the map; None: leave them out.

    Returns:
        (N,) ``BOX_DTYPE``, ascending id.
    """
    parts = [_near(_actor_boxes(state, radius_m, ego_level, extents), state, radius_m)]
    if static_objects is not None:
        parts.append(_static_boxes(static_objects, state, radius_m, ego_level))
    return np.concatenate(parts)


def _actor_boxes(state: WorldState, radius_m: float, ego_level: EgoLevel | None, extents: Extents | None) -> Table:
    """Boxes of actors, at least of all within the radius."""
    actors, classes = state.actors, class_of_blueprint()[state.actors["blueprint"]]
    counts = (classes != NO_CLASS) & (actors["id"] != state.ego_id)
    reach_m = radius_m + state.ego["height"] + actors["length"] + actors["height"]
    selected = counts & (state.distance_to_ego_m <= reach_m)
    actors = actors[selected]
    result = blank_boxes(len(actors))
    for name in _SHARED_COLUMNS:
        result[name] = actors[name]
    center_m = box_centers_m(actors)
    if extents is not None:
        low_m, high_m = extents.bounds(actors)
        result["length"], result["width"], result["height"] = (high_m - low_m).T
        pose = map_from_actors(actors)
        center_m = pose[:, :3, 3] + np.einsum("nij,nj->ni", pose[:, :3, :3], (low_m + high_m) / 2.0)
    result["x"], result["y"], result["z"] = center_m.T
    result["class"] = classes[selected]
    result["sign"] = _sign_of_blueprint()[actors["blueprint"]]
    result["on_ego_level"] = on_ego_level(state, ego_level)[selected]
    return result


def _static_boxes(
    static_objects: StaticObjects, state: WorldState, radius_m: float, ego_level: EgoLevel | None
) -> Table:
    """Boxes of static objects within the radius, with the current signal states."""
    result = _near(static_objects.boxes, state, radius_m)
    is_light = result["tag"] == Tag.TRAFFIC_LIGHT
    result["state"][is_light] = state.signals["state"][result["id"][is_light] - LIGHT_IDS - 1]
    if ego_level is not None and len(result):
        feet_m = static_objects.foot_m[np.searchsorted(static_objects.boxes["id"], result["id"])]
        result["on_ego_level"] = ego_level.members.holds(feet_m)
    return result


def _near(table: Table, state: WorldState, radius_m: float) -> Table:
    """The boxes with centers within a radius of the center of the ego's box, with distance and angle filled in."""
    ego = state.ego
    center_m = np.stack([table["x"], table["y"], table["z"]], axis=1)
    to_center_ego = (center_m - box_centers_m(ego[None])) @ map_from_actors(ego)[:3, :3]
    distance_m = np.linalg.norm(to_center_ego, axis=1)
    selected = distance_m <= radius_m
    result: Table = table[selected]
    result["distance"] = distance_m[selected]
    result["angle"] = np.arctan2(to_center_ego[:, 1], to_center_ego[:, 0])[selected]
    return result


def _sign_of_blueprint() -> UInt8Array:
    """(B,) index into SIGN_TYPES of each blueprint of the catalog."""
    kind = {f"prop.sign_{name}": index for index, name in enumerate(SIGN_TYPES)}
    return np.array([kind.get(blueprint.name, 0) for blueprint in load_blueprints()], np.uint8)
