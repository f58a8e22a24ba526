"""Bringing images from OpenGL's memory to NumPy's."""

from collections.abc import Callable
from functools import partial
from typing import Any

import moderngl
import numpy as np

from simbev_ros.render.targets import Image
from simbev_ros.types import AnyArray


class ReadBack:
    """Reads images: from the CPU's renderer at once; from a GPU while it goes on drawing, all of a frame together."""

    def __init__(self, context: moderngl.Context, on_gpu: bool) -> None:
        self._context = context
        self._on_gpu = on_gpu
        self._free: dict[int, list[moderngl.Buffer]] = {}

    def begin(self, image: Image) -> Callable[[], AnyArray]:
        """Ask for an image as it is now; what is returned waits for it and gives (H, W[, C]) pixels, row 0 on top."""
        pixels = image.allocate()
        if not self._on_gpu:
            image.read_into(pixels)
            return lambda: pixels
        free = self._free.setdefault(pixels.nbytes, [])
        buffer = free.pop() if free else self._context.buffer(reserve=pixels.nbytes, dynamic=True)
        image.read_into(buffer)
        return partial(self._finish, buffer, pixels)

    def _finish(self, buffer: moderngl.Buffer, pixels: AnyArray) -> AnyArray:
        target: Any = pixels.reshape(-1).view(np.uint8)
        buffer.read_into(target)
        self._free[pixels.nbytes].append(buffer)
        return pixels
