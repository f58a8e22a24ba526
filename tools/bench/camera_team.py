"""Processes that share the cameras of a rig as camera nodes do, for timing."""

import os
import signal
import time
from collections.abc import Callable, Sequence
from functools import partial
from itertools import pairwise
from multiprocessing import get_context, resource_tracker
from multiprocessing.connection import Connection
from multiprocessing.context import SpawnProcess
from typing import Literal, NamedTuple, Self

from simbev_ros.assets.actors.catalog import load_models
from simbev_ros.config.rendering import Device, Quality, Rendering
from simbev_ros.foundation.errors import SimbevError
from simbev_ros.foundation.process_memory import keep_freed_memory
from simbev_ros.simulation.render.frame import CameraView, RenderFrame
from simbev_ros.simulation.render.gl.context import open_context
from simbev_ros.simulation.render.renderer import Renderer
from simbev_ros.simulation.render.shares import camera_processes, drawing_environment
from tools.bench.camera_scene import CameraScene
from tools.bench.mujoco_scene import MujocoScene

Painter = Quality | Literal["MuJoCo"]
"""The renderer to time: ours at a quality, or MuJoCo's."""


class _Share(NamedTuple):
    """The cameras that one process draws, with the scene and the device."""

    scene: CameraScene
    views: Sequence[CameraView]
    device: Device
    turn: int


class _LoadedRenderer(NamedTuple):
    """A renderer that has loaded the scene."""

    draw: Callable[[RenderFrame], object]
    close: Callable[[], None]


class CameraTeam:
    """Processes that draw one scene together; as a context manager it ends them."""

    def __init__(self, scene: CameraScene, views: Sequence[CameraView], rendering: Rendering) -> None:
        """Start as many processes as a graph with this configuration would, and send them the scene.

        Raises:
            RenderError: The number of GPUs is wanted, but there is no EGL.
        """
        self.processes = camera_processes(rendering, len(views))
        self._lines: list[Connection] = []
        self._workers: list[SpawnProcess] = []
        shares = [
            _Share(scene, views[index :: self.processes], rendering.device_of(index), index)
            for index in range(self.processes)
        ]
        try:
            self._start()
            for line, share in zip(self._lines, shares, strict=True):
                line.send(share)
        except BaseException:
            self.close()
            raise

    def _start(self) -> None:
        context = get_context("spawn")
        environment = drawing_environment(self.processes)
        resource_tracker.ensure_running()  # when it starts, it unblocks SIGINT
        # The workers inherit this: only the parent reacts to Ctrl-C.
        signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
        try:
            for _ in range(self.processes):
                line, far_end = context.Pipe()
                self._lines.append(line)
                worker = context.Process(target=_serve, args=(far_end, environment), daemon=True)
                worker.start()
                self._workers.append(worker)
                far_end.close()
        finally:
            signal.pthread_sigmask(signal.SIG_UNBLOCK, {signal.SIGINT})

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """Kill the processes and wait for their end."""
        for worker in self._workers:
            worker.kill()  # it holds nothing that outlives it
            worker.join()
        for line in self._lines:
            line.close()

    def prepare(self, painter: Painter) -> None:
        """Load the scene into a renderer in all processes.

        Raises:
            RenderError: OpenGL is not usable here, or has too little memory.
            SimbevError: A process was killed.
        """
        self._answers(painter)

    def draw(self, moment: int) -> tuple[float, float]:
        """Draw one moment of the scene, counted from 0, with all cameras.

        Returns:
            Wall time until all images were in memory, and processor time of all processes, s.

        Raises:
            RenderError: Memory ran out.
            SimbevError: A process was killed.
        """
        start_s = time.perf_counter()
        cpu_s = sum(self._answers(moment))
        return time.perf_counter() - start_s, cpu_s

    def _answers(self, request: Painter | int) -> list[float]:
        """Send a request to all processes and return the processor time that each spent on it, s."""
        try:
            for line in self._lines:
                line.send(request)
            answers = [line.recv() for line in self._lines]
        except (EOFError, OSError):
            raise SimbevError("a process that drew cameras was killed; is there memory enough?") from None
        for answer in answers:
            if isinstance(answer, Exception):
                raise answer
        return answers


def moments(scene: CameraScene) -> list[RenderFrame]:
    """The frames of a scene; the first one is for warm-up."""
    return [RenderFrame(now, before) for before, now in pairwise(scene.states)]


def _serve(line: Connection, environment: dict[str, str]) -> None:
    """Answer requests with their processor time, s, or with the error, until the connection closes."""
    os.environ.update(environment)  # before OpenGL is loaded
    keep_freed_memory()
    loaded: _LoadedRenderer | None = None
    try:
        share: _Share = line.recv()
        frames = moments(share.scene)
        while True:
            request: Painter | int = line.recv()
            start_s = time.process_time()
            if isinstance(request, int):
                assert loaded is not None, "nothing is prepared"
                loaded.draw(frames[request])
            else:
                if loaded is not None:
                    loaded.close()
                loaded = _load(request, share)
            line.send(time.process_time() - start_s)
    except (EOFError, ConnectionError):  # the parent has ended
        return
    except Exception as error:
        line.send(error)


def _load(painter: Painter, share: _Share) -> _LoadedRenderer:
    scene, models = share.scene, load_models()
    if painter == "MuJoCo":
        rival = MujocoScene(scene.static, models, scene.states[-1], share.views)
        return _LoadedRenderer(lambda _: rival.render(), rival.close)
    renderer = Renderer(scene.static, models, open_context(share.device, share.turn), painter)
    renderer.set_lights(scene.lights)
    return _LoadedRenderer(partial(renderer.render, share.views), renderer.close)
