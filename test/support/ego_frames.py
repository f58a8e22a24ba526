"""Scenes with other coordinate frames than the default ones, and their transforms as matrices."""

from collections.abc import Iterable, Mapping
from typing import Any

import numpy as np
from geometry_msgs.msg import TransformStamped
from scene_edits import with_ego

from simbev_ros.config.frames import Frames
from simbev_ros.foundation.geometry.transforms import matrices_from_xyz_quaternion
from simbev_ros.foundation.types import Float64Array
from simbev_ros.scene.blueprints import blueprint_named
from simbev_ros.scene.frames import base_link_x_m
from simbev_ros.schema.scene.spec import SceneSpec


def with_frames(spec: SceneSpec, **frames: Any) -> SceneSpec:
    """A scene as it is drawn with these ``frames``, after a round trip through JSON."""
    made = Frames.model_validate(frames)
    ahead_m = base_link_x_m(made, blueprint_named(spec.vehicles[0].blueprint))
    return SceneSpec.model_validate_json(with_ego(spec, frames=made, base_link_x_m=ahead_m).model_dump_json())


def edges(transforms: Iterable[TransformStamped]) -> dict[tuple[str, str], Float64Array]:
    """(4, 4) parent from child of transforms, by parent and child."""
    found = {}
    for each in transforms:
        move, turn = each.transform.translation, each.transform.rotation
        found[each.header.frame_id, each.child_frame_id] = matrices_from_xyz_quaternion(
            np.array([move.x, move.y, move.z]), np.array([turn.x, turn.y, turn.z, turn.w])
        )
    return found


def pose_in_tree(tree: Mapping[tuple[str, str], Float64Array], frame: str, root: str = "map") -> Float64Array:
    """(4, 4) root from a frame, along the only path to it; fails if a frame on it has no parent or two."""
    pose = np.eye(4)
    while frame != root:
        ((parent, parent_from_child),) = ((parent, pose) for (parent, child), pose in tree.items() if child == frame)
        pose, frame = parent_from_child @ pose, parent
    return pose
