"""Loads tracks as the nuscenes-devkit does. Run by its own Python, without this project: RESULTS → JSON on stdout."""

import json
import sys

from nuscenes.eval.common.config import config_factory  # type: ignore[import-not-found]
from nuscenes.eval.common.loaders import load_prediction  # type: ignore[import-not-found]
from nuscenes.eval.tracking.data_classes import TrackingBox  # type: ignore[import-not-found]

limit = config_factory("tracking_nips_2019").max_boxes_per_sample
boxes, _ = load_prediction(sys.argv[1], limit, TrackingBox)
print(json.dumps({token: [each.serialize() for each in boxes[token]] for token in boxes.sample_tokens}))
