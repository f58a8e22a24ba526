"""Checks an export with the nuscenes-devkit. Run by its own Python, without this project: DATAROOT FOLDER → JSON."""

import json
import sys
from collections import Counter
from pathlib import Path

import matplotlib as mpl

mpl.use("Agg")

import numpy as np
from nuscenes import NuScenes
from nuscenes.eval.common.config import config_factory
from nuscenes.eval.detection.evaluate import DetectionEval
from nuscenes.eval.detection.utils import category_to_detection_name
from nuscenes.utils.data_classes import LidarPointCloud, RadarPointCloud
from nuscenes.utils.data_io import load_bin_file
from nuscenes.utils.geometry_utils import BoxVisibility, points_in_box
from pyquaternion import Quaternion

SPLIT = "simbev_train"


def points(nusc, sample, modality):
    """(3, N) points of all sensors of a modality in the global frame, as transformed by the devkit."""
    kind = LidarPointCloud if modality == "lidar" else RadarPointCloud
    clouds = []
    for token in sample["data"].values():
        data = nusc.get("sample_data", token)
        if data["sensor_modality"] != modality:
            continue
        cloud = kind.from_file(nusc.get_sample_data_path(token))
        for table, key in (("calibrated_sensor", "calibrated_sensor_token"), ("ego_pose", "ego_pose_token")):
            record = nusc.get(table, data[key])
            cloud.rotate(Quaternion(record["rotation"]).rotation_matrix)
            cloud.translate(np.array(record["translation"]))
        clouds.append(cloud.points[:3])
    return np.concatenate(clouds, axis=1)


def miscounted(nusc, modality):
    """Boxes whose number of points differs from the table; points on faces may count or not."""
    wrong, inside = [], 0
    for sample in nusc.sample:
        cloud = points(nusc, sample, modality)
        for token in sample["anns"]:
            stated = nusc.get("sample_annotation", token)[f"num_{modality}_pts"]
            min_count, max_count = (
                int(points_in_box(nusc.get_box(token), cloud, size).sum()) for size in (0.998, 1.002)
            )
            inside += min_count
            if not min_count <= stated <= max_count:
                wrong.append([token, stated, min_count, max_count])
    return {"wrong": wrong, "inside": inside}


def labels_in_boxes(nusc):
    """Share of the lidar points in boxes that have the category of the box, by category, and their number."""
    right, total = Counter(), Counter()
    for sample in nusc.sample:
        data = nusc.get("sample_data", sample["data"]["LIDAR_TOP"])
        labels = load_bin_file(str(Path(nusc.dataroot, nusc.get("lidarseg", data["token"])["filename"])), "lidarseg")
        path, boxes, _ = nusc.get_sample_data(data["token"])
        cloud = LidarPointCloud.from_file(path).points[:3]
        assert len(labels) == cloud.shape[1]
        for box in boxes:
            inside = points_in_box(box, cloud, 0.95)
            total[box.name] += int(inside.sum())
            right[box.name] += int((labels[inside] == nusc.lidarseg_name2idx_mapping[box.name]).sum())
    return {"right": right, "total": total}


def lidarseg(nusc, folder):
    """What the devkit says of the labels, and its pictures of them."""
    sample = nusc.sample[len(nusc.sample) // 2]
    nusc.get_sample_lidarseg_stats(sample["token"])
    nusc.render_sample_data(
        sample["data"]["LIDAR_TOP"],
        with_anns=False,
        show_lidarseg=True,
        show_lidarseg_legend=True,
        underlay_map=False,
        out_path=str(folder / "lidarseg.png"),
        verbose=False,
    )
    return {"files": len(nusc.lidarseg), "boxes": labels_in_boxes(nusc)}


def predictions(nusc):
    """The ground truth as detections."""
    attribute = {each["token"]: each["name"] for each in nusc.attribute}
    results = {}
    for sample in nusc.sample:
        results[sample["token"]] = []
        for token in sample["anns"]:
            annotation = nusc.get("sample_annotation", token)
            name = category_to_detection_name(annotation["category_name"])
            if (
                name is not None and annotation["num_lidar_pts"] + annotation["num_radar_pts"] != 0
            ):  # the devkit drops such boxes of the ground truth
                results[sample["token"]].append(
                    {
                        "sample_token": sample["token"],
                        "translation": annotation["translation"],
                        "size": annotation["size"],
                        "rotation": annotation["rotation"],
                        "velocity": np.nan_to_num(nusc.box_velocity(token)[:2]).tolist(),
                        "detection_name": name,
                        "detection_score": 1.0,
                        "attribute_name": attribute[annotation["attribute_tokens"][0]]
                        if annotation["attribute_tokens"]
                        else "",
                    }
                )
    meta = dict.fromkeys(["use_camera", "use_lidar", "use_radar", "use_map", "use_external"], False)
    return {"meta": meta, "results": results}


def evaluate_truth(nusc, folder):
    """The devkit's scores of the ground truth as predictions, over all classes and over those that occur."""
    path = folder / "predictions.json"
    path.write_text(json.dumps(predictions(nusc)))
    config = config_factory("detection_cvpr_2019")
    evaluation = DetectionEval(nusc, config, str(path), SPLIT, str(folder / "eval"), verbose=False)
    metrics, _ = evaluation.evaluate()
    whole = {"mean_ap_of_all": metrics.mean_ap, "nd_score_of_all": metrics.nd_score}
    config.class_names = sorted({box.detection_name for box in evaluation.gt_boxes.all})
    metrics, _ = evaluation.evaluate()
    return {**whole, "classes": config.class_names, "mean_ap": metrics.mean_ap, "nd_score": metrics.nd_score}


def main():
    """Run all checks and write their results."""
    dataroot, folder = sys.argv[1], Path(sys.argv[2])
    nusc = NuScenes(version="v1.0-trainval", dataroot=dataroot, verbose=False)
    nusc.list_scenes()
    nusc.list_categories()
    nusc.list_attributes()
    sample = nusc.sample[len(nusc.sample) // 2]
    for channel, token in sample["data"].items():
        nusc.render_sample_data(token, out_path=str(folder / f"{channel}.png"), verbose=False)
    nusc.render_pointcloud_in_image(sample["token"], out_path=str(folder / "points_in_image.png"), verbose=False)
    nusc.render_egoposes_on_map(nusc.log[0]["location"], out_path=str(folder / "map.png"))
    poses = np.array([pose["translation"] for pose in nusc.ego_pose])
    seen = {
        channel: len(nusc.get_sample_data(token, box_vis_level=BoxVisibility.ANY)[1])
        for channel, token in sample["data"].items()
    }
    found = {
        "scenes": [scene["name"] for scene in nusc.scene],
        "samples": len(nusc.sample),
        "seen": seen,
        "on_mask": bool(nusc.map[0]["mask"].is_on_mask(poses[:, 0], poses[:, 1]).all()),
        "mask_share": float((nusc.map[0]["mask"].mask() == 255).mean()),
        "lidar": miscounted(nusc, "lidar"),
        "radar": miscounted(nusc, "radar"),
        "lidarseg": lidarseg(nusc, folder),
        "detection": evaluate_truth(nusc, folder),
    }
    (folder / "found.json").write_text(json.dumps(found))


main()
