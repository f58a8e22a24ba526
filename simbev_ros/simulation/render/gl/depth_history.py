"""Depth images that cameras had in their previous frame, to tell which points were visible in it.

In: the depth image of each camera with flow, as it is drawn. Out: the texture ``previous_depth`` of
shaders/include/flow.glsl for the next frame of that camera.
"""

from typing import NamedTuple

import moderngl

from simbev_ros.schema.scene.state import WorldState
from simbev_ros.simulation.render.frame import CameraView
from simbev_ros.simulation.render.gl.programs import TEXTURE_UNITS
from simbev_ros.simulation.render.gl.targets import Image


class _Remembered(NamedTuple):
    """A depth image and the actors of the world that it shows."""

    actors: bytes
    texture: moderngl.Texture
    buffer: moderngl.Buffer


class DepthHistory:
    """Keeps the latest depth image of each camera; cameras of several agents are told apart by the ego.

    Args:
        context: OpenGL context.
    """

    def __init__(self, context: moderngl.Context) -> None:
        self._context = context
        self._images: dict[tuple[object, ...], _Remembered] = {}

    def has(self, camera: CameraView, world: WorldState, *, show_ego: bool) -> bool:
        """Whether the latest image of a camera shows a world."""
        remembered = self._images.get(_key(camera, world, show_ego))
        return remembered is not None and remembered.actors == world.actors.tobytes()

    def store(self, camera: CameraView, world: WorldState, depth: Image, *, show_ego: bool) -> None:
        """Copy the depth image of a camera, in place of an earlier one."""
        key, size_px = _key(camera, world, show_ego), depth.framebuffer.size
        if key not in self._images:
            texture = self._context.texture(size_px, 1, dtype="f4")
            texture.filter = (moderngl.NEAREST, moderngl.NEAREST)
            self._images[key] = _Remembered(b"", texture, self._context.buffer(reserve=4 * size_px[0] * size_px[1]))
        old = self._images[key]
        depth.read_into(old.buffer)
        old.texture.write(old.buffer)
        self._images[key] = old._replace(actors=world.actors.tobytes())

    def bind(self, camera: CameraView, world: WorldState, *, show_ego: bool) -> None:
        """Bind the latest image of a camera."""
        self._images[_key(camera, world, show_ego)].texture.use(TEXTURE_UNITS["previous_depth"])


def _key(camera: CameraView, world: WorldState, show_ego: bool) -> tuple[object, ...]:
    return camera.camera, camera.ego_from_sensor.tobytes(), world.ego_id, show_ego
