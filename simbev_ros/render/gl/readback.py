"""Bringing images from OpenGL's memory to NumPy's."""

from collections.abc import Callable, Iterator
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass
from functools import partial
from typing import Protocol

import moderngl
import numpy as np

from simbev_ros.render.gl.pinned_buffer import Fence, PinnedBuffer
from simbev_ros.render.gl.targets import Image
from simbev_ros.types import AnyArray

_THREADS = 8
_CHUNK_BYTES = 4 << 20
"""One thread copies at a fraction of what the memory can do, and an image is there when its last piece is."""


class ReadBack(Protocol):
    """Reads the images of a frame."""

    def begin(self, image: Image) -> AnyArray:
        """Ask for an image as it is now: (H, W[, C]) pixels, row 0 on top, which are there after ``finish``."""
        ...

    def finish(self) -> None:
        """Wait for all images that were asked for."""
        ...


def read_back(context: moderngl.Context, on_gpu: bool) -> ReadBack:
    """What is faster there."""
    return _WhileDrawing(context) if on_gpu else _AtOnce()


class _AtOnce:
    """The CPU's renderer has its images in the same memory."""

    def begin(self, image: Image) -> AnyArray:
        pixels = image.allocate()
        image.read_into(pixels)
        return pixels

    def finish(self) -> None:
        """All is done."""


@dataclass(frozen=True, slots=True)
class _Transfer:
    """An image on its way through a buffer."""

    buffer: PinnedBuffer
    arrived: Fence
    pixels: AnyArray

    def copies(self) -> Iterator[Callable[[], None]]:
        """What is to be done, in pieces."""
        target = self.pixels.reshape(-1).view(np.uint8)
        for start in range(0, len(target), _CHUNK_BYTES):
            piece = slice(start, start + _CHUNK_BYTES)
            yield partial(np.copyto, target[piece], self.buffer.content[piece])


class _WhileDrawing:
    """A GPU writes its images into buffers in the CPU's memory, from where threads copy them, while it goes on drawing.

    The buffers are used again for the next frame. To hand out arrays on them would save the copies, but such memory is
    locked, and whoever kept a few images for long would use it up.
    """

    def __init__(self, context: moderngl.Context) -> None:
        self._context = context
        self._free: dict[int, list[PinnedBuffer]] = {}
        self._travelling: list[_Transfer] = []
        self._copied: list[tuple[PinnedBuffer, list[Future[None]]]] = []
        self._threads = ThreadPoolExecutor(_THREADS, thread_name_prefix="read-back")

    def begin(self, image: Image) -> AnyArray:
        pixels = image.allocate()
        free = self._free.setdefault(pixels.nbytes, [])
        buffer = free.pop() if free else PinnedBuffer(self._context, pixels.nbytes)
        image.read_into(buffer.buffer)
        self._travelling.append(_Transfer(buffer, Fence(), pixels))
        self._copy(lambda fence: fence.is_passed())
        return pixels

    def finish(self) -> None:
        self._copy(lambda fence: fence.wait())
        for buffer, pieces in self._copied:
            for piece in pieces:
                piece.result()
            self._free[len(buffer.content)].append(buffer)
        self._copied.clear()

    def _copy(self, has_arrived: Callable[[Fence], bool]) -> None:
        """Have images copied, in their order, as long as they have arrived."""
        while self._travelling and has_arrived(self._travelling[0].arrived):
            transfer = self._travelling.pop(0)
            self._copied.append((transfer.buffer, [self._threads.submit(copy) for copy in transfer.copies()]))
