"""Pictures of the images that no viewer can color by itself: semantics, instances, depth and optical flow."""

import numpy as np

from simbev_ros.drawing.displays.messages import COMPRESSED_IMAGE, build, serialize, stamped
from simbev_ros.drawing.panels import MODALITY_PICTURES
from simbev_ros.foundation.types import AnyArray, UInt8Array
from simbev_ros.recording.image_codecs import compressed_format, encode_rgb

_QUALITY = 85


def color_picture(modality: str, image: AnyArray) -> UInt8Array:
    """(H, W, 3) picture with the colors that ``simbev preview`` uses, as large as the image.

    Args:
        modality: A key of ``MODALITY_PICTURES``.
        image: The image as the camera takes it.
    """
    return MODALITY_PICTURES[modality].picture(image, None, image.shape[1])


def compressed_picture(picture: UInt8Array, stamp_ns: int, frame: str) -> bytes:
    """CompressedImage (JPEG) of an (H, W, 3) picture, RGB."""
    data = np.frombuffer(encode_rgb(picture, _QUALITY), np.uint8)
    header = stamped(stamp_ns, frame)
    return serialize(build(COMPRESSED_IMAGE, header=header, format=compressed_format("rgb8"), data=data))
