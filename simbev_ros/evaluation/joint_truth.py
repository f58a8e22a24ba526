"""Ground truth of cooperative perception: the boxes around one agent, with what all agents together see of them.

The joint table of a scene, /world/boxes, enters; a table leaves that is evaluated like the agent's own.
"""

import numpy as np

from simbev_ros.config.evaluation import Truth
from simbev_ros.foundation.errors import InputError
from simbev_ros.foundation.types import Table
from simbev_ros.schema.boxes import BOX_DTYPE, difficulty
from simbev_ros.schema.scene.agents import AgentView

_OF_AGENT = {"distance": "distance", "angle": "angle", "on_ego_level": "on_level"}
"""Columns that depend on where the agent is, and their names in the joint table, after the agent's."""
_DERIVED = ("valid", "difficulty")
"""Columns that follow from others."""
_KEYS: dict[Truth, str] = {"own": "boxes", "joint": "world/boxes"}


def truth_key(truth: Truth) -> str:
    """Key of the boxes in a recorded frame."""
    return _KEYS[truth]


def boxes_in_reach(joint: Table, view: AgentView) -> Table:
    """The boxes of the joint table around one agent.

    Args:
        joint: (N,) rows of /world/boxes, ``simulation.annotation.boxes.joint.joint_dtype``.
        view: The scene as the agent sees it.

    Returns:
        (M,) ``BOX_DTYPE``, ascending id: the boxes within the agent's radius, without itself. Points and visibility are
        those of all agents together, and the difficulty follows from them; distance, angle and level are the agent's.

    Raises:
        InputError: The table has no such columns, for example because it is of a scene without this agent.
    """
    agent = view.agent
    names = (name for name in BOX_DTYPE.names or () if name not in _DERIVED)
    columns = {name: f"{agent}.{_OF_AGENT[name]}" if name in _OF_AGENT else name for name in names}
    missing = [column for column in columns.values() if column not in (joint.dtype.names or ())]
    if missing:
        raise InputError(f"world/boxes: the joint boxes of {view.scene.name} have no column {missing[0]}")
    near = joint[joint[columns["distance"]] <= view.annotation.box_radius_m]
    boxes = np.zeros(len(near), BOX_DTYPE)
    for name, column in columns.items():
        boxes[name] = near[column]
    points = np.maximum(boxes["lidar_points"], 0) + np.maximum(boxes["radar_points"], 0)
    boxes["valid"] = points > 0
    boxes["difficulty"] = difficulty(boxes["class"], boxes["distance"], points)
    return boxes
