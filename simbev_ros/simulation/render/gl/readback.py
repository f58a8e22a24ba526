"""Reads images back from OpenGL's memory into NumPy arrays."""

from collections.abc import Callable, Iterator
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass
from functools import partial
from typing import Protocol

import moderngl
import numpy as np

from simbev_ros.foundation.types import AnyArray
from simbev_ros.simulation.render.gl.pinned_buffer import Fence, PinnedBuffer
from simbev_ros.simulation.render.gl.targets import Image

_THREADS = 8
_CHUNK_BYTES = 4 << 20
"""Size of a copy task: a single thread reaches only a fraction of the memory bandwidth, so images are split."""


class ReadBack(Protocol):
    """Reads back the images of a frame."""

    def begin(self, image: Image) -> AnyArray:
        """Start reading an image in its current state: (H, W[, C]) pixels, row 0 on top, valid after ``finish``."""
        ...

    def finish(self) -> None:
        """Wait until all started images are complete."""
        ...


def create_read_back(context: moderngl.Context, on_gpu: bool) -> ReadBack:
    """The faster kind of read-back for the CPU's or a GPU's renderer."""
    return _OverlappedReadBack(context) if on_gpu else _ImmediateReadBack()


class _ImmediateReadBack:
    """Read-back for the CPU renderer: its images are already in CPU memory."""

    def begin(self, image: Image) -> AnyArray:
        pixels = image.allocate()
        image.read_into(pixels)
        return pixels

    def finish(self) -> None:
        """Do nothing: ``begin`` has already copied everything."""


@dataclass(frozen=True, slots=True)
class _Transfer:
    """An image being transferred through a buffer."""

    buffer: PinnedBuffer
    arrived: Fence
    pixels: AnyArray

    def copy_tasks(self) -> Iterator[Callable[[], None]]:
        """The remaining copies, in pieces."""
        target = self.pixels.reshape(-1).view(np.uint8)
        for start in range(0, len(target), _CHUNK_BYTES):
            piece = slice(start, start + _CHUNK_BYTES)
            yield partial(np.copyto, target[piece], self.buffer.content[piece])


class _OverlappedReadBack:
    """Read-back that overlaps with drawing: the GPU writes images into buffers in CPU memory, and threads copy them.

    The buffers are reused for the next frame. Handing out arrays that share their memory would save the copies, but
    such memory is locked, and a caller that keeps a few images for long would exhaust it.
    """

    def __init__(self, context: moderngl.Context) -> None:
        self._context = context
        self._free: dict[int, list[PinnedBuffer]] = {}
        self._in_flight: list[_Transfer] = []
        self._copied: list[tuple[PinnedBuffer, list[Future[None]]]] = []
        self._threads = ThreadPoolExecutor(_THREADS, thread_name_prefix="read-back")

    def begin(self, image: Image) -> AnyArray:
        pixels = image.allocate()
        free = self._free.setdefault(pixels.nbytes, [])
        buffer = free.pop() if free else PinnedBuffer(self._context, pixels.nbytes)
        image.read_into(buffer.buffer)
        self._in_flight.append(_Transfer(buffer, Fence(), pixels))
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
        """Submit copies of the images that have arrived, in order."""
        while self._in_flight and has_arrived(self._in_flight[0].arrived):
            transfer = self._in_flight.pop(0)
            self._copied.append((transfer.buffer, [self._threads.submit(copy) for copy in transfer.copy_tasks()]))
