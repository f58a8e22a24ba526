"""Evaluates detections with the nuscenes-devkit. Run by its own Python: DATAROOT SPLIT RESULTS FOLDER → JSON."""

import json
import sys
from pathlib import Path

from nuscenes import NuScenes
from nuscenes.eval.common.config import config_factory
from nuscenes.eval.detection.evaluate import DetectionEval


def main(dataroot: str, split: str, results: str, folder: str) -> None:
    """Write the devkit's figures, and the numbers of ground-truth boxes and predictions that counted."""
    nusc = NuScenes(version="v1.0-trainval", dataroot=dataroot, verbose=False)
    evaluation = DetectionEval(nusc, config_factory("detection_cvpr_2019"), results, split, folder, verbose=False)
    metrics, _ = evaluation.evaluate()
    counts = {"truths": len(evaluation.gt_boxes.all), "predictions": len(evaluation.pred_boxes.all)}
    (Path(folder) / "figures.json").write_text(json.dumps({**metrics.serialize(), "cfg": None, **counts}))


main(*sys.argv[1:])
