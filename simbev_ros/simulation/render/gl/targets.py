"""Render targets of one image size: the G-buffer and the images computed from it."""

from collections.abc import Mapping
from dataclasses import dataclass

import moderngl
import numpy as np

from simbev_ros.config.modalities import IMAGE_KINDS, Modality
from simbev_ros.foundation.types import AnyArray, UInt32Array
from simbev_ros.simulation.render.gl.programs import TEXTURE_UNITS

_LABELS: tuple[Modality, ...] = ("semantic", "instance", "flow")
"""Modalities that are drawn with the geometry, in the order of the outputs in shaders/include/g_buffer.glsl."""
_DTYPES = {"f1": np.uint8, "u1": np.uint8, "u2": np.uint16, "f4": np.float32}


@dataclass(frozen=True, slots=True)
class Image:
    """A color attachment, of which all or the first few components are used."""

    framebuffer: moderngl.Framebuffer
    attachment: int
    components: int | None = None

    def allocate(self) -> AnyArray:
        """An array for its pixels, (H, W[, C])."""
        width, height = self.framebuffer.size
        shape = (height, width) if self._channels == 1 else (height, width, self._channels)
        return np.empty(shape, _DTYPES[self.texture.dtype])

    def read_into(self, destination: AnyArray | moderngl.Buffer) -> None:
        """Write the pixels to an array or a buffer, row 0 on top."""
        self.framebuffer.read_into(
            destination, components=self._channels, attachment=self.attachment, dtype=self.texture.dtype
        )

    @property
    def texture(self) -> moderngl.Texture:
        """The texture that holds it."""
        source = self.framebuffer.color_attachments[self.attachment]
        assert isinstance(source, moderngl.Texture)
        return source

    @property
    def _channels(self) -> int:
        return self.components or self.texture.components


class Targets:
    """Framebuffers of one image size. ``geometry`` is drawn first; the others are computed from it.

    Surfaces are shaded into ``surfaces`` and anti-aliased into ``smoothed``. At full resolution these are ``shaded``
    and ``rgb``; at reduced resolution they are separate, smaller framebuffers.
    """

    def __init__(
        self, context: moderngl.Context, size_px: tuple[int, int], steps: Mapping[str, int], for_lens: bool = False
    ) -> None:
        """Allocate all targets.

        Args:
            context: OpenGL context.
            size_px: Width, height.
            steps: From ``quality_steps``: pixels per texel of the shaded image and of the visibility.
            for_lens: Also store the geometry that lens distortion needs (render/lens.py).
        """

        def texture(components: int, dtype: str) -> moderngl.Texture:
            result = context.texture(size_px, components, dtype=dtype)
            result.filter = (moderngl.NEAREST, moderngl.NEAREST)
            return result

        self._surface, self._depth, self._color = texture(4, "u4"), texture(1, "f4"), texture(4, "f1")

        def smooth_texture(size_px: tuple[int, int]) -> moderngl.Texture:
            result = context.texture(size_px, 4, dtype="f1")
            result.repeat_x = result.repeat_y = False
            return result

        self._shaded = smooth_texture(size_px)
        shading_px, visibility_px = (
            (-(-size_px[0] // step), -(-size_px[1] // step))
            for step in (steps["SHADING_STEP"], steps["VISIBILITY_STEP"])
        )
        self._coarse = [smooth_texture(shading_px) for _ in range(2)] if shading_px != size_px else []
        self._noisy_visibility, self._visibility = (context.texture(visibility_px, 4, dtype="f1") for _ in range(2))
        self._lens = {"g_slope": texture(2, "f4"), "g_edges": texture(4, "u4")} if for_lens else {}
        images = [texture(*IMAGE_KINDS[modality].texel) for modality in _LABELS]
        self.geometry = context.framebuffer(
            [self._surface, self._depth, self._color, *images, *self._lens.values()],
            context.depth_renderbuffer(size_px),
        )
        self.noisy_visibility = context.framebuffer([self._noisy_visibility])
        self.visibility = context.framebuffer([self._visibility])
        self.shaded = context.framebuffer([self._shaded], context.depth_renderbuffer(size_px))
        self.rgb = context.framebuffer([texture(4, "f1")])
        self.surfaces, self.smoothed = self.shaded, self.rgb
        if self._coarse:
            self.surfaces = context.framebuffer(self._coarse[:1], context.depth_renderbuffer(shading_px))
            self.smoothed = context.framebuffer(self._coarse[1:])

    def clear_depth(self) -> None:
        """Clear the depth of ``geometry``; its color attachments are written at every pixel anyway."""
        count = len(self.geometry.color_attachments)
        self.geometry.color_mask = ((False,) * 4,) * count  # type: ignore[assignment]
        self.geometry.clear()
        self.geometry.color_mask = ((True,) * 4,) * count  # type: ignore[assignment]

    def read_class_flags(self) -> UInt32Array:
        """(H, W) uint32 colors of the G-buffer with the flags of shading classes; class k is bit 24 + k."""
        width, height = self.geometry.size
        colors = np.empty((height, width), np.uint32)
        self.geometry.read_into(colors, components=4, attachment=2)
        return colors

    def bind(self) -> None:
        """Bind the G-buffer and the shaded image for the passes that follow."""
        self._surface.use(TEXTURE_UNITS["g_surface"])
        self._depth.use(TEXTURE_UNITS["g_depth"])
        self._color.use(TEXTURE_UNITS["g_color"])
        self._noisy_visibility.use(TEXTURE_UNITS["noisy_visibility"])
        self._visibility.use(TEXTURE_UNITS["visibility"])
        self._shaded.use(TEXTURE_UNITS["shaded"])
        for name, coarse in zip(("coarse_shaded", "coarse_rgb"), self._coarse, strict=False):
            coarse.use(TEXTURE_UNITS[name])
        for name, texture in self._lens.items():
            texture.use(TEXTURE_UNITS[name])

    @property
    def rgb_texture(self) -> moderngl.Texture:
        """The texture of ``rgb``."""
        return self.images["rgb"].texture

    @property
    def images(self) -> dict[Modality, Image]:
        """Attachment of each modality, valid after drawing."""
        attachments: dict[Modality, int] = {"depth": 1, **{name: index for index, name in enumerate(_LABELS, start=3)}}
        images = {modality: Image(self.geometry, index) for modality, index in attachments.items()}
        return {**images, "rgb": Image(self.rgb, 0, components=3)}
