"""What depends on the modality of a camera covers every row of their table."""

from dataclasses import fields

import numpy as np
import pytest

from simbev_ros.config.modalities import IMAGE_KINDS
from simbev_ros.drawing.panels import MODALITY_PICTURES
from simbev_ros.recording.image_codecs import compressed_format, decode_image, encode_image
from simbev_ros.simulation.render.frame import CameraImages


def test_every_modality_is_an_image_of_the_renderer() -> None:
    assert {field.name for field in fields(CameraImages)} == set(IMAGE_KINDS)


def test_every_modality_but_rgb_has_a_picture() -> None:
    assert set(MODALITY_PICTURES) == set(IMAGE_KINDS) - {"rgb"}


@pytest.mark.parametrize("modality", IMAGE_KINDS)
def test_images_of_a_modality_keep_their_type_and_shape_when_compressed(modality: str) -> None:
    kind = IMAGE_KINDS[modality]
    shape = (6, 8) if kind.channels == 1 else (6, 8, kind.channels)
    image = np.full(shape, 3, kind.dtype)
    decoded = decode_image(compressed_format(kind.encoding), encode_image(kind.encoding, image))
    assert (decoded.dtype, decoded.shape) == (image.dtype, image.shape)
    assert decoded == pytest.approx(image, abs=0.01 if kind.dtype == "float32" else 2)
