"""Runs the shader of each shading class only on the pixels of its class.

On the CPU, the depth test selects the pixels: each pixel's class is written as depth, and a shader is drawn at the
depth of its class. Even a rejected pixel has a cost there, so the screen is divided into squares, and a class is drawn
only in squares that contain it. On a GPU, compute shaders check each pixel's class themselves.
"""

from typing import Protocol

import moderngl
import numpy as np

from simbev_ros.foundation.types import Int64Array, UInt32Array
from simbev_ros.simulation.render.gl.programs import ProgramLibrary, quality_steps
from simbev_ros.simulation.render.gl.screen_pass import ScreenPass
from simbev_ros.simulation.render.gl.targets import Targets
from simbev_ros.simulation.render.shading.surfaces import shading_classes

_LAYER_STEP = 1.0 / 16.0
_SQUARE_PX = 32
_MAX_SQUARES = 1 << 20  # more than all classes need in an image of 8192 x 8192 pixels


class ClassAreas(Protocol):
    """Runs shaders of shading classes, identified by number, on the pixels of their class."""

    def surface_pass(self, fragment: str, number: int, **constants: float) -> ScreenPass:
        """Compile a fragment shader for the pixels of a class, for framebuffers of the size of ``targets.surfaces``."""
        ...

    def find(self, targets: Targets) -> None:
        """Find the classes in the G-buffer, which must be bound."""
        ...


def create_class_areas(context: moderngl.Context, library: ProgramLibrary) -> ClassAreas:
    """Create the kind of ``ClassAreas`` that matches the library's screen passes."""
    return _ComputeAreas(library) if library.use_compute else _SquareAreas(context, library)


class _ComputeAreas:
    """Every shader runs on the whole screen and first looks up each pixel's class, which is cheap on a GPU."""

    def __init__(self, library: ProgramLibrary) -> None:
        self._library = library

    def surface_pass(self, fragment: str, number: int, **constants: float) -> ScreenPass:
        flag = "uint(texelFetch(g_color, pixel * SHADING_STEP, 0).a * 255.0 + 0.5)"
        return self._library.screen_pass(fragment, f"{flag} == {1 << number}u", **constants)

    def find(self, targets: Targets) -> None:
        """Do nothing: the shaders look up the classes themselves."""


class _SquareAreas:
    """The screen in squares. In squares with several classes, the depth of ``targets.surfaces`` separates them."""

    def __init__(self, context: moderngl.Context, library: ProgramLibrary) -> None:
        self._context, self._library = context, library
        self._squares = context.buffer(reserve=4 * _MAX_SQUARES, dynamic=True)
        self._classify = self._array("classify.frag")
        self._classify.program["layer_step"] = _LAYER_STEP
        self._step = quality_steps(library.quality)["SHADING_STEP"]
        self._size_px, self._square_px = (1, 1), 1
        self._pure: list[range] = []
        self._mixed: list[range] = []

    def surface_pass(self, fragment: str, number: int, **constants: float) -> ScreenPass:
        return _SquaresPass(self, self._array(fragment, **constants), number)

    def find(self, targets: Targets) -> None:
        self._size_px = targets.surfaces.size
        self._square_px = min(_SQUARE_PX, *self._size_px)
        class_flags = targets.read_class_flags()[:: self._step, :: self._step]
        columns, rows = (_square_starts(size, self._square_px) for size in self._size_px)
        flags = (
            _union_of_blocks(_union_of_blocks(class_flags, rows, self._square_px).T, columns, self._square_px).T >> 24
        )
        is_pure = flags & flags - 1 == 0
        # the other squares overlap their neighbors
        is_pure &= (columns % self._square_px == 0) & (rows % self._square_px == 0)[:, None]
        sets = [~is_pure]
        for number in range(len(shading_classes())):
            has_class = flags >> number & 1 != 0
            sets += [has_class & is_pure, has_class & ~is_pure]
        squares = [np.argwhere(selected)[:, ::-1] for selected in sets]
        ends = np.cumsum([len(square) for square in squares])
        ranges = [range(end - len(square), end) for square, end in zip(squares, ends.tolist(), strict=True)]
        self._pure, self._mixed = ranges[1::2], ranges[2::2]
        corners = np.concatenate(squares)
        corners = np.stack([columns[corners[:, 0]], rows[corners[:, 1]]], axis=1).astype(np.uint16)
        self._squares.write(corners.tobytes())
        targets.surfaces.use()
        self._context.enable_only(moderngl.DEPTH_TEST | moderngl.PROGRAM_POINT_SIZE)
        self._context.depth_func = "1"
        self._draw(self._classify, ranges[0], 0.0)
        self._context.depth_func = "=="

    def draw(self, array: moderngl.VertexArray, number: int) -> None:
        """Draw into the current framebuffer, on the pixels of a class."""
        self._context.enable_only(moderngl.PROGRAM_POINT_SIZE)
        self._draw(array, self._pure[number], 0.0)
        self._context.enable_only(moderngl.DEPTH_TEST | moderngl.PROGRAM_POINT_SIZE)
        self._draw(array, self._mixed[number], (number + 0.5) * _LAYER_STEP)
        self._context.enable_only(moderngl.NOTHING)

    def _array(self, fragment: str, **constants: float) -> moderngl.VertexArray:
        program = self._library.load("square.vert", fragment, None, **constants)
        return self._context.vertex_array(program, [(self._squares, "2u2", "in_square")])

    def _draw(self, array: moderngl.VertexArray, squares: range, layer: float) -> None:
        if squares:
            program = array.program
            program["layer"], program["target_px"], program["square_px"] = layer, self._size_px, self._square_px
            array.render(moderngl.POINTS, vertices=len(squares), first=squares.start)


class _SquaresPass:
    """A ``ScreenPass`` on the squares of one class."""

    def __init__(self, areas: _SquareAreas, array: moderngl.VertexArray, number: int) -> None:
        self.program = array.program
        self._areas, self._array, self._number = areas, array, number

    def draw(self, target: moderngl.Framebuffer) -> None:
        target.use()
        self._areas.draw(self._array, self._number)


def _square_starts(size_px: int, square_px: int) -> Int64Array:
    """First pixels of the squares along a side; the last square ends at the end of the side."""
    return np.minimum(np.arange(0, size_px, square_px), size_px - square_px)


def _union_of_blocks(flags: UInt32Array, starts: Int64Array, length: int) -> UInt32Array:
    """(len(starts), W) bitwise union of (H, W) flags over ``length`` rows from each start."""
    full_blocks = len(starts) - (starts[-1] % length != 0)
    blocks = flags[: full_blocks * length].reshape(full_blocks, length, -1)
    union: UInt32Array = np.bitwise_or.reduce(blocks, axis=1)
    if full_blocks < len(starts):
        last = np.bitwise_or.reduce(flags[starts[-1] :], axis=0, keepdims=True)
        union = np.concatenate([union, last])
    return union
