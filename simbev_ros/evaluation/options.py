"""What is evaluated, and how."""

import math
from dataclasses import dataclass, field

from simbev_ros.config.evaluation import Evaluation
from simbev_ros.errors import InputError
from simbev_ros.evaluation.filters import BoxFilter
from simbev_ros.evaluation.metrics.detection import DetectionOptions
from simbev_ros.evaluation.slices import Cut, cuts_of
from simbev_ros.semantics import BEV_CLASSES, BOX_CLASSES


@dataclass(frozen=True, slots=True)
class EvaluationOptions:
    """What is evaluated.

    Attributes:
        cuts: Rows of tables, the first of all that counts; ``cuts.cuts_of`` makes them.
        detection: How boxes are matched.
        box_classes: Of ``BOX_CLASSES``; the others are in no figure.
        bev_classes: Of ``BEV_CLASSES``.
        every: Only each so many-th frame of a scene.
        nuscenes: nuScenes' own metrics, too.
    """

    cuts: tuple[Cut, ...] = (Cut(),)
    detection: DetectionOptions = field(default_factory=DetectionOptions)
    box_classes: tuple[str, ...] = BOX_CLASSES
    bev_classes: tuple[str, ...] = BEV_CLASSES
    every: int = 1
    nuscenes: bool = False

    def __post_init__(self) -> None:
        """Raise InputError for classes that there are not."""
        for name, known in (("box_classes", BOX_CLASSES), ("bev_classes", BEV_CLASSES)):
            strange = [each for each in getattr(self, name) if each not in known]
            if strange:
                raise InputError(f"{name}: there is no {strange[0]!r}; allowed: {', '.join(known)}")


def options_of(section: Evaluation) -> EvaluationOptions:
    """What a configuration wants to be evaluated."""
    boxes = BoxFilter(
        range_m=(0.0, math.inf if section.range_m is None else section.range_m),
        visibility=(section.least_visibility, math.inf),
        points=(section.least_points, math.inf),
    )
    chosen = (*BOX_CLASSES, *BEV_CLASSES) if section.classes is None else section.classes
    return EvaluationOptions(
        cuts=tuple(cuts_of(Cut(boxes=boxes), section.by)),
        box_classes=tuple(name for name in BOX_CLASSES if name in chosen),
        bev_classes=tuple(name for name in BEV_CLASSES if name in chosen),
    )
