"""Describes for the head of an evaluation report what was evaluated and how, with the main figures.

Figures and ``EvaluationOptions`` enter; text and HTML leave.
"""

from collections.abc import Iterator

import numpy as np

from simbev_ros.evaluation.conditions import DAYTIMES, WEATHERS
from simbev_ros.evaluation.options import EvaluationOptions
from simbev_ros.evaluation.slices import TableSlice
from simbev_ros.evaluation.tables import METHOD_NAMES, Figures, at_table_threshold, text_of
from simbev_ros.foundation.semantics import BEV_CLASSES, BOX_CLASSES, DIFFICULTIES
from simbev_ros.show.pages.web_page import facts as fact_list
from simbev_ros.show.reports.page import words
from simbev_ros.show.reports.svg_drawing import number


def headline(figures: Figures) -> Iterator[tuple[str, str]]:
    """The main figures of an evaluation: their values as text, and their labels."""
    detection, frames = figures.get("detection", {}), figures["frames"]
    for method, name in METHOD_NAMES.items():
        if method in detection:
            yield text_of(detection[method]["mAP"]), f"mAP, {name}"
            yield text_of(detection[method]["SDS"]), f"SDS, {name}"
    if "segmentation" in figures:
        yield text_of(at_table_threshold(figures["segmentation"]["mean_IoU_at"])), "mean IoU of cells"
    yield number(frames["evaluated"]), "frames"
    yield number(frames["scenes"]), "scenes"
    if detection:
        yield number(detection["boxes"]), "boxes"


def facts(figures: Figures, options: EvaluationOptions) -> str:
    """Source of the data, conditions on what counts, and the method of measurement, as an HTML list."""
    return fact_list(_facts(figures, options), "rows")


def _facts(figures: Figures, options: EvaluationOptions) -> Iterator[tuple[str, str]]:
    yield "predictions", str(figures["predictions"])
    yield "dataset", str(figures["dataset"])
    frames = figures["frames"]
    answered = [f"{frames[f'answered_{what}']:,} with {what}" for what in ("boxes", "grids")]
    yield "frames", f"{frames['evaluated']:,} evaluated; answered: {', '.join(answered)}"
    yield "counted", "; ".join(_counted(options.slices[0], options)) or "all boxes, cells and frames"
    if "detection" in figures:
        yield "measured", "; ".join(_measured(options))


def _counted(base: TableSlice, options: EvaluationOptions) -> Iterator[str]:
    """The conditions that exclude some boxes, cells or frames, as text."""
    if options.every > 1:
        yield f"every {options.every}th frame of each scene"
    for what, chosen, known in (
        ("boxes of", options.box_classes, BOX_CLASSES),
        ("cells of", options.bev_classes, BEV_CLASSES),
        ("difficulty", base.boxes.difficulties, DIFFICULTIES),
        ("daytime", base.daytimes, DAYTIMES),
        ("weather", base.weathers, WEATHERS),
    ):
        if set(chosen) != set(known):
            yield f"{what} {', '.join(map(words, chosen))}"
    for what, span, unit in (
        ("distance", base.boxes.range_m, " m"),
        ("visibility", base.boxes.visibility, ""),
        ("points", base.boxes.points, ""),
    ):
        if span != (0, np.inf):
            yield f"{what} from {span[0]:g}{unit}" + (f" to {span[1]:g}{unit}" if np.isfinite(span[1]) else "")


def _measured(options: EvaluationOptions) -> Iterator[str]:
    detection = options.detection
    if detection.ious:
        yield f"3D IoU above {', '.join(f'{each:g}' for each in detection.ious)}"
    if detection.distances_m:
        yield f"centers closer than {', '.join(f'{each:g}' for each in detection.distances_m)} m"
    yield "distances and velocities " + ("in the plane" if detection.planar else "in space")
    envelope = "the envelope of precision over recall, as Pascal VOC"
    yield "area under " + (envelope if detection.area == "envelope" else "precision over recall, in steps")
