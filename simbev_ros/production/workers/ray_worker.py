"""A worker on a node of a Ray cluster: an actor that starts a worker's process there and passes its messages on."""

import os
import time
from collections.abc import Mapping
from dataclasses import dataclass, replace
from multiprocessing.connection import wait
from pathlib import Path
from typing import Any

from simbev_ros.config.camera import Camera
from simbev_ros.dataset.plan import PlannedEntry
from simbev_ros.foundation.cache.entries import default_cache_dir
from simbev_ros.foundation.errors import InputError
from simbev_ros.foundation.files.whole_files import write_whole
from simbev_ros.maps.source import MAP_FILES_VARIABLE, name_of_copy
from simbev_ros.production.cluster.node_check import Code, node_problem
from simbev_ros.production.cluster.ray_cluster import this_node
from simbev_ros.production.workers.local_worker import HEARTBEAT_TIMEOUT_S, LocalWorker
from simbev_ros.production.workers.messages import Report, Settings, Signal
from simbev_ros.production.workers.supervised_pool import WorkerLost
from simbev_ros.production.workers.worker_pool import Worker
from simbev_ros.schema.scene.map_spec import MapSpec
from simbev_ros.simulation.render.gl.devices import accessible_gpus

_BATCH_S = 1.0
"""Maximum time for which reports are collected; how a scene ended is passed on at once."""
_END_TIMEOUT_S = 30.0


@dataclass(frozen=True, slots=True)
class Needs:
    """Resources that a worker requests on its node.

    Attributes:
        cpus: Number of CPUs.
        memory_mib: Memory.
        gpus: Fraction of a GPU.
    """

    cpus: int
    memory_mib: int
    gpus: float


@dataclass(frozen=True, slots=True)
class Answer:
    """Answer of an actor to a poll: its node, messages of its process, and how that was lost, if it was."""

    node: str
    messages: list[Any]
    loss: str | None


class WorkerActor:
    """The end of a ``RayWorker`` that lives on the node.

    Args:
        name: Name of the worker.
        settings: What the worker's process needs to begin.
        code: The code on the driver's machine. A node that has joined the cluster late was not checked before.
        map_files: Ray's references to the contents of map files, by what identifies each map.
    """

    def __init__(self, name: str, settings: Settings, code: Code, map_files: Mapping[MapSpec, Any]) -> None:
        self._node, self._problem = this_node(), node_problem(code)
        self._worker: LocalWorker | None = None
        if self._problem is not None:
            return
        os.environ[MAP_FILES_VARIABLE] = str(_fetch(map_files))
        if settings.scenario.sensors_of_type(Camera) and (chosen := _own_gpus()):
            settings = replace(settings, rendering=settings.scenario.rendering.model_copy(update={"gpus": chosen}))
        self._worker = LocalWorker(Worker(name, self._node), settings)

    def poll(self) -> Answer:
        """The messages of about a second; less if the worker waits for the driver, or is lost."""
        if self._worker is None:
            return Answer(self._node, [InputError(f"{self._node}: {self._problem}")], None)
        messages: list[Any] = []
        end_s = time.monotonic() + _BATCH_S
        while (left_s := end_s - time.monotonic()) > 0.0:
            wait([self._worker.connection], left_s)
            try:
                messages += self._worker.read()
            except WorkerLost as loss:
                return Answer(self._node, messages, str(loss))
            if any(not isinstance(message, Report) and message is not Signal.HEARTBEAT for message in messages):
                break
        return Answer(self._node, [message for message in messages if message is not Signal.HEARTBEAT], None)

    def submit(self, entry: PlannedEntry) -> None:
        """Let the process make a scene."""
        if self._worker is not None:
            self._worker.submit(entry)

    def end(self) -> None:
        """End the process, with its graph."""
        if self._worker is not None:
            self._worker.end()
            self._worker.join()


class RayWorker:
    """The driver's end.

    Args:
        worker: Its name; the machine becomes known when Ray has found one.
        needs: What it asks of its node.
        settings: What the worker's process needs to begin.
        code: Ray's reference to the code on this machine.
        map_files: See ``WorkerActor``.
        actor_class: Class of the end on the node.
    """

    def __init__(
        self,
        worker: Worker,
        needs: Needs,
        settings: Settings,
        code: Any,
        map_files: Mapping[MapSpec, Any],
        actor_class: type[Any] = WorkerActor,
    ) -> None:
        import ray

        self.worker, self.needs = worker, needs
        self.is_placed = False
        self._deadline_s = float("inf")
        actor = ray.remote(actor_class).options(
            num_cpus=needs.cpus,
            num_gpus=needs.gpus,
            memory=needs.memory_mib << 20,
            max_concurrency=3,  # poll, give and end at the same time
            max_restarts=0,
            scheduling_strategy="SPREAD",
        )
        self._actor = actor.remote(worker.name, settings, code, map_files)
        self.poll = self._actor.poll.remote()
        self._end: Any = None

    def submit(self, entry: PlannedEntry) -> None:
        """Send a scene to make."""
        self._actor.submit.remote(entry)

    def read(self) -> list[Any]:
        """Messages that have arrived.

        Raises:
            WorkerLost: Actor, node or process have died, or it has been silent for too long.
        """
        import ray

        now_s = time.monotonic()
        if not ray.wait([self.poll], timeout=0)[0]:
            if now_s > self._deadline_s:
                raise WorkerLost(
                    f"{self.worker.name} on {self.worker.machine} has been silent for {HEARTBEAT_TIMEOUT_S:g} s"
                )
            return []
        try:
            answer = ray.get(self.poll)
        except ray.exceptions.RayError as error:
            raise WorkerLost(self._describe(error)) from None
        if answer.loss is not None and not answer.messages:
            raise WorkerLost(answer.loss)
        self.worker = replace(self.worker, machine=answer.node)
        self.is_placed = True
        self._deadline_s = now_s + HEARTBEAT_TIMEOUT_S
        self.poll = self._actor.poll.remote()
        return answer.messages

    def end(self) -> None:
        """Ask the worker to end; return at once."""
        if self.is_placed:
            self._end = self._actor.end.remote()

    def join(self) -> None:
        """Wait for the end of the worker, which is killed if it takes too long."""
        import ray

        if self._end is not None:
            ray.wait([self._end], timeout=_END_TIMEOUT_S)
        self.kill()

    def kill(self) -> None:
        """End the actor at once; the process that it has started notices, and ends by itself."""
        import ray

        ray.kill(self._actor, no_restart=True)

    def _describe(self, error: Exception) -> str:
        import ray

        if isinstance(error, ray.exceptions.RayTaskError):
            return str(error.cause) if error.cause is not None else str(error).strip().splitlines()[-1]
        where = f" on {self.worker.machine}" if self.is_placed else ""
        return f"{self.worker.name}{where} was lost: {type(error).__name__}"


def _fetch(map_files: Mapping[MapSpec, Any]) -> Path:
    """Write the map files that this node lacks into the cache; return their folder."""
    import ray

    folder = default_cache_dir() / "map_files"
    for spec, content in map_files.items():
        path = folder / name_of_copy(spec)
        if not Path(spec.path).is_file() and not path.is_file():
            write_whole(path, ray.get(content))
    return folder


def _own_gpus() -> tuple[int, ...]:
    """EGL's numbers of the GPUs that Ray has given to this actor, on a node with several; else empty: as configured."""
    import ray

    given, gpus = {str(index) for index in ray.get_gpu_ids()}, accessible_gpus()
    return tuple(gpu.index for gpu in gpus if str(gpu.cuda_index) in given) if given and len(gpus) > 1 else ()
