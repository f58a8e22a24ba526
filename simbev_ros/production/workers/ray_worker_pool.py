"""Workers on a Ray cluster, as many as there is room for, with needs that follow what the scenes cost."""

import time
from collections.abc import Iterable, Mapping
from dataclasses import replace
from itertools import count
from pathlib import Path
from typing import Any

from simbev_ros.config.camera import Camera
from simbev_ros.config.scenario import Scenario
from simbev_ros.foundation.errors import GraphError, InputError
from simbev_ros.foundation.files.limits import MAX_OSM_BYTES
from simbev_ros.maps.source import file_of
from simbev_ros.production.cluster.node_check import Code
from simbev_ros.production.cluster.ray_cluster import RayCluster, largest
from simbev_ros.production.observer import SILENT, ProductionObserver
from simbev_ros.production.scene_cost import SceneCost
from simbev_ros.production.scene_ending import MadeScene
from simbev_ros.production.upload import UploaderFactory, no_upload
from simbev_ros.production.workers.machine_capacity import MEMORY_MARGIN
from simbev_ros.production.workers.messages import Settings
from simbev_ros.production.workers.ray_worker import Needs, RayWorker, WorkerActor
from simbev_ros.production.workers.supervised_pool import SupervisedPool
from simbev_ros.production.workers.worker_pool import Worker
from simbev_ros.scene.drawing.chosen_maps import maps_of
from simbev_ros.schema.scene.map_spec import MapSpec

_POLL_S, _NODES_S = 0.5, 5.0
_FIRST_NEEDS = Needs(cpus=2, memory_mib=2048, gpus=0.25)
"""Resources that workers request until a scene has been measured."""
_MAX_CPUS = 4
"""CPUs that a worker asks for at most: alone on a large node a graph uses more, and leaves many of them idle."""
_MEMORY_STEP_MIB, _GPU_STEP = 256, 0.05
_NODE_PATIENCE_S = 900.0
"""Maximum time for the first node with CPUs to join a cluster that begins without any."""


