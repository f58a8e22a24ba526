"""What is drawn into: the G-buffer and the images of one size of camera."""

import moderngl
import numpy as np

from simbev_ros.render.programs import TEXTURE_UNITS
from simbev_ros.types import AnyArray

_DTYPES = {"f1": np.uint8, "u1": np.uint8, "u2": np.uint16, "f4": np.float32}


class Targets:
    """Framebuffers of one size. ``geometry`` is drawn first; the others are computed from it."""

    def __init__(self, context: moderngl.Context, size_px: tuple[int, int]) -> None:
        """Allocate all targets of (width, height) pixels."""

        def texture(components: int, dtype: str) -> moderngl.Texture:
            result = context.texture(size_px, components, dtype=dtype)
            result.filter = (moderngl.NEAREST, moderngl.NEAREST)
            return result

        self._surface, self._depth, self._color = texture(4, "u4"), texture(1, "f4"), texture(4, "f1")
        self._shaded = texture(4, "f1")
        self._shaded.filter = (moderngl.LINEAR, moderngl.LINEAR)
        self._shaded.repeat_x = self._shaded.repeat_y = False
        half_px = (-(-size_px[0] // 2), -(-size_px[1] // 2))
        self._occlusion = context.texture(half_px, 2, dtype="f2")
        self._occlusion.repeat_x = self._occlusion.repeat_y = False
        self.geometry = context.framebuffer(
            [self._surface, self._depth, self._color], context.depth_renderbuffer(size_px)
        )
        self.labels = context.framebuffer([texture(1, "u1"), texture(1, "u2")])
        self.flow = context.framebuffer([texture(2, "f4")])
        self.occlusion = context.framebuffer([self._occlusion])
        self.shaded = context.framebuffer([self._shaded], context.depth_renderbuffer(size_px))
        self.rgb = context.framebuffer([texture(4, "f1")])

    def bind(self) -> None:
        """Make the G-buffer and the shaded image readable by the passes that follow."""
        self._surface.use(TEXTURE_UNITS["g_surface"])
        self._depth.use(TEXTURE_UNITS["g_depth"])
        self._color.use(TEXTURE_UNITS["g_color"])
        self._occlusion.use(TEXTURE_UNITS["occlusion"])
        self._shaded.use(TEXTURE_UNITS["shaded"])


def read_image(framebuffer: moderngl.Framebuffer, attachment: int = 0, components: int | None = None) -> AnyArray:
    """(H, W[, C]) pixels of a colour attachment, row 0 on top; all its components, or the first few."""
    source = framebuffer.color_attachments[attachment]
    width, height = framebuffer.size
    channels = components or source.components
    image = np.empty((height, width) if channels == 1 else (height, width, channels), _DTYPES[source.dtype])
    framebuffer.read_into(image, components=channels, attachment=attachment, dtype=source.dtype)
    return image
