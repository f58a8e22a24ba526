"""Boxes of a map's traffic lights and signs; they fit the meshes without the posts that carry them.

A ``RoadNetwork`` enters, ``StaticObjects`` leave, prepared once per scene. The meshes of lights and signs use the same
poses, and nothing moves them when a region is built. Street name plates are decoration and have no boxes.
"""

from collections.abc import Sequence

import numpy as np

from simbev_ros.assets.mesh.mesh import Mesh
from simbev_ros.assets.street.signal_poles import signal_head
from simbev_ros.assets.street.signs import sign_mesh
from simbev_ros.foundation.geometry.transforms import rotations_from_rpy
from simbev_ros.foundation.semantics import BOX_CLASSES, SIGN_TYPES, Tag
from simbev_ros.foundation.types import Float64Array, Table
from simbev_ros.maps.network import RoadNetwork, Signal
from simbev_ros.maps.roads.layout import Sign
from simbev_ros.schema.boxes import LIGHT_IDS, NO_BLUEPRINT, SIGN_IDS, blank_boxes
from simbev_ros.simulation.annotation.boxes.boxes import StaticObjects


def find_static_objects(network: RoadNetwork) -> StaticObjects:
    """Boxes of all signal heads and signs of a road network; their x axis is the direction that they face."""
    lights, signs = _lights(network.signals), _signs(network.layout.signs)
    feet_m = [signal.pole_m for signal in network.signals] + [sign.foot_m for sign in network.layout.signs]
    return StaticObjects(np.concatenate([lights, signs]), np.array(feet_m, np.float64).reshape(-1, 3))


def _lights(signals: Sequence[Signal]) -> Table:
    return _boxes(
        Tag.TRAFFIC_LIGHT,
        LIGHT_IDS,
        [_bounds_m(signal_head(), Tag.TRAFFIC_LIGHT)] * len(signals),
        [(*signal.position_m, signal.yaw_rad) for signal in signals],
    )


def _signs(signs: Sequence[Sign]) -> Table:
    bounds_m = {(sign.kind, sign.speed_mps): _bounds_m(sign_mesh(sign), Tag.TRAFFIC_SIGN) for sign in signs}
    result = _boxes(
        Tag.TRAFFIC_SIGN,
        SIGN_IDS,
        [bounds_m[sign.kind, sign.speed_mps] for sign in signs],
        [(*sign.foot_m, sign.yaw_rad) for sign in signs],
    )
    result["sign"] = [SIGN_TYPES.index(sign.kind) for sign in signs]
    result["limit"] = [sign.speed_mps for sign in signs]
    return result


def _boxes(tag: Tag, ids: int, bounds_m: Sequence[Float64Array], poses: Sequence[tuple[float, ...]]) -> Table:
    """Boxes with ids from ``ids + 1``, from the (2, 3) bounds of their meshes and the meshes' x, y, z and yaw."""
    result = blank_boxes(len(bounds_m))
    low_m, high_m = np.array(bounds_m).reshape(-1, 2, 3).swapaxes(0, 1)
    pose = np.array(poses).reshape(-1, 4)
    rotations = rotations_from_rpy(pose[:, 3:] * [0.0, 0.0, 1.0])
    center_m = pose[:, :3] + np.einsum("nij,nj->ni", rotations, (low_m + high_m) / 2.0)
    result["x"], result["y"], result["z"] = center_m.T
    result["length"], result["width"], result["height"] = (high_m - low_m).T
    result["id"], result["yaw"] = ids + 1 + np.arange(len(result)), pose[:, 3]
    result["class"], result["tag"] = BOX_CLASSES.index(tag.name.lower()), tag
    result["blueprint"], result["on_ego_level"] = NO_BLUEPRINT, 1
    return result


def _bounds_m(mesh: Mesh, tag: Tag) -> Float64Array:
    """(2, 3) minimum and maximum coordinates of the vertices with a tag."""
    vertices = mesh.vertices[mesh.tag == tag].astype(np.float64)
    return np.stack([vertices.min(axis=0), vertices.max(axis=0)])
