"""Open doors of vehicles: no part of their boxes, but the ego can drive into them."""

import numpy as np

from simbev_ros.assets.actors.catalog import load_models
from simbev_ros.assets.actors.skeletons import part_poses
from simbev_ros.evaluation.driving.moment import Moment, sizes_m
from simbev_ros.evaluation.driving.static_world import SolidMesh
from simbev_ros.foundation.types import BoolArray, Float64Array, Table
from simbev_ros.schema.scene.state import map_from_actors

_DOOR_M = 1.5  # maximum length of a door


def open_doors_touched(moment: Moment) -> BoolArray:
    """(N,) whether the box of the ego touches the mesh of an open door of each of ``moment.others``."""
    others, own_m = moment.others, sizes_m(moment.ego)
    found: BoolArray = others["doors"] > 0
    if found.any():
        reach_m = (np.hypot(*sizes_m(others)[:, :2].T) + np.hypot(*own_m[:2])) / 2.0 + _DOOR_M
        found &= np.hypot(*moment.seen_from_ego(others).T) < reach_m
    for row in np.flatnonzero(found):
        doors = SolidMesh(open_doors_m(others[[row]]))
        found[row] = doors.touched_by(moment.position_m, moment.yaw_rad, own_m)
    return found


def open_doors_m(vehicle: Table) -> Float64Array:
    """(T, 3, 3) triangles of the open doors of a (1,) vehicle, map frame."""
    model, bits = load_models()[int(vehicle["blueprint"][0])], int(vehicle["doors"][0])
    is_open = np.array([part.opening_rad != 0.0 and bool(bits >> part.door & 1) for part in model.parts])
    triangles = model.mesh.triangles[is_open[model.mesh.part[model.mesh.triangles[:, 0]]]]
    map_from_part = (map_from_actors(vehicle)[:, None] @ part_poses(model, vehicle))[0][model.mesh.part[triangles]]
    turned_m = np.einsum("tcij,tcj->tci", map_from_part[..., :3, :3], model.mesh.vertices[triangles])
    return turned_m + map_from_part[..., :3, 3]
