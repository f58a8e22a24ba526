"""Finds the classes of nuScenes' detection task that occur in a scene as its evaluation counts them.

Rows of a scene's tables enter; names of classes leave. A class without such boxes has an AP of 0 in nuScenes'
evaluation, also for perfect detections, so the classes that occur bound the mAP.
"""

from collections.abc import Mapping, Sequence

import numpy as np

from simbev_exporters.nuscenes.taxonomy import Record, taxonomy_tables
from simbev_ros.dataset.nuscenes.channels import TOP_LIDAR
from simbev_ros.schema.nuscenes import detection_class_of, detection_ranges_m


def evaluated_classes(rows: Mapping[str, Sequence[Record]]) -> set[str]:
    """Classes with a box in a sample that has lidar or radar points and is within the range of its class.

    Args:
        rows: Rows of the tables ``sample_data``, ``ego_pose``, ``instance`` and ``sample_annotation``.
    """
    category = {each["token"]: each["name"] for each in taxonomy_tables()["category"]}
    class_of = {each["token"]: detection_class_of(category[each["category_token"]]) for each in rows["instance"]}
    ego_m, ranges_m, found = _ego_positions(rows), detection_ranges_m(), set()
    for annotation in rows["sample_annotation"]:
        name = class_of[annotation["instance_token"]]
        if name is None or name in found or annotation["num_lidar_pts"] + annotation["num_radar_pts"] == 0:
            continue
        offset_m = np.subtract(annotation["translation"], ego_m[annotation["sample_token"]])
        if np.hypot(*offset_m[:2]) < ranges_m[name]:
            found.add(name)
    return found


def _ego_positions(rows: Mapping[str, Sequence[Record]]) -> dict[str, list[float]]:
    """Position of the ego by token of the sample: that of the uppermost lidar's data, if there are any."""
    position_m = {each["token"]: each["translation"] for each in rows["ego_pose"]}
    data = [each for each in rows["sample_data"] if each["is_key_frame"]]
    data.sort(key=lambda each: f"/{TOP_LIDAR}/" in each["filename"])  # the last one of a sample counts
    return {each["sample_token"]: position_m[each["ego_pose_token"]] for each in data}
