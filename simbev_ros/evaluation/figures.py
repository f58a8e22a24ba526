"""Converts the metrics of an ``Evaluation`` to plain values for JSON; undefined values are null.

The result is a nested dictionary. The files of ``simbev evaluate``, the tables and the HTML report are made from it.
"""

from collections.abc import Iterable, Mapping
from typing import Any

import numpy as np

from simbev_ros.evaluation.evaluation import Evaluation
from simbev_ros.evaluation.metrics.averages import mean_ignoring_nan
from simbev_ros.evaluation.metrics.detection import DetectionResult, Method
from simbev_ros.evaluation.metrics.errors import ERRORS
from simbev_ros.evaluation.metrics.nuscenes import DISTANCES_M, NuscenesResult
from simbev_ros.evaluation.metrics.nuscenes import ERRORS as NUSCENES_ERRORS
from simbev_ros.evaluation.metrics.segmentation import THRESHOLDS, SegmentationTally
from simbev_ros.evaluation.metrics.tracking import TrackingResult
from simbev_ros.evaluation.slices import TableSlice
from simbev_ros.foundation.semantics import BEV_CLASSES, BOX_CLASSES

METHODS: tuple[Method, ...] = ("iou", "distance")


def figures_of(evaluation: Evaluation) -> dict[str, Any]:
    """Convert an evaluation to plain values: frame counts, detection, segmentation and tracking by slice, nuScenes."""
    frames = {"evaluated": evaluation.frame_count, "scenes": len(evaluation.frames)}
    for kind in ("boxes", "grids"):
        frames[f"answered_{kind}"] = sum(getattr(evaluation, f"answered_{kind}").values())
    figures: dict[str, Any] = {"frames": frames}
    if evaluation.detections:
        figures["detection"] = _by_slice(
            {table_slice: _detection(each) for table_slice, each in evaluation.detections.items()}
        )
        figures["detection"]["left_out"] = evaluation.left_out._asdict()
    if evaluation.segmentations:
        chosen = evaluation.grid_classes
        cells = {
            table_slice: segmentation_figures(each, chosen) for table_slice, each in evaluation.segmentations.items()
        }
        figures["segmentation"] = _by_slice(cells)
    if evaluation.trackings:
        figures["tracking"] = _by_slice(
            {table_slice: _tracking(each) for table_slice, each in evaluation.trackings.items()}
        )
    if evaluation.nuscenes is not None:
        figures["nuscenes"] = _nuscenes(evaluation.nuscenes)
    return figures


def _by_slice(figures: Mapping[TableSlice, Any]) -> dict[str, Any]:
    """Values of the slice with everything at the top level, those of the other slices below their condition."""
    result: dict[str, Any] = {}
    for table_slice, values in figures.items():
        if table_slice.group:
            result.setdefault(f"by_{table_slice.group}", {})[table_slice.name] = values
        else:
            result.update(values)
    return result


def _detection(result: DetectionResult) -> dict[str, Any]:
    totals: dict[str, Any] = {
        method: {
            "mAP": _finite_or_none(result.mean_ap(method)),
            **_finite_values(result.mean_errors(method)),
            "SDS": _finite_or_none(result.sds(method)),
        }
        for method in METHODS
        if len(result.columns(method))
    }
    labels = np.flatnonzero(result.truths).tolist()
    return {"boxes": int(result.truths.sum()), **totals, "classes": {BOX_CLASSES[k]: _class(result, k) for k in labels}}


def _class(result: DetectionResult, label: int) -> dict[str, Any]:
    figures: dict[str, Any] = {"boxes": int(result.truths[label])}
    for method in METHODS:
        columns = result.columns(method)
        if len(columns):
            names = [f"{result.options.thresholds[column][1]:g}" for column in columns]
            errors = mean_ignoring_nan(result.errors[label, columns], axis=0)
            figures[method] = {
                "AP": _finite_or_none(float(mean_ignoring_nan(result.ap[label, columns]))),
                **_by_name(ERRORS, errors),
                "AP_at": _by_name(names, result.ap[label, columns]),
            }
    return figures


def segmentation_figures(tally: SegmentationTally, classes: Iterable[str]) -> dict[str, Any]:
    """IoU by class and score threshold, and the mean IoU over the given classes."""
    rows = [BEV_CLASSES.index(name) for name in classes]
    iou, names = tally.iou()[rows], [f"{each:g}" for each in THRESHOLDS]
    by_class = {BEV_CLASSES[row]: _by_name(names, values) for row, values in zip(rows, iou, strict=True)}
    return {"frames": tally.frames, "mean_IoU_at": _by_name(names, mean_ignoring_nan(iou, axis=0)), "IoU_at": by_class}


def _tracking(result: TrackingResult) -> dict[str, Any]:
    classes = {
        name: {"boxes": each.boxes, "objects": each.objects, **_finite_values(each.values)}
        for name, each in result.classes.items()
    }
    return {**_finite_values(result.totals()), "classes": classes}


def _nuscenes(result: NuscenesResult) -> dict[str, Any]:
    distances, occurring = [f"{each:g}" for each in DISTANCES_M], result.over_occurring
    classes = {
        name: {
            "boxes": boxes,
            "AP": _finite_or_none(ap.mean()),
            **_by_name(NUSCENES_ERRORS, errors),
            "AP_at": _by_name(distances, ap),
        }
        for name, boxes, ap, errors in zip(
            result.classes, result.truths.tolist(), result.ap, result.errors, strict=True
        )
    }
    return {
        **_nuscenes_means(result),
        "occurring": None if occurring is None else _nuscenes_means(occurring),
        "classes": classes,
    }


def _nuscenes_means(result: NuscenesResult) -> dict[str, float | None]:
    return {
        "mAP": _finite_or_none(result.mean_ap),
        **_finite_values(result.mean_errors),
        "NDS": _finite_or_none(result.nds),
    }


def _by_name(names: Iterable[str], values: Iterable[float]) -> dict[str, float | None]:
    return _finite_values(dict(zip(names, values, strict=True)))


def _finite_values(values: Mapping[str, float]) -> dict[str, float | None]:
    return {name: _finite_or_none(value) for name, value in values.items()}


def _finite_or_none(value: float) -> float | None:
    return float(value) if np.isfinite(value) else None
