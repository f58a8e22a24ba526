"""A program of its own, ``BOXES OUT``: computes metrics of the boxes in a JSON file with the nuscenes-devkit.

It runs in a Python installation that has the devkit, needs no dataset, and imports nothing of this project.
"""

import json
import sys
import time
from pathlib import Path
from typing import Any

import numpy as np
from nuscenes.eval.common.config import config_factory  # type: ignore[import-not-found]
from nuscenes.eval.common.data_classes import EvalBoxes  # type: ignore[import-not-found]
from nuscenes.eval.detection.algo import accumulate, calc_ap, calc_tp  # type: ignore[import-not-found]
from nuscenes.eval.detection.constants import TP_METRICS  # type: ignore[import-not-found]
from nuscenes.eval.detection.data_classes import DetectionBox, DetectionMetrics  # type: ignore[import-not-found]

HAS_NO = {"traffic_cone": ["attr_err", "vel_err", "orient_err"], "barrier": ["attr_err", "vel_err"]}


def numbers(truth: Any, predictions: Any) -> dict[str, Any]:
    """Metrics of predictions, computed as in the devkit's ``DetectionEval.evaluate``."""
    config = config_factory("detection_cvpr_2019")
    metrics = DetectionMetrics(config)
    for name in config.class_names:
        for distance_m in config.dist_ths:
            data = accumulate(truth, predictions, name, config.dist_fcn_callable, distance_m)
            metrics.add_label_ap(name, distance_m, calc_ap(data, config.min_recall, config.min_precision))
            if distance_m == config.dist_th_tp:
                for metric in TP_METRICS:
                    error = np.nan if metric in HAS_NO.get(name, []) else calc_tp(data, config.min_recall, metric)
                    metrics.add_label_tp(name, metric, error)
    return {**metrics.serialize(), "cfg": None}


def main(boxes: Path, out: Path) -> None:
    """Write the metrics and the time that they took."""
    content = json.loads(boxes.read_text())
    both = [EvalBoxes.deserialize(content[kind], DetectionBox) for kind in ("truth", "predictions")]
    began_s = time.perf_counter()
    found = numbers(*both)
    out.write_text(json.dumps({**found, "seconds": time.perf_counter() - began_s}))


if __name__ == "__main__":
    main(Path(sys.argv[1]), Path(sys.argv[2]))
