"""Checks a T4 dataset with t4-devkit. Run by its own Python, without this project: FOLDER FILE → JSON."""

import json
import sys
from pathlib import Path

import numpy as np
from nuscenes.utils.data_classes import LidarPointCloud
from t4_devkit import Tier4


def inside(box, points, share):
    """Number of (3, N) points inside a box that is larger or smaller by a share."""
    local = box.orientation.rotation_matrix.T @ (points - box.center[:, None])
    width, length, height = box.wlh
    return int(np.all(np.abs(local) <= np.array([[length], [width], [height]]) / 2 * share, axis=0).sum())


def projected(t4, sample, camera):
    """Minimum and maximum u and v of each box in front of a camera, by instance name, with the devkit's geometry.

    ``get_sample_data`` of 0.1.0 fails for cameras, by an index.
    """
    data = t4.get("sample_data", camera)
    calibrated = t4.get("calibrated_sensor", data.calibrated_sensor_token)
    found = {}
    for token in sample.ann_3ds:
        box = t4.get_box3d(token)
        for record in (t4.get("ego_pose", data.ego_pose_token), calibrated):
            box.translate(-record.translation)
            box.rotate(record.rotation.inverse)
        corners = box.corners().T
        if corners[:, 2].min() > 0.3:
            pixels = (corners / corners[:, 2:]) @ calibrated.camera_intrinsic.T
            name = t4.get("instance", t4.get("sample_annotation", token).instance_token).instance_name
            found[name] = [*pixels[:, :2].min(axis=0), *pixels[:, :2].max(axis=0)]
    return found


def main():
    """Run all checks and write their results."""
    t4 = Tier4("annotation", sys.argv[1], verbose=False)
    counted, views = [], []
    for sample in t4.sample:
        lidar = sample.data["LIDAR_CONCAT"]
        path, boxes, _ = t4.get_sample_data(lidar)
        cloud = LidarPointCloud.from_file(path).points[:3]
        for box in boxes:
            stated = t4.get("sample_annotation", box.token).num_lidar_pts
            counted.append([inside(box, cloud, 0.998), stated, inside(box, cloud, 1.002)])
        cameras = {channel: token for channel, token in sample.data.items() if channel.startswith("CAM")}
        seen = {channel: projected(t4, sample, token) for channel, token in cameras.items()}
        views.append({"timestamp": sample.timestamp, "views": seen})
    categories = sorted({annotation.category_name for annotation in t4.sample_annotation})
    Path(sys.argv[2]).write_text(
        json.dumps({"counted": counted, "views": views, "categories": categories, "boxes_2d": len(t4.object_ann)})
    )


main()
