"""Draws the bird's-eye view: all classes in one picture, each class as a layer, and predictions next to the truth."""

import numpy as np
import rerun as rr

from simbev_ros.evaluation.predictions.prediction_messages import image_scores, occupancy_scores
from simbev_ros.foundation.semantics import BEV_CLASSES
from simbev_ros.foundation.types import AnyArray, Float64Array, UInt16Array
from simbev_ros.recording.png import RowFilter, encode_png
from simbev_ros.scene.frames import ego_size_m
from simbev_ros.schema.palette import bev_color, class_color
from simbev_ros.schema.scene.agents import AgentView
from simbev_ros.show.rerun.pictures import mask_picture
from simbev_ros.show.rerun.scene_log import SceneLog
from simbev_ros.show.rerun.strokes import LINE
from simbev_ros.show.rerun.subject import Samples

TRUTH, PREDICTION = "bev/truth", "bev/prediction"
_MIN_SCORE = 0.5
_EGO_COLOR = (255, 196, 60)


class GroundDrawing:
    """Draws the grid of the truth, and that of a perception stack."""

    def __init__(self, log: SceneLog, view: AgentView) -> None:
        self._log = log
        outline = ego_outline_px(view)
        for entity in (TRUTH, PREDICTION):
            log.add_static(f"{entity}/ego", rr.LineStrips2D([outline], colors=_EGO_COLOR, radii=LINE, draw_order=50.0))

    def draw(self, samples: Samples) -> None:
        """Log the grids.

        Raises:
            InputError: The message of a perception stack holds no valid scores.
        """
        if "bev/labels" in samples:
            self._draw_grid(TRUTH, samples["bev/labels"])
        scores = predicted_scores(samples)
        if scores:
            self._draw_grid(PREDICTION, labels_of_scores(scores))

    def _draw_grid(self, entity: str, labels: UInt16Array) -> None:
        png = encode_png(bev_color(labels), RowFilter.NONE)
        self._log.add(f"{entity}/all", rr.EncodedImage(contents=png, media_type="image/png", draw_order=-1.0))
        for bit, name in enumerate(BEV_CLASSES):
            mask = (labels >> bit & 1).astype(np.bool_)
            picture = mask_picture(mask, class_color(name))
            self._log.add(
                f"{entity}/classes/{name}",
                rr.EncodedImage(contents=picture, media_type="image/png", draw_order=float(bit)),
            )


def ego_outline_px(view: AgentView) -> Float64Array:
    """(7, 2) x and y in the picture of the ego's outline, with a line from its center to its front."""
    length_m, width_m, _ = ego_size_m(view)
    front, left = length_m / 2.0, width_m / 2.0
    corners_m = np.array(
        [(0, 0), (front, 0), (front, left), (-front, left), (-front, -left), (front, -left), (front, 0)]
    )
    return np.asarray(view.annotation.bev.grid.cells_from_ego(corners_m)[:, ::-1] + 0.5)


def predicted_scores(samples: Samples) -> dict[str, AnyArray]:
    """(H, W) scores by class that a perception stack published at a tick; uint8, where 255 is 1, or float32.

    Raises:
        InputError: A message holds no valid scores.
    """
    if "prediction/bev" in samples:
        layers = image_scores(samples.messages("prediction/bev")[-1], "/prediction/bev")
        return dict(zip(BEV_CLASSES, layers, strict=True))
    keys = {name: f"prediction/bev/{name}" for name in BEV_CLASSES}
    return {
        name: occupancy_scores(samples.messages(key)[-1], f"/{key}") for name, key in keys.items() if key in samples
    }


def labels_of_scores(scores: dict[str, AnyArray]) -> UInt16Array:
    """(H, W) uint16 grid with bit k set where the score of class k is at least one half."""
    labels = np.zeros(next(iter(scores.values())).shape, np.uint16)
    for name, layer in scores.items():
        full = np.iinfo(layer.dtype).max if layer.dtype.kind == "u" else 1.0
        labels |= (layer >= _MIN_SCORE * full).astype(np.uint16) << np.uint16(BEV_CLASSES.index(name))
    return labels
