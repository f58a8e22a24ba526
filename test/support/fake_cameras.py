"""A camera node without OpenGL: its renderer records what is requested of it."""

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from started_nodes import collecting_node

from simbev_ros.maps.roads.tunnels import Tunnels
from simbev_ros.ros.nodes import camera_node, surroundings
from simbev_ros.schema.scene.spec import SceneSpec
from simbev_ros.schema.scene.state import ACTOR_DTYPE, EGO_ID, SIGNAL_DTYPE, WorldState
from simbev_ros.simulation.render.frame import CameraImages, CameraView, RenderFrame

_IMAGES = {
    "rgb": np.zeros((16, 16, 3), np.uint8),
    "semantic": np.zeros((16, 16), np.uint8),
    "flow": np.zeros((16, 16, 2), np.float32),
    "instance": np.zeros((16, 16), np.uint16),
}


class FakeRenderer:
    """Records all calls; images are black, but for color images, in which every value is the ego's id modulo 251.

    Attributes:
        calls: Views and frame of each call of ``render``.
        agents: The number of agents that was set last.
    """

    def __init__(self, *_: object) -> None:
        self.calls: list[tuple[Sequence[CameraView], RenderFrame]] = []
        self.agents = 0

    @property
    def requests(self) -> list[tuple[int, tuple[str, ...], int, int | None]]:
        """Width and modalities of each requested camera, and the ticks of the frame and the previous frame."""
        return [
            (
                view.camera.width_px,
                tuple(view.modalities),
                frame.world.tick,
                None if frame.previous is None else frame.previous.tick,
            )
            for views, frame in self.calls
            for view in views
        ]

    def set_appearance(self, *_: object) -> None:
        pass

    def set_lights(self, *_: object) -> None:
        pass

    def set_agents(self, count: int) -> None:
        self.agents = count

    def render(self, views: Sequence[CameraView], frame: RenderFrame) -> list[CameraImages]:
        self.calls.append((views, frame))
        images = _IMAGES | {"rgb": _IMAGES["rgb"] + np.uint8(frame.world.ego_id % 251)}
        return [CameraImages(**{name: images[name] for name in view.modalities}) for view in views]

    def close(self) -> None:
        pass


@contextmanager
def started_camera_node(spec: SceneSpec, monkeypatch: pytest.MonkeyPatch, *arguments: str) -> Iterator[Any]:
    """A camera node, with arguments in ROS's form, that has started a scene and collects its messages in ``sent``."""
    monkeypatch.setattr(camera_node, "Renderer", FakeRenderer)
    monkeypatch.setattr(camera_node, "open_context", lambda *_: SimpleNamespace(release=lambda: None))
    monkeypatch.setattr(surroundings, "loaded_reach", lambda *_: None)
    monkeypatch.setattr(surroundings, "load_static_scene", lambda *_, **__: SimpleNamespace(tunnels=Tunnels.none()))
    monkeypatch.setattr(surroundings, "_loaded", {})
    with collecting_node("camera", spec, monkeypatch, *arguments) as node:
        yield node


def set_readers(node: Any, monkeypatch: pytest.MonkeyPatch, *names: str) -> None:
    """Let topics of these names have one reader each, and all others none."""
    monkeypatch.setattr(node, "reader_count", lambda name: int(name in names))


def state_at(spec: SceneSpec, tick: int) -> WorldState:
    """A state of an empty world."""
    empty = np.zeros(0, ACTOR_DTYPE), np.zeros(0, SIGNAL_DTYPE)
    return WorldState(spec.stamp_ns(tick), tick, EGO_ID, *empty, spec.weather)


def play(node: Any, spec: SceneSpec, ticks: Sequence[int]) -> FakeRenderer:
    """Let the node serve ticks; returns its renderer."""
    for tick in ticks:
        state = state_at(spec, tick)
        node.process(spec, state)
        node.finish(spec, state)
    node._send(0)
    renderer: FakeRenderer = node._surroundings.built
    return renderer
