"""Where on the screen each shading class is, so that its shader runs there and nowhere else.

The depth test chooses the pixels: each pixel's class is written as depth, and a shader is drawn at that of its class.
On the CPU even a rejected pixel costs. So there the screen is cut into squares, and a class is drawn where it is seen.
"""

from typing import Protocol

import moderngl
import numpy as np

from simbev_ros.render.gl.programs import ProgramLibrary, steps_of
from simbev_ros.render.gl.screen_pass import ScreenPass
from simbev_ros.render.gl.targets import Targets
from simbev_ros.render.shading.surfaces import shading_classes
from simbev_ros.types import Int64Array, UInt32Array

_LAYER_STEP = 1.0 / 16.0
_SQUARE_PX = 32
_MOST_SQUARES = 1 << 20  # more than all classes need in an image of 8192 x 8192 pixels


class ClassAreas(Protocol):
    """Makes shaders of shading classes, which are numbered, run on the pixels of their class."""

    def surface_pass(self, fragment: str, number: int, **constants: float) -> ScreenPass:
        """A fragment shader for the pixels of a class, of framebuffers as large as ``targets.surfaces`` of ``find``."""
        ...

    def find(self, targets: Targets) -> None:
        """Find the classes in the G-buffer, which must be bound."""
        ...


def class_areas(context: moderngl.Context, library: ProgramLibrary) -> ClassAreas:
    """What fits the library's screen passes."""
    return _Computed(library) if library.computes else _Squares(context, library)


class _Computed:
    """Every shader runs over the whole screen and looks up each pixel's class first, which costs a GPU little."""

    def __init__(self, library: ProgramLibrary) -> None:
        self._library = library

    def surface_pass(self, fragment: str, number: int, **constants: float) -> ScreenPass:
        flag = "uint(texelFetch(g_color, pixel * SHADING_STEP, 0).a * 255.0 + 0.5)"
        return self._library.screen_pass(fragment, f"{flag} == {1 << number}u", **constants)

    def find(self, targets: Targets) -> None:
        """There is nothing to find."""


class _Squares:
    """The screen in squares. The depth of ``targets.surfaces`` tells the classes apart in squares that hold several."""

    def __init__(self, context: moderngl.Context, library: ProgramLibrary) -> None:
        self._context, self._library = context, library
        self._squares = context.buffer(reserve=4 * _MOST_SQUARES, dynamic=True)
        self._classify = self._array("classify.frag")
        self._classify.program["layer_step"] = _LAYER_STEP
        self._step = steps_of(library.quality)["SHADING_STEP"]
        self._size_px, self._square_px = (1, 1), 1
        self._pure: list[range] = []
        self._mixed: list[range] = []

    def surface_pass(self, fragment: str, number: int, **constants: float) -> ScreenPass:
        return _SquaresPass(self, self._array(fragment, **constants), number)

    def find(self, targets: Targets) -> None:
        self._size_px = targets.surfaces.size
        self._square_px = min(_SQUARE_PX, *self._size_px)
        seen = targets.seen_classes()[:: self._step, :: self._step]
        columns, rows = (_starts(size, self._square_px) for size in self._size_px)
        flags = _united(_united(seen, rows, self._square_px).T, columns, self._square_px).T >> 24
        lonely = flags & flags - 1 == 0
        lonely &= (columns % self._square_px == 0) & (rows % self._square_px == 0)[:, None]  # the others overlap
        sets = [~lonely]
        for number in range(len(shading_classes())):
            shown = flags >> number & 1 != 0
            sets += [shown & lonely, shown & ~lonely]
        places = [np.argwhere(chosen)[:, ::-1] for chosen in sets]
        ends = np.cumsum([len(place) for place in places])
        ranges = [range(end - len(place), end) for place, end in zip(places, ends.tolist(), strict=True)]
        self._pure, self._mixed = ranges[1::2], ranges[2::2]
        corners = np.concatenate(places)
        corners = np.stack([columns[corners[:, 0]], rows[corners[:, 1]]], axis=1).astype(np.uint16)
        self._squares.write(corners.tobytes())
        targets.surfaces.use()
        self._context.enable_only(moderngl.DEPTH_TEST | moderngl.PROGRAM_POINT_SIZE)
        self._context.depth_func = "1"
        self._draw(self._classify, ranges[0], 0.0)
        self._context.depth_func = "=="

    def draw(self, array: moderngl.VertexArray, number: int) -> None:
        """Draw into the framebuffer in use, on the pixels of a class."""
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

    def __init__(self, areas: _Squares, array: moderngl.VertexArray, number: int) -> None:
        self.program = array.program
        self._areas, self._array, self._number = areas, array, number

    def draw(self, target: moderngl.Framebuffer) -> None:
        target.use()
        self._areas.draw(self._array, self._number)


def _starts(size_px: int, square_px: int) -> Int64Array:
    """First pixels of the squares along a side; the last one ends where the side ends."""
    return np.minimum(np.arange(0, size_px, square_px), size_px - square_px)


def _united(flags: UInt32Array, starts: Int64Array, length: int) -> UInt32Array:
    """(len(starts), W) flags that are set in any of ``length`` rows from each start on, of (H, W)."""
    whole = len(starts) - (starts[-1] % length != 0)
    blocks = flags[: whole * length].reshape(whole, length, -1)
    united: UInt32Array = np.bitwise_or.reduce(blocks, axis=1)
    if whole < len(starts):
        last = np.bitwise_or.reduce(flags[starts[-1] :], axis=0, keepdims=True)
        united = np.concatenate([united, last])
    return united
