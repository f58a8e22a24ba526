"""Draws the color images of the cameras, and the 2D boxes of what they see and of what is hidden from them."""

import numpy as np
import rerun as rr

from simbev_ros.foundation.semantics import BOX_CLASSES
from simbev_ros.foundation.types import Float64Array, Table, UInt8Array
from simbev_ros.schema.palette import class_color
from simbev_ros.show.rerun.pictures import color_jpeg
from simbev_ros.show.rerun.scene_log import EGO, SceneLog
from simbev_ros.show.rerun.strokes import HAIRLINE, THIN_LINE
from simbev_ros.show.rerun.subject import Samples, Subject

_DASH_SHARE = 1 / 160
"""Length of a dash as a share of the image's width."""
_HIDDEN_OPACITY = 150


class CameraDrawing:
    """Draws one camera.

    2D boxes: solid around the visible pixels of an object, dashed around the silhouette of one that is hidden
    entirely.
    """

    def __init__(self, log: SceneLog, subject: Subject, name: str) -> None:
        self._log, self._name, self._entity = log, name, f"{EGO}/{name}"
        self._step = subject.image_step(name)
        self._width_px = subject.calibration[name].size_px[0] / self._step
        self._colors = np.array([class_color(each) for each in BOX_CLASSES], np.uint8)
        self._has_boxes = False

    def draw(self, samples: Samples) -> None:
        """Log the image and the boxes; those of an earlier image do not fit, and vanish."""
        if (key := f"{self._name}/rgb") in samples:
            data = color_jpeg(samples.messages(key)[-1], self._step, lambda _: samples[key])
            self._log.add(f"{self._entity}/rgb", rr.EncodedImage(contents=data, media_type="image/jpeg"))
            if self._has_boxes and f"{self._name}/boxes" not in samples:
                self._log.add(f"{self._entity}/boxes", rr.Clear(recursive=True))
                self._has_boxes = False
        if (key := f"{self._name}/boxes") in samples:
            views, self._has_boxes = samples[key], True
            hidden = views["visible_px"] == 0
            self._draw_visible(views[~hidden])
            self._draw_hidden(views[hidden])

    def _draw_visible(self, views: Table) -> None:
        corners = np.stack([views[name] for name in ("left", "top", "right", "bottom")], axis=1)
        labels = [
            f"{BOX_CLASSES[label]} {number} · {share:.0%}"
            for label, number, share in zip(
                views["class"].tolist(), views["id"].tolist(), views["visibility"].tolist(), strict=True
            )
        ]
        self._log.add(
            f"{self._entity}/boxes/visible",
            rr.Boxes2D(
                array=(corners + 0.5) / self._step,
                array_format=rr.Box2DFormat.XYXY,
                labels=labels,
                show_labels=False,
                colors=self._colors[views["class"]],
                radii=THIN_LINE,
                draw_order=20.0,
            ),
        )

    def _draw_hidden(self, views: Table) -> None:
        corners = np.stack([views[f"amodal_{name}"] for name in ("left", "top", "right", "bottom")], axis=1)
        dashes, row = dashed_boxes((corners + 0.5) / self._step, self._width_px * _DASH_SHARE)
        colors = _faded(self._colors[views["class"]])[row]
        self._log.add(
            f"{self._entity}/boxes/hidden",
            rr.LineStrips2D(dashes.astype(np.float32), colors=colors, radii=HAIRLINE, draw_order=19.0),
        )


def dashed_boxes(corners_px: Float64Array, dash_px: float) -> tuple[Float64Array, Table]:
    """Dashes of about equal length, with gaps as long, along the borders of boxes.

    Args:
        corners_px: (N, 4) left, top, right, bottom.
        dash_px: Length of a dash.

    Returns:
        (D, 2, 2) x and y of both ends of each dash, and (D,) the box that it belongs to.
    """
    dashes, rows = [np.zeros((0, 2, 2))], [np.zeros(0, np.int64)]
    for row, (left, top, right, bottom) in enumerate(corners_px):
        for start, end in (
            ((left, top), (right, top)),
            ((right, top), (right, bottom)),
            ((right, bottom), (left, bottom)),
            ((left, bottom), (left, top)),
        ):
            begin, step = np.array(start), np.subtract(end, start)
            count = max(1, round(float(np.abs(step).max()) / (2 * dash_px)))
            share = (2 * np.arange(count)[:, None] + np.array([0.0, 1.0])) / (2 * count - 1)
            dashes.append(begin + share[..., None] * step)
            rows.append(np.full(count, row))
    return np.concatenate(dashes), np.concatenate(rows)


def _faded(colors: UInt8Array) -> UInt8Array:
    """(N, 4) translucent colors."""
    return np.concatenate([colors, np.full((len(colors), 1), _HIDDEN_OPACITY, np.uint8)], axis=1)
