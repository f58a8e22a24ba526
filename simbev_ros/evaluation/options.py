"""Options of an evaluation: which frames, boxes and classes count, and how boxes are matched.

The command line and the ``evaluation`` section of a configuration are converted to ``EvaluationOptions``.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, field

from simbev_ros.config.evaluation import Evaluation, Truth
from simbev_ros.evaluation.filters import BoxFilter
from simbev_ros.evaluation.metrics.detection import DetectionOptions
from simbev_ros.evaluation.slices import TableSlice, table_slices
from simbev_ros.foundation.errors import InputError
from simbev_ros.foundation.semantics import BEV_CLASSES, BOX_CLASSES


@dataclass(frozen=True, slots=True)
class EvaluationOptions:
    """Options of one evaluation.

    Attributes:
        slices: Rows of the tables; the first one contains everything that counts. ``slices.table_slices`` makes them.
        detection: How boxes are matched.
        box_classes: Classes of ``BOX_CLASSES`` to evaluate; metrics omit the others.
        bev_classes: Classes of ``BEV_CLASSES`` to evaluate; metrics omit the others.
        every: Evaluate every Nth frame of a scene.
        nuscenes: Whether to compute the nuScenes metrics in addition.
        truth: Ground truth that counts: the agent's own, or that of all agents.
    """

    slices: tuple[TableSlice, ...] = (TableSlice(),)
    detection: DetectionOptions = field(default_factory=DetectionOptions)
    box_classes: tuple[str, ...] = BOX_CLASSES
    bev_classes: tuple[str, ...] = BEV_CLASSES
    every: int = 1
    nuscenes: bool = False
    truth: Truth = "own"

    def __post_init__(self) -> None:
        """Raise InputError for unknown classes, or for nuScenes metrics against the joint truth."""
        if self.nuscenes and self.truth != "own":
            raise InputError("nuscenes: these metrics are for the truth of one agent, not for the joint one")
        for name, known in (("box_classes", BOX_CLASSES), ("bev_classes", BEV_CLASSES)):
            unknown = [each for each in getattr(self, name) if each not in known]
            if unknown:
                raise InputError(f"{name}: there is no {unknown[0]!r}; allowed: {', '.join(known)}")


def options_of(
    section: Evaluation, *, maps: Sequence[str] = (), every: int = 1, nuscenes: bool = False
) -> EvaluationOptions:
    """Options that the ``evaluation`` section of a configuration asks for.

    Args:
        section: The section.
        maps: Maps of the scenes, for the table by map.
        every: Evaluate every Nth frame of a scene.
        nuscenes: Whether to compute the nuScenes metrics in addition.
    """
    boxes = BoxFilter(
        range_m=(section.min_range_m, math.inf if section.range_m is None else section.range_m),
        visibility=(section.min_visibility, math.inf),
        points=(section.min_points, math.inf),
        difficulties=section.difficulties,
        seen=section.seen,
    )
    counted = TableSlice(
        boxes=boxes,
        daytimes=section.daytimes,
        weathers=section.weathers,
        maps=tuple(maps) if "map" in section.by else (),
    )
    chosen = (*BOX_CLASSES, *BEV_CLASSES) if section.classes == "all" else section.classes
    return EvaluationOptions(
        slices=tuple(table_slices(counted, section.by, section.rings_m)),
        detection=DetectionOptions(
            section.ious, section.distances_m, section.planar, "envelope" if section.envelope else "steps"
        ),
        box_classes=tuple(name for name in BOX_CLASSES if name in chosen),
        bev_classes=tuple(name for name in BEV_CLASSES if name in chosen),
        every=every,
        nuscenes=nuscenes,
        truth=section.truth,
    )
