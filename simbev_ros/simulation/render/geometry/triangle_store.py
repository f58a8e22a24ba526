"""Triangle meshes on the GPU, from which any runs of triangles are drawn by one indirect call, each run instanced."""

import math
from collections.abc import Mapping, Sequence
from typing import Any

import moderngl
import numpy as np
from numpy.typing import DTypeLike

from simbev_ros.assets.mesh.mesh import Mesh
from simbev_ros.foundation.geometry.ragged import ragged_starts
from simbev_ros.foundation.types import Int64Array, Table, UInt32Array
from simbev_ros.simulation.render.geometry.vertices import VERTEX_DTYPE, pack_vertices

_FORMATS = {"<f4": "f4", "<u4": "u4"}
_MIN_CAPACITY = 1024


class TriangleStore:
    """Concatenated meshes, and the vertex arrays of programs that draw them.

    Attributes:
        vertices: Number of vertices that are held.
        triangles: Number of triangles that are held.
    """

    def __init__(
        self,
        context: moderngl.Context,
        meshes: Sequence[Mesh],
        programs: Mapping[str, moderngl.Program],
        instance_dtype: DTypeLike,
    ) -> None:
        """Upload the meshes.

        Args:
            context: Current context.
            meshes: Meshes to draw, in this order.
            programs: Programs by name; they read some of the attributes of vertices and instances.
            instance_dtype: float32 and uint32 attributes of instances. ``in_first``, if present, is filled in by the
                store: the index of the run's first triangle, which together with gl_PrimitiveID identifies a triangle.
        """
        self._context, self._programs = context, programs
        self._instance_dtype = np.dtype(instance_dtype)
        self._buffers: list[moderngl.Buffer] = []
        self.replace(meshes)

    def replace(self, meshes: Sequence[Mesh], room: float = 1.0) -> None:
        """Upload other meshes instead of those held so far, into buffers that are larger by a factor."""
        for buffer in self._buffers:
            buffer.release()
        arrays = _merge_meshes(meshes)
        self._buffers = [self._context.buffer(reserve=math.ceil(room * array.nbytes)) for array in arrays]
        self._vertices, self._triangles = self._buffers
        self.vertices = self.triangles = 0
        self._write(*arrays)
        self._allocate(_MIN_CAPACITY)

    def add(self, meshes: Sequence[Mesh]) -> bool:
        """Upload more meshes behind those held so far; return False if there is no room for them."""
        added = _merge_meshes(meshes, self.vertices)
        if any(end > buffer.size for end, buffer in zip(self._ends(*added), self._buffers, strict=True)):
            return False
        self._write(*added)
        return True

    def _write(self, vertices: Table, triangles: UInt32Array) -> None:
        """Write behind what the buffers hold."""
        for array, end, buffer in zip(
            (vertices, triangles), self._ends(vertices, triangles), self._buffers, strict=True
        ):
            buffer.write(array, offset=end - array.nbytes)
        self.vertices, self.triangles = self.vertices + len(vertices), self.triangles + len(triangles)

    def _ends(self, vertices: Table, triangles: UInt32Array) -> tuple[int, int]:
        """Bytes of both buffers that are in use once these are behind what they hold."""
        return (
            (self.vertices + len(vertices)) * vertices.itemsize,
            (self.triangles + len(triangles)) * 3 * triangles.itemsize,
        )

    def program(self, name: str) -> moderngl.Program:
        """The program of a name, for setting uniforms."""
        return self._programs[name]

    def bind(self, vertices: int, triangles: int) -> None:
        """Bind vertices and triangles as shader storage at two binding points."""
        self._vertices.bind_to_storage_buffer(vertices)
        self._triangles.bind_to_storage_buffer(triangles)

    def draw(self, program: str, first: Int64Array, end: Int64Array, counts: Int64Array, instances: Table) -> None:
        """Draw runs of triangles in their order.

        Args:
            program: Name of the program.
            first: (K,) index of the first triangle, across all meshes.
            end: (K,) index after the last triangle.
            counts: (K,) number of instances.
            instances: (sum of counts,) rows of the instance dtype, run after run.
        """
        if not len(first):
            return
        if max(len(first), len(instances)) > self._capacity:
            self._allocate(2 * max(len(first), len(instances)))
        if "in_first" in (self._instance_dtype.names or ()):
            instances["in_first"] = np.repeat(first, counts)
        commands = np.zeros((len(first), 5), np.uint32)  # indices, instances, first index, base vertex, base instance
        commands[:, 0], commands[:, 1], commands[:, 2] = 3 * (end - first), counts, 3 * first
        commands[:, 4] = ragged_starts(counts)
        for buffer, content in ((self._instances, instances), (self._commands, commands)):
            buffer.orphan()
            buffer.write(content)
        self._arrays[program].render_indirect(self._commands, count=len(first))

    def _allocate(self, capacity: int) -> None:
        """Allocate buffers for the given number of runs and instances."""
        self._capacity = capacity
        dtype = self._instance_dtype
        self._instances = self._context.buffer(reserve=capacity * dtype.itemsize, dynamic=True)
        self._commands = self._context.buffer(reserve=capacity * 20, dynamic=True)
        self._arrays = {
            name: self._context.vertex_array(
                program,
                [
                    (self._vertices, *_layout(VERTEX_DTYPE, program)),
                    *([(self._instances, *used)] if (used := _layout(dtype, program, "/i"))[1:] else []),
                ],
                self._triangles,
            )
            for name, program in self._programs.items()
        }


def _layout(dtype: np.dtype[Any], program: moderngl.Program, divisor: str = "") -> tuple[str, ...]:
    """Buffer layout for a program that uses some fields of a dtype: format string, then the names of the fields."""
    formats, used = [], []
    for name in dtype.names or ():
        field = dtype[name]
        if name in program:
            formats.append(f"{int(np.prod(field.shape))}{_FORMATS[field.base.str]}")
            used.append(name)
        else:
            formats.append(f"{field.itemsize}x")
    return (" ".join(formats) + divisor, *used)


def _merge_meshes(meshes: Sequence[Mesh], first: int = 0) -> tuple[Table, UInt32Array]:
    """Packed vertices, counted from ``first``, and (T, 3) corners of all meshes; without any one zero row of each.

    Buffers cannot be empty.
    """
    count = sum(len(mesh.vertices) for mesh in meshes)
    vertices = np.zeros(max(count, 1), VERTEX_DTYPE)
    triangles = np.zeros((max(sum(len(mesh.triangles) for mesh in meshes), 1), 3), np.uint32)
    vertex = triangle = 0
    for mesh in meshes:
        vertices[vertex : vertex + len(mesh.vertices)] = pack_vertices(mesh)
        target = triangles[triangle : triangle + len(mesh.triangles)]
        np.add(mesh.triangles.view(np.uint32), np.uint32(first + vertex), out=target)
        vertex, triangle = vertex + len(mesh.vertices), triangle + len(mesh.triangles)
    return vertices, triangles
