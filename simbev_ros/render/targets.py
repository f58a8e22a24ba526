"""What is drawn into: the G-buffer and the images of one size of camera."""

import moderngl
import numpy as np

from simbev_ros.render.programs import TEXTURE_UNITS
from simbev_ros.types import AnyArray

_DTYPES = {"f1": np.uint8, "u1": np.uint8, "u2": np.uint16, "f4": np.float32}


class Targets:
    """Framebuffers of one size. ``geometry`` is drawn first; the others are computed from it."""

    def __init__(self, context: moderngl.Context, size_px: tuple[int, int], visibility_step: int) -> None:
        """Allocate all targets of (width, height) pixels; those of visibility with one texel per ``visibility_step``."""

        def texture(components: int, dtype: str) -> moderngl.Texture:
            result = context.texture(size_px, components, dtype=dtype)
            result.filter = (moderngl.NEAREST, moderngl.NEAREST)
            return result

        self._surface, self._depth, self._color = texture(4, "u4"), texture(1, "f4"), texture(4, "f1")
        self._shaded = texture(4, "f1")
        self._shaded.filter = (moderngl.LINEAR, moderngl.LINEAR)
        self._shaded.repeat_x = self._shaded.repeat_y = False
        coarse_px = (-(-size_px[0] // visibility_step), -(-size_px[1] // visibility_step))
        self._noisy_visibility, self._visibility = (context.texture(coarse_px, 4, dtype="f1") for _ in range(2))
        self.geometry = context.framebuffer(
            [self._surface, self._depth, self._color, texture(1, "u1"), texture(1, "u2"), texture(2, "f4")],
            context.depth_renderbuffer(size_px),
        )
        self.noisy_visibility = context.framebuffer([self._noisy_visibility])
        self.visibility = context.framebuffer([self._visibility])
        self.shaded = context.framebuffer([self._shaded], context.depth_renderbuffer(size_px))
        self.rgb = context.framebuffer([texture(4, "f1")])

    def bind(self) -> None:
        """Make the G-buffer and the shaded image readable by the passes that follow."""
        self._surface.use(TEXTURE_UNITS["g_surface"])
        self._depth.use(TEXTURE_UNITS["g_depth"])
        self._color.use(TEXTURE_UNITS["g_color"])
        self._noisy_visibility.use(TEXTURE_UNITS["noisy_visibility"])
        self._visibility.use(TEXTURE_UNITS["visibility"])
        self._shaded.use(TEXTURE_UNITS["shaded"])


def read_image(framebuffer: moderngl.Framebuffer, attachment: int = 0, components: int | None = None) -> AnyArray:
    """(H, W[, C]) pixels of a colour attachment, row 0 on top; all its components, or the first few."""
    source = framebuffer.color_attachments[attachment]
    width, height = framebuffer.size
    channels = components or source.components
    image = np.empty((height, width) if channels == 1 else (height, width, channels), _DTYPES[source.dtype])
    framebuffer.read_into(image, components=channels, attachment=attachment, dtype=source.dtype)
    return image