class RayWorkerPool(SupervisedPool):
    """Workers that Ray places on nodes; new ones are asked for while there is room and scenes are left.

    Args:
        cluster: The cluster.
        scenario: The configuration.
        staging: Folder for unfinished scenes that all nodes see; None: workers have temporary folders on their nodes.
        scenes: Number of scenes to make.
        observer: Receives the progress.
        uploader_for: Uploaders of finished bags.
        actor_class: Class of the workers' ends on the nodes.
        maps: Maps whose files the nodes need; None: those of the configuration.

    Raises:
        InputError: No node has enough memory for a graph, or a map file cannot be read.
    """

    def __init__(
        self,
        cluster: RayCluster,
        scenario: Scenario,
        staging: Path | None,
        scenes: int,
        observer: ProductionObserver = SILENT,
        uploader_for: UploaderFactory = no_upload,
        actor_class: type[Any] = WorkerActor,
        *,
        maps: Iterable[MapSpec] | None = None,
    ) -> None:
        import ray

        super().__init__(observer)
        self._cluster, self._scenario, self._left = cluster, scenario, scenes
        self._staging, self._uploader_for, self._actor_class = staging, uploader_for, actor_class
        self._numbers = count(1)
        self._looked_s, self._began_s = 0.0, time.monotonic()
        self._needs = self._first_needs()
        self._maps = tuple(dict.fromkeys(maps_of(scenario) if maps is None else maps))
        self._map_files, self._code = _share_files(self._maps), ray.put(Code.here())
        self.machines = 1
        self._look_at_nodes()

    def _first_needs(self) -> Needs:
        """Needs before anything was measured: what nodes have, if that is less.

        Raises:
            InputError: There are nodes with CPUs, and none has enough memory.
        """
        nodes = [node for node in self._cluster.nodes() if node.cpus >= 1]
        if nodes and not any(node.memory_mib >= _FIRST_NEEDS.memory_mib for node in nodes):
            needed = f"{_FIRST_NEEDS.memory_mib / 1024:g} GiB"
            raise InputError(
                f"a graph takes {needed} of memory, the largest node offers {largest(nodes)}", parameter="ray"
            )
        cpus = int(max((node.cpus for node in nodes), default=_FIRST_NEEDS.cpus))
        draws = bool(self._scenario.sensors_of_type(Camera)) and self._scenario.rendering.gpus != ()
        has_gpus = any(node.gpus for node in nodes)
        return replace(
            _FIRST_NEEDS, cpus=min(cpus, _FIRST_NEEDS.cpus), gpus=_FIRST_NEEDS.gpus if draws and has_gpus else 0.0
        )

    def _look_at_nodes(self) -> None:
        """Count the nodes that can have workers, not more often than necessary."""
        if time.monotonic() - self._looked_s < _NODES_S:
            return
        self._looked_s = time.monotonic()
        nodes = sum(node.cpus >= 1 for node in self._cluster.nodes())
        if not nodes and time.monotonic() - self._began_s > _NODE_PATIENCE_S:
            raise GraphError(f"no node with CPUs has joined the cluster within {_NODE_PATIENCE_S / 60:g} min")
        self.machines = max(nodes, 1)

    def _scale(self) -> None:
        """Keep some workers waiting for room, so that each new node gets one, and replace those with outdated needs."""
        self._look_at_nodes()
        waiting = 0
        idle = self.idle()
        for handle in self._handles:
            assert isinstance(handle, RayWorker)
            if handle.needs != self._needs and (not handle.is_placed or handle.worker in idle):
                self._stop_worker(handle)
            else:
                waiting += not handle.is_placed
        wanted = max(2, len(self._handles) - waiting)
        for _ in range(min(wanted - waiting, self._left - len(self._handles))):
            worker = Worker(f"worker-{next(self._numbers)}", "")
            staging = None if self._staging is None else self._staging.absolute() / worker.name
            settings = Settings(self._scenario, staging, self._maps, uploader=self._uploader_for(worker.name))
            self._add_worker(RayWorker(worker, self._needs, settings, self._code, self._map_files, self._actor_class))

    def _record_cost(self, scene: MadeScene) -> None:
        """Correct the needs by what a scene has cost, where they are off by much."""
        self._left -= 1
        needs, cost = self._needs, scene.cost
        if abs(cost.cores - needs.cpus) > 0.75:
            needs = replace(needs, cpus=min(max(round(cost.cores), 1), _MAX_CPUS))
        wanted_mib = -(-int(cost.memory_mib * MEMORY_MARGIN) // _MEMORY_STEP_MIB) * _MEMORY_STEP_MIB
        if wanted_mib > needs.memory_mib or wanted_mib < needs.memory_mib // 2:
            needs = replace(needs, memory_mib=max(wanted_mib, _MEMORY_STEP_MIB))
        self._needs = replace(needs, gpus=self._gpu_share(cost))

    def _gpu_share(self, cost: SceneCost) -> float:
        """Fraction of a GPU that a worker needs: what is in use on a machine, shared by its workers."""
        before = self._needs.gpus
        workers = max(sum(isinstance(handle, RayWorker) and handle.is_placed for handle in self._handles), 1)
        share = max(round(cost.gpus * self.machines / workers / _GPU_STEP), 1) * _GPU_STEP
        return min(share, 1.0) if before and abs(share - before) > _GPU_STEP else before

    def _pause(self, timeout_s: float) -> None:
        import ray

        polls = [handle.poll for handle in self._handles if isinstance(handle, RayWorker)]
        if polls:
            ray.wait(polls, num_returns=1, timeout=min(timeout_s, _POLL_S))
        else:
            time.sleep(min(timeout_s, _POLL_S))


def _share_files(maps: Iterable[MapSpec]) -> Mapping[MapSpec, Any]:
    """Ray's references to the contents of map files, for nodes that do not see them; larger files do not travel."""
    import ray

    files = {spec: file_of(spec) for spec in maps if spec.path}
    return {spec: ray.put(file.read_bytes()) for spec, file in files.items() if file.stat().st_size <= MAX_OSM_BYTES}
