"""Late fusion: merges the boxes that several agents have found into those of one of them. Imports no ROS."""

from collections.abc import Sequence

import numpy as np

from simbev_ros.reference_stack.arrays import Booleans, Floats, Table, box_axes, rotate, yaw_of

_MARGIN_M = 0.5
"""Distance beyond the sides of a box at which the center of another one may be and still be the same object."""
_OWN_HALF_LENGTH_M, _OWN_HALF_WIDTH_M = 2.8, 1.3
"""A box with its center in such an area around the ego's origin is the ego itself, which others have found."""
_IDS_PER_AGENT = 1 << 24
"""Offset between the ids of two agents' tracks."""


def fuse_boxes(tables: Sequence[Table], map_from_ego: Floats) -> Table:
    """Merge the boxes of several agents.

    Boxes of the same object become one, the box with the highest score. Its score then is the probability that not all
    of them are wrong, as if the agents were wrong independently of each other.

    Args:
        tables: (N,) ``pipeline.BOX_DTYPE`` of each agent, map frame; the first agent is the one that asks.
        map_from_ego: (4, 4) pose of the first agent, which is not among the merged boxes.

    Returns:
        (M,) ``pipeline.BOX_DTYPE``, by descending score before merging.
    """
    boxes = np.concatenate(tables)
    agent = np.repeat(np.arange(len(tables)), [len(table) for table in tables])
    has_track = boxes["id"] >= 0
    boxes["id"][has_track] += (agent[has_track] * _IDS_PER_AGENT).astype(np.int32)
    is_other = ~((agent > 0) & _is_ego(boxes, map_from_ego))
    boxes, agent = boxes[is_other], agent[is_other]
    order = np.argsort(-boxes["score"], kind="stable")
    boxes, agent = boxes[order], agent[order]
    is_left, kept = np.ones(len(boxes), np.bool_), list[Table]()
    while is_left.any():
        best = int(np.argmax(is_left))
        same = is_left & _covers(boxes[best], boxes) & (agent != agent[best])
        same[best] = True
        merged = boxes[best].copy()
        merged["score"] = 1.0 - np.prod(1.0 - boxes["score"][same])
        kept.append(merged)
        is_left &= ~same
    return np.array(kept, boxes.dtype)


def received_boxes(boxes: Table, map_from_ego: Floats, map_from_sent: Floats, age_s: float) -> Table:
    """Boxes of another agent's message where its receiver takes them to be.

    Args:
        boxes: (N,) ``pipeline.BOX_DTYPE`` as the sender has found them, map frame.
        map_from_ego: (4, 4) pose of the sender at that time.
        map_from_sent: (4, 4) pose that it has sent; its boxes have the same error.
        age_s: Time since then, in which they have moved with their velocities.
    """
    map_from_true = map_from_sent @ np.linalg.inv(map_from_ego)
    result, turn = boxes.copy(), map_from_true[:2, :2]
    centers_m = np.stack([boxes[axis] for axis in "xyz"], axis=1) @ map_from_true[:3, :3].T + map_from_true[:3, 3]
    result["vx"], result["vy"] = turn @ np.stack([boxes["vx"], boxes["vy"]])
    result["yaw"] += np.arctan2(turn[1, 0], turn[0, 0])
    for axis, center_m in zip("xyz", centers_m.T, strict=True):
        result[axis] = center_m + age_s * result[f"v{axis}"]
    return result


def _is_ego(boxes: Table, map_from_ego: Floats) -> Booleans:
    """(N,) whether each box is where the ego itself is."""
    offset_m = np.stack([boxes["x"], boxes["y"]], axis=1) - map_from_ego[:2, 3]
    along_m, across_m = np.abs(rotate(box_axes(np.array(yaw_of(map_from_ego))), offset_m)).T
    is_ego: Booleans = (along_m < _OWN_HALF_LENGTH_M) & (across_m < _OWN_HALF_WIDTH_M)
    return is_ego


def _covers(box: Table, others: Table) -> Booleans:
    """(N,) whether the centers of N boxes are inside one box, or just outside."""
    offset_m = np.stack([others["x"] - box["x"], others["y"] - box["y"]], axis=1)
    along_m, across_m = np.abs(rotate(box_axes(box["yaw"]), offset_m)).T
    is_inside = (along_m < box["length"] / 2 + _MARGIN_M) & (across_m < box["width"] / 2 + _MARGIN_M)
    covers: Booleans = is_inside & (np.abs(others["z"] - box["z"]) < box["height"])
    return covers
