"""Draws the other modalities of the cameras: semantic tags, instances, depth and optical flow."""

from collections.abc import Callable, Mapping
from functools import partial

import numpy as np
import rerun as rr

from simbev_ros.drawing.displays.pictures import color_picture
from simbev_ros.drawing.panels import MAX_DEPTH_M, MIN_DEPTH_M, MODALITY_PICTURES
from simbev_ros.foundation.types import AnyArray
from simbev_ros.recording.image_codecs import encode_labels, encode_rgb
from simbev_ros.recording.png import RowFilter, encode_png
from simbev_ros.schema.palette import semantic_color
from simbev_ros.show.rerun.pictures import every_pixel, with_palette
from simbev_ros.show.rerun.scene_log import EGO, SceneLog
from simbev_ros.show.rerun.subject import Samples, Subject

_DEPTH_UNITS_PER_M = 100
_MAX_DEPTH_UNITS = np.iinfo(np.uint16).max


def _semantic(tags: AnyArray) -> rr.EncodedImage:
    png = with_palette(encode_labels(tags), semantic_color(np.arange(256, dtype=np.uint8)))
    return rr.EncodedImage(contents=png, media_type="image/png")


def _picture(modality: str, image: AnyArray) -> rr.EncodedImage:
    """The picture that ``simbev preview`` draws, without loss."""
    png = encode_png(color_picture(modality, image), RowFilter.NONE)
    return rr.EncodedImage(contents=png, media_type="image/png")


def _depth(depth_m: AnyArray) -> rr.EncodedDepthImage:
    units = np.where(np.isfinite(depth_m), depth_m * _DEPTH_UNITS_PER_M, 0).clip(0, _MAX_DEPTH_UNITS)
    return rr.EncodedDepthImage(
        encode_png(units.astype(np.uint16), RowFilter.UP),
        media_type="image/png",
        meter=_DEPTH_UNITS_PER_M,
        colormap="Turbo",
        depth_range=[MIN_DEPTH_M * _DEPTH_UNITS_PER_M, MAX_DEPTH_M / 2 * _DEPTH_UNITS_PER_M],
    )


def _flow(flow_px: AnyArray) -> rr.EncodedImage:
    return rr.EncodedImage(contents=encode_rgb(color_picture("flow", flow_px)), media_type="image/jpeg")


_Layer = Callable[[AnyArray], rr.EncodedImage | rr.EncodedDepthImage]
_OWN: Mapping[str, _Layer] = {"semantic": _semantic, "depth": _depth, "flow": _flow}
"""Modalities for which Rerun has a form of its own, or a smaller one."""
LAYERS: Mapping[str, _Layer] = {
    modality: _OWN.get(modality, partial(_picture, modality)) for modality in MODALITY_PICTURES
}
"""Functions that make the picture of a modality, by the modality's name."""


class LayerDrawing:
    """Draws one modality of one camera."""

    def __init__(self, log: SceneLog, subject: Subject, camera: str, modality: str) -> None:
        self._log, self._key, self._picture = log, f"{camera}/{modality}", LAYERS[modality]
        self._step = subject.image_step(camera)

    def draw(self, samples: Samples) -> None:
        """Log the picture."""
        if self._key in samples:
            self._log.add(f"{EGO}/{self._key}", self._picture(every_pixel(samples[self._key], self._step)))
