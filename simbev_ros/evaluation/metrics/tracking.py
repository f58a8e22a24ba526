"""All tracking metrics by class: those of nuScenes (``clear_mot``), and HOTA of the tracks that these accept."""

from collections.abc import Mapping, Sequence
from dataclasses import astuple, dataclass

import numpy as np

from simbev_ros.evaluation.metrics.averages import mean_ignoring_nan
from simbev_ros.evaluation.metrics.clear_mot import clear_mot
from simbev_ros.evaluation.metrics.hota import hota
from simbev_ros.evaluation.metrics.tracks import SceneTracks, class_tracks
from simbev_ros.foundation.semantics import BOX_CLASSES

METRICS: tuple[str, ...] = (
    *("AMOTA", "AMOTP", "MOTA", "MOTP", "recall", "IDS", "FRAG", "score"),
    *("HOTA", "DetA", "AssA", "AssPr", "AssRe"),
)
"""Names of the metrics; IDS and FRAG are numbers, AMOTP and MOTP are in m, and ``score`` is the one of a track at which
MOTA and the metrics after it are measured."""
COUNTS: tuple[str, ...] = ("IDS", "FRAG")


@dataclass(frozen=True, slots=True)
class ClassTracking:
    """Metrics of one class.

    Attributes:
        boxes: Number of ground-truth boxes.
        objects: Number of objects that they belong to.
        values: Value of each metric of ``METRICS``; NaN: undefined.
    """

    boxes: int
    objects: int
    values: Mapping[str, float]


@dataclass(frozen=True, slots=True)
class TrackingResult:
    """Metrics of the classes that have ground truth, by name."""

    classes: Mapping[str, ClassTracking]

    def totals(self) -> dict[str, float]:
        """Means of the metrics over the classes, and sums of ``COUNTS``; NaN: undefined for all of them."""
        columns = {name: np.array([each.values[name] for each in self.classes.values()]) for name in METRICS}
        columns.pop("score")
        return {
            name: float(np.nansum(values) if name in COUNTS else mean_ignoring_nan(values))
            for name, values in columns.items()
        }


def tracking_result(scenes: Sequence[SceneTracks]) -> TrackingResult:
    """Metrics over all scenes."""
    scenes = [each for each in scenes if len(each.truth) or len(each.predictions)]
    labels = np.unique(np.concatenate([np.zeros(0, np.uint8), *(each.truth["label"] for each in scenes)])).tolist()
    return TrackingResult({BOX_CLASSES[label]: _class_tracking(scenes, label) for label in labels})


def _class_tracking(scenes: Sequence[SceneTracks], label: int) -> ClassTracking:
    tracks = [class_tracks(each, label) for each in scenes]
    mot = clear_mot(tracks)
    min_score = -np.inf if np.isnan(mot.min_score) else mot.min_score
    accepted = hota([each.above(min_score) for each in tracks])
    return ClassTracking(
        boxes=sum(len(each.object) for each in tracks),
        objects=sum(len(np.unique(each.object)) for each in tracks),
        values=dict(zip(METRICS, (*astuple(mot), *astuple(accepted)), strict=True)),
    )
