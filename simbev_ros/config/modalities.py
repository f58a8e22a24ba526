"""The modalities of cameras: one table of how their images are stored, sent and made.

Configuration, topics, codecs, renderer and viewers take what they need from here; docs/extending/modality.md adds one.
"""

from collections.abc import Mapping
from types import MappingProxyType
from typing import Final, Literal, NamedTuple, get_args

Modality = Literal["rgb", "semantic", "instance", "depth", "flow", "raw"]


class ImageKind(NamedTuple):
    """Row of the table: the images of a modality.

    Attributes:
        title: Heading of its pictures.
        dtype: numpy's name of the type of a value.
        channels: Number of values per pixel.
        encoding: ROS encoding of its raw images; ``recording.image_codecs`` has a codec for each one.
        transport: Last part of the name of its compressed topic, as in image_transport.
        shader: Fragment shader that computes it from the depth at a camera's pixels, in ``simulation/render/shaders``;
            None: the renderer draws it with the geometry.
        of_imager: Whether it is made with the color image, by a camera's imager.
    """

    title: str
    dtype: str
    channels: int
    encoding: str
    transport: str = "compressed"
    shader: str | None = None
    of_imager: bool = False

    @property
    def texel(self) -> tuple[int, str]:
        """Number of components and type of an OpenGL texture that holds it."""
        return self.channels, {"uint8": "u1", "uint16": "u2", "float32": "f4"}[self.dtype]


_ROWS: dict[Modality, ImageKind] = {
    "rgb": ImageKind("RGB", "uint8", 3, "rgb8"),
    "semantic": ImageKind("Semantic", "uint8", 1, "mono8"),
    "instance": ImageKind("Instance", "uint16", 1, "mono16"),
    "depth": ImageKind("Depth", "float32", 1, "32FC1", "compressedDepth"),
    "flow": ImageKind("Optical flow", "float32", 2, "32FC2"),
    "raw": ImageKind("Raw", "uint8", 1, "bayer_rggb8", of_imager=True),
}
IMAGE_KINDS: Mapping[str, ImageKind] = MappingProxyType({name: _ROWS[name] for name in get_args(Modality)})
"""The table, in the order of ``Modality``."""
MODALITIES: Final[tuple[Modality, ...]] = tuple(name for name in get_args(Modality) if not _ROWS[name].of_imager)
"""Modalities of every camera that names none."""
